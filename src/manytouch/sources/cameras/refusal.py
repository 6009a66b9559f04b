"""Why a stream does not open, as its server states it, or as the network does."""

import re
import socket
import urllib.error
from http import HTTPStatus
from http.client import HTTPException
from urllib.parse import urlsplit

from manytouch.sources.cameras.stream import TIMEOUT_S, open_http, scheme_of, without_user

_PORTS = {"http": 80, "https": 443, "rtsp": 554, "rtmp": 1935}
_PAGE = re.compile(r"(text/|application/json$)[a-z0-9.+-]*")
_RTSP_STATUS = re.compile(rb"RTSP/1\.\d (\d{3})")
_ANSWER_BYTES = 4096


def refusal_of(url: str) -> str:
    """With what a server refuses an address, such as "HTTP status 404 Not Found"; empty if not known.

    Words of the server are not repeated, since they may be of any length and contain any character.
    """
    if scheme_of(url) == "rtsp":
        return _refusal_by_rtsp(url)
    if scheme_of(url) not in ("http", "https"):
        return ""
    try:
        with open_http(url) as response:
            stated = response.headers.get("Content-Type") is not None
            content_type = response.headers.get_content_type() if stated else ""
    except urllib.error.HTTPError as error:
        error.close()
        return f"HTTP status {_words(error.code)}"
    except (OSError, HTTPException, ValueError):
        return ""
    return f"the answer is of the type {content_type}" if _PAGE.fullmatch(content_type) else ""


def unreachable(url: str) -> str:
    """Why no server answers at an address; empty if one does, or if it is not known."""
    default_port = _PORTS.get(scheme_of(url))
    if default_port is None:
        return ""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname or "", parts.port or default_port
    except ValueError:
        host = ""
    if not host:
        return (
            "it is not SCHEME://USER:PASSWORD@HOST:PORT/PATH, where / ? # @ in user and password are written "
            "as %2F %3F %23 %40"
        )
    try:
        socket.create_connection((host, port), timeout=TIMEOUT_S).close()
    except (socket.gaierror, UnicodeError):
        return f"the host {host} is not known"
    except OSError as error:
        return f"no server answers at port {port} of {host}: {error.strerror or error}"
    return ""


def _refusal_by_rtsp(url: str) -> str:
    """The status with which a server of RTSP answers a request without user and password."""
    try:
        parts = urlsplit(url)
        request = f"DESCRIBE {without_user(url)} RTSP/1.0\r\nCSeq: 1\r\nAccept: application/sdp\r\n\r\n"
        place = (parts.hostname or "", parts.port or _PORTS["rtsp"])
        with socket.create_connection(place, timeout=TIMEOUT_S) as connection:
            connection.sendall(request.encode())
            status = _RTSP_STATUS.match(connection.recv(_ANSWER_BYTES))
    except (OSError, ValueError):
        return ""
    if status is None or status[1].startswith(b"2"):
        return ""
    code = int(status[1])
    if code == HTTPStatus.UNAUTHORIZED and parts.username is not None:
        return "the server requires user and password: these or the path may be wrong"
    return f"RTSP status {_words(code)}"


def _words(code: int) -> str:
    """A status with its standard phrase, if it has one."""
    try:
        return f"{code} {HTTPStatus(code).phrase}"
    except ValueError:
        return f"{code}"
