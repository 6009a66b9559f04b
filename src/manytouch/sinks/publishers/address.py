"""Addresses of outputs, such as `tuio://127.0.0.1:3333?version=2`."""

from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl, unquote, urlsplit

from manytouch.errors import ManytouchError, without_password


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputAddress:
    """Parts of the URL of an output.

    Attributes:
        text: the URL as given, without user and password, which messages do not show.
        scheme: before "://", in lower case.
        host: without brackets; empty if there is none.
        port: None if there is none.
        path: behind host and port, decoded, without the leading "/".
        options: behind "?".
    """

    text: str
    scheme: str
    host: str
    port: int | None
    path: str
    options: Mapping[str, str]

    def refuse_options_except(self, *known: str) -> None:
        """Raises ManytouchError if there are other options than these."""
        for name in self.options:
            if name not in known:
                listed = f"known are {', '.join(known)}" if known else "it has none"
                raise ManytouchError(f"{self.text!r}: there is no option {name!r}: {listed}")

    def required_port(self) -> int:
        """The port.

        Raises:
            ManytouchError: there is none.
        """
        if not self.port:
            host = f"[{self.host}]" if ":" in self.host else self.host
            raise ManytouchError(f"{self.text!r} has no port: add one, such as {self.scheme}://{host}:9000")
        return self.port

    def number(self, name: str, default: float, limits: tuple[float, float]) -> float:
        """An option that is a number.

        Raises:
            ManytouchError: it is not a number within the limits.
        """
        text = self.options.get(name)
        try:
            value = default if text is None else float(text)
        except ValueError:
            value = float("nan")
        if not limits[0] <= value <= limits[1]:
            raise ManytouchError(
                f"{self.text!r}: {name} is {text!r}; give a number from {limits[0]:g} to {limits[1]:g}"
            )
        return value

    def choice(self, name: str, choices: tuple[str, ...]) -> str:
        """An option that is one of some words; the first is the default.

        Raises:
            ManytouchError: it is another word.
        """
        word = self.options.get(name, choices[0])
        if word not in choices:
            raise ManytouchError(f"{self.text!r}: {name} is {word!r}; choose {' or '.join(choices)}")
        return word


def parse_address(text: str) -> OutputAddress:
    """The parts of a URL.

    Raises:
        ManytouchError: it is not a URL.
    """
    shown = without_password(text)
    try:
        parts = urlsplit(text)
    except ValueError:
        raise ManytouchError(f"{shown!r}: an IPv6 address has brackets, such as osc://[::1]:9000") from None
    try:
        port = parts.port
    except ValueError:
        raise ManytouchError(f"{shown!r}: the port is not a number from 0 to 65535") from None
    if "://" not in text:
        raise ManytouchError(f"{shown!r} is not the address of an output, such as osc://127.0.0.1:9000")
    host = unquote(parts.netloc).rpartition("@")[2]
    if port is not None:
        host = host.rpartition(":")[0]
    return OutputAddress(
        text=shown,
        scheme=parts.scheme.lower(),
        host=host.removesuffix(":").strip("[]"),
        port=port,
        path=unquote(parts.path).removeprefix("/"),
        options=dict(parse_qsl(parts.query, keep_blank_values=True)),
    )
