"""A camera made of a file: pre-encoded pictures as Motion JPEG over HTTP, at a rate, on loopback.

    python benchmarks/mjpeg_server.py FOLDER --fps 30

serves the JPEGs of a folder to and fro and prints the address.
"""

import argparse
import contextlib
import socket
import threading
import time
from collections.abc import Sequence
from pathlib import Path

BOUNDARY = "picture"


class MjpegServer:
    """Serves pictures while its block lasts; every client begins with the first.

    Attributes:
        url: its address.
        sent: pictures sent to the last client.
    """

    def __init__(
        self,
        pictures: Sequence[bytes],
        *,
        fps: float = 30.0,
        sends_length: bool = True,
        sends_time: bool = False,
    ) -> None:
        """Listen; nobody is served before the block begins.

        Args:
            pictures: JPEGs, sent over and over.
            fps: rate.
            sends_length, sends_time: send Content-Length, X-Timestamp with each picture.
        """
        self._pictures = pictures
        self._fps = fps
        self._sends_length = sends_length
        self._sends_time = sends_time
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._socket.settimeout(0.1)
        self._is_over = threading.Event()
        self._is_out = threading.Event()
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}/stream.mjpg"
        self.sent = 0

    def __enter__(self) -> "MjpegServer":
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        for thread in tuple(self._threads):
            thread.join()
        self._socket.close()

    def unplug(self) -> None:
        """End all connections, and accept none."""
        self._is_out.set()

    def plug_in(self) -> None:
        """Accept connections again."""
        self._is_out.clear()

    def _accept(self) -> None:
        while not self._is_over.is_set():
            try:
                client, _ = self._socket.accept()
            except TimeoutError:
                continue
            if self._is_out.is_set():
                client.close()
                continue
            thread = threading.Thread(target=self._serve, args=(client,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError):
            client.settimeout(5.0)
            client.recv(65536)
            kind = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
            client.sendall(f"HTTP/1.0 200 OK\r\nContent-Type: {kind}\r\n\r\n".encode())
            begun_s = time.monotonic()
            number = 0
            while not (self._is_over.is_set() or self._is_out.is_set()):
                wait_s = begun_s + number / self._fps - time.monotonic()
                if wait_s > 0:
                    time.sleep(min(wait_s, 0.05))
                    continue
                self._send(client, self._pictures[number % len(self._pictures)])
                number += 1
                self.sent = number

    def _send(self, client: socket.socket, picture: bytes) -> None:
        head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\n"
        if self._sends_length:
            head += f"Content-Length: {len(picture)}\r\n"
        if self._sends_time:
            head += f"X-Timestamp: {time.time():.6f}\r\n"
        client.sendall(f"{head}\r\n".encode() + picture + b"\r\n")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fps", type=float, default=30.0)
    arguments = parser.parse_args()
    there = [path.read_bytes() for path in sorted(arguments.folder.glob("*.jpg"))]
    with MjpegServer([*there, *there[-2:0:-1]], fps=arguments.fps) as server:
        print(server.url, flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait()


if __name__ == "__main__":
    main()
