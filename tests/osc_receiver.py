"""A receiver of OSC: a server of python-osc."""

import threading

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer


class Receiver:
    """A server of python-osc that keeps all messages."""

    def __init__(self, port: int = 0) -> None:
        self.messages: list[tuple[str, tuple]] = []
        dispatcher = Dispatcher()
        dispatcher.set_default_handler(lambda path, *args: self.messages.append((path, args)))
        self.server = BlockingOSCUDPServer(("127.0.0.1", port), dispatcher)
        self.port = self.server.server_address[1]
        self._thread = threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    def of(self, path: str) -> list[tuple]:
        return [args for found, args in self.messages if found == path]

    def close(self) -> None:
        self.server.shutdown()
        self._thread.join()
        self.server.server_close()
