"""Access control: browsers on this machine, and from elsewhere those with the token."""

import hmac
import ipaddress
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

COOKIE = "manytouch-token"


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Who may use one viewer.

    Pages of other sites may not: their requests carry a foreign origin or host name.

    Attributes:
        host: address on which the viewer listens.
        port: its port.
        token: what a client must send; None if none is required, as on a loopback address.
    """

    host: str
    port: int
    token: str | None

    @property
    def url(self) -> str:
        """The address to open in a browser, including the token if there is one."""
        name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(self.host, self.host)
        name = f"[{name}]" if ":" in name and not name.startswith("[") else name
        end = "" if self.token is None else f"?token={self.token}"
        return f"http://{name}:{self.port}/{end}"

    def is_known_host(self, headers: Mapping[str, str]) -> bool:
        """Whether the request was sent to a name of this viewer, and not to a foreign name that points here.

        Raises:
            ValueError: the Host header is not valid.
        """
        name = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        return self.token is not None or name == self.host or is_loopback(name)

    def is_own_origin(self, headers: Mapping[str, str]) -> bool:
        """Whether the request comes from a page of this viewer, or from no page."""
        origin = headers.get("origin")
        return origin is None or origin == f"http://{headers.get('host', '')}"

    def has_token(self, given: str | None) -> bool:
        """Whether this is the token, or none is required."""
        if self.token is None:
            return True
        if given is None:
            return False
        return hmac.compare_digest(given.encode(errors="surrogatepass"), self.token.encode())


def is_loopback(host: str) -> bool:
    """Whether this name or address is a loopback address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def required_token(host: str, token: str | None) -> str | None:
    """The token to require: the given one, or a new one if other machines can reach the address."""
    return token if token is not None or is_loopback(host) else secrets.token_urlsafe(18)
