"""OSC bundles over UDP."""

import socket
import struct
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from manytouch.errors import MissingExtraError, OutputError
from manytouch.sinks.publishers.address import OutputAddress
from manytouch.values import Reading

Message = tuple[str, Sequence[tuple[str, object]]]
"""Address and arguments, each with its type tag of OSC 1.0 ("i", "f", "s", "d", "t")."""


BundleEncoder = Callable[[Reading], Sequence[Sequence[Message]]]
"""Converts readings, in order, to bundles of messages."""


class OscPublisher:
    """Sends each reading as OSC bundles in UDP datagrams.

    A datagram has no receiver that could fail: a client that is not running, or is started again, only
    misses what is sent meanwhile.
    """

    def __init__(
        self, address: OutputAddress, encode: BundleEncoder, default_port: int | None = None
    ) -> None:
        """Open a socket.

        Args:
            address: with the host and port of the receiver; no host: this computer.
            encode: makes the messages.
            default_port: None: the address must have a port.

        Raises:
            OutputError: the host is not known.
            ManytouchError: there is no port.
            MissingExtraError: python-osc is not installed.
        """
        _require_osc()
        is_default = address.port is None and default_port is not None
        port = default_port if is_default else address.required_port()
        host = address.host or "127.0.0.1"
        self.description = f"sends bundles of OSC to UDP port {port} of {host}"
        try:
            family, kind, _, _, receiver = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        except (OSError, UnicodeError) as error:
            raise OutputError(f"{address.text!r}: the host {host!r} is not known ({error})") from error
        self._receiver = receiver
        self._encode = encode

    def publish(self, reading: Reading) -> None:
        """Send a reading."""
        for bundle in self._encode(reading):
            self._socket.sendto(encode_bundle(bundle), self._receiver)

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()


def encode_bundle(messages: Sequence[Message]) -> bytes:
    """An OSC 1.0 bundle that is to be carried out at once.

    The builder of python-osc has no time tags as arguments, which TUIO 2.0 requires.
    """
    from pythonosc.parsing import osc_types

    write: dict[str, Callable[[Any], bytes]] = {
        "i": struct.Struct(">i").pack,
        "f": struct.Struct(">f").pack,
        "d": struct.Struct(">d").pack,
        "s": _string,
        "t": osc_types.write_date,
    }
    parts = [b"#bundle\x00", osc_types.write_date(osc_types.IMMEDIATELY)]
    for address, arguments in messages:
        tags = "".join([tag for tag, _ in arguments])
        values = b"".join([write[tag](value) for tag, value in arguments])
        content = _string(address) + _string(f",{tags}") + values
        parts += [struct.pack(">i", len(content)), content]
    return b"".join(parts)


@lru_cache(maxsize=256)
def _string(text: str) -> bytes:
    from pythonosc.parsing import osc_types

    return bytes(osc_types.write_string(text))


def _require_osc() -> None:
    try:
        import pythonosc  # noqa: F401
    except ImportError:
        raise MissingExtraError("TUIO and OSC", "python-osc", "connect") from None
