"""Access control: browsers on this machine; programs, and browsers from elsewhere, with the token."""

import hmac
import ipaddress
import os
import secrets
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from platformdirs import user_cache_path, user_runtime_path

COOKIE = "manytouch-token"
BEARER = "Bearer "


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Who may use one viewer.

    Pages of other sites may not: their requests carry a foreign origin or host name. Programs, whose requests
    carry no origin, need the token.

    Attributes:
        host: address on which the viewer listens.
        port: its port.
        token: of this viewer.
        is_token_required: also of its own pages, because it was chosen, or other machines can reach them.
    """

    host: str
    port: int
    token: str
    is_token_required: bool

    @property
    def url(self) -> str:
        """The address to open in a browser, including the token if pages need it."""
        end = f"?token={self.token}" if self.is_token_required else ""
        return f"http://{self._name}:{self.port}/{end}"

    @property
    def stream_url(self) -> str:
        """The address of the websocket."""
        return f"ws://{self._name}:{self.port}/stream"

    @property
    def _name(self) -> str:
        name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(self.host, self.host)
        return f"[{name}]" if ":" in name and not name.startswith("[") else name

    def is_known_host(self, headers: Mapping[str, str]) -> bool:
        """Whether the request was sent to a name of this viewer, and not to a foreign name that points here.

        Raises:
            ValueError: the Host header is not valid.
        """
        name = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        return self.is_token_required or name == self.host or is_loopback(name)

    def may_open_page(self, cookies: Mapping[str, str]) -> bool:
        """Whether a request for the page has the token, or needs none."""
        return not self.is_token_required or self.is_token(cookies.get(COOKIE))

    def may_stream(self, headers: Mapping[str, str], cookies: Mapping[str, str]) -> bool:
        """Whether a websocket is opened by a page of this viewer, or by a program that has the token.

        Raises:
            ValueError: the Host header is not valid.
        """
        origin, sent = headers.get("origin"), headers.get("authorization", "")
        has_token = self.is_token(cookies.get(COOKIE)) or self.is_token(sent.removeprefix(BEARER))
        if not self.is_known_host(headers) or origin not in (None, f"http://{headers.get('host', '')}"):
            return False
        return has_token or (origin is not None and not self.is_token_required)

    def is_token(self, given: str | None) -> bool:
        """Whether this is the token."""
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


def access_to(host: str, port: int, token: str | None) -> Access:
    """The access to a viewer.

    Args:
        host, port: where it listens.
        token: that pages must send too; None generates one, which they need if other machines can reach them.
    """
    is_required = token is not None or not is_loopback(host)
    return Access(
        host=host, port=port, token=token or secrets.token_urlsafe(18), is_token_required=is_required
    )


def write_token(access: Access) -> Path | None:
    """Write the token to a file that only this user can read.

    Returns:
        The file, in the user's runtime folder, or in the one for caches; None if neither can be used.
    """
    with warnings.catch_warnings(action="ignore"):  # without a runtime folder another one is used
        folders = (user_runtime_path("manytouch"), user_cache_path("manytouch"))
    for parent in folders:
        path = parent / f"viewer-{access.port}.token"
        with suppress(OSError):
            parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not (_is_own(parent) and _is_own(parent.parent)):
                continue
            path.unlink(missing_ok=True)
            number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(number, "w", encoding="ascii") as file:
                file.write(access.token)
            return path
    return None


def _is_own(folder: Path) -> bool:
    """Whether nobody else can write into a folder."""
    if os.name == "nt":
        return True
    found = folder.stat(follow_symlinks=False)
    return found.st_uid == os.getuid() and not found.st_mode & 0o022
