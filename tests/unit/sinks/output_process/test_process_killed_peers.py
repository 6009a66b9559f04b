"""Programs that receive are killed while they do, and started again; no output is disturbed."""

import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from manytouch.sinks.output_process.process import OutputProcess

PEERS = Path(__file__).parents[3] / "peers"
DOMAIN = 85
FORCE_N = 5.0
VALUES = {"osc": FORCE_N, "tuio": 17.5 / 30.0, "foxglove": FORCE_N, "dds": -FORCE_N}


@contextmanager
def writing(output: OutputProcess, reading) -> Iterator[None]:
    """Writes a reading 50 times per second, in a thread."""
    is_over = threading.Event()

    def run() -> None:
        while not is_over.wait(0.02):
            output.write(reading)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.mark.slow
def test_every_receiver_may_be_killed_and_started_again(
    session, reading_of, contact_of, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", (PEERS / "loopback.xml").as_uri())
    ports = {"osc": free_port(), "tuio": free_port(), "dds": DOMAIN}
    urls = [f"{name}://127.0.0.1:{ports[name]}" for name in ("osc", "tuio")]
    urls += ["foxglove://127.0.0.1:0", f"ros2://skin?domain={DOMAIN}"]
    reading = reading_of(3, (contact_of(7, force_N=np.array([0.0, 0.0, -FORCE_N])),))
    output = OutputProcess(urls, session)
    served = re.search(r"ws://127.0.0.1:(\d+)", output.descriptions[2])
    assert served is not None
    ports["foxglove"] = int(served.group(1))
    with closing(output), writing(output, reading):
        for _ in range(2):
            with ExitStack() as stack:
                peers = {name: stack.enter_context(started(name, port)) for name, port in ports.items()}
                for name, peer in peers.items():
                    assert peer.stdout is not None
                    value = next(line for line in peer.stdout if line.startswith("value"))
                    assert float(value.split()[1]) == pytest.approx(VALUES[name], rel=1e-6), name
    for state in output.states:
        assert state.problem is None, state.name
        assert state.sent > state.dropped, state.name  # a busy machine may drop some


@contextmanager
def started(name: str, port: int) -> Iterator["subprocess.Popen[str]"]:
    """A receiver, which is killed at the end."""
    command = [sys.executable, str(PEERS / "receivers.py"), name, str(port)]
    peer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    yield peer
    peer.kill()
    peer.communicate()
