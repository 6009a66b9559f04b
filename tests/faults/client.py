"""A client of the viewer that measures how late its updates are."""

import json
import threading
import time
from dataclasses import dataclass, field

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from manytouch.sinks.viewer import Viewer
from manytouch.sinks.viewer.update_format import unpack


def connect_to(viewer: Viewer) -> ClientConnection:
    """Connect as a program that has the token."""
    assert viewer.token_file is not None
    headers = {"Authorization": f"Bearer {viewer.token_file.read_text()}"}
    return connect(viewer.access.stream_url, additional_headers=headers, max_size=2**24, compression=None)


@dataclass
class Listener:
    """Receives updates in a thread within a `with` block; `latency_ms` has that of each, `at_s` its time."""

    viewer: Viewer
    latency_ms: list[float] = field(default_factory=list)
    at_s: list[float] = field(default_factory=list)

    def __enter__(self) -> "Listener":
        self._stream = connect_to(self.viewer)
        self._thread = threading.Thread(target=self._listen, name="listener")
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()
        self._thread.join()

    def _listen(self) -> None:
        try:
            for message in self._stream:
                if isinstance(message, str):
                    continue
                head, _ = unpack(message)
                now_ns = time.monotonic_ns()
                self._stream.send(json.dumps({"type": "ack", "number": head["number"]}))
                self.at_s.append(now_ns * 1e-9)
                self.latency_ms.append((now_ns - head["arrived_ns"]) * 1e-6)
        except ConnectionClosed:
            pass
