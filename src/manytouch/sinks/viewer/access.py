"""Who may look: the machine itself, and from elsewhere whoever holds the token."""

import hmac
import ipaddress
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

COOKIE = "manytouch-token"


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """The door of one viewer.

    A page of another site cannot use it: its requests carry an origin, or a host name, that is not ours.

    Attributes:
        host: address that is listened on.
        port: and its port.
        token: what a visitor must show; None on a loopback address without one.
    """

    host: str
    port: int
    token: str | None

    @property
    def url(self) -> str:
        """What to open in a browser; with the token where there is one."""
        name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(self.host, self.host)
        name = f"[{name}]" if ":" in name and not name.startswith("[") else name
        end = "" if self.token is None else f"?token={self.token}"
        return f"http://{name}:{self.port}/{end}"

    def is_known_host(self, headers: Mapping[str, str]) -> bool:
        """Was the request sent to a name that we answer to? (Against names of others that point here.)"""
        if self.token is not None:
            return True
        name = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        return name == self.host or is_loopback(name)

    def is_own_origin(self, headers: Mapping[str, str]) -> bool:
        """Does the request come from a page of ours, or from no page at all?"""
        origin = headers.get("origin")
        return origin is None or origin == f"http://{headers.get('host', '')}"

    def has_token(self, given: str | None) -> bool:
        """Is this the token, or is none needed?"""
        if self.token is None:
            return True
        return given is not None and hmac.compare_digest(given.encode(), self.token.encode())


def is_loopback(host: str) -> bool:
    """Does this name or address mean the machine itself?"""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def token_for(host: str, token: str | None) -> str | None:
    """The token to ask for: the given one, or a new one where others could reach us without."""
    return token if token is not None or is_loopback(host) else secrets.token_urlsafe(18)
