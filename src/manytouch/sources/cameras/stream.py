"""Motion JPEG over HTTP, as network cameras and phones send it: one JPEG after the other, unchanged."""

import contextlib
import math
import time
import urllib.request
from http.client import HTTPException, HTTPResponse
from urllib.parse import unquote, urlsplit

from manytouch.sources.cameras.capture import (
    FFMPEG,
    JPEG_BEGIN,
    CameraRequest,
    Capture,
    CapturedImage,
    OpenCvCapture,
)
from manytouch.sources.quiet_opencv import cv2
from manytouch.values import Setting

TIMEOUT_S = 3.0
IMAGE_S = 10.0
"""Longest time for one image, however much the stream sends meanwhile: a choice, three times `TIMEOUT_S`."""
MOST_IMAGE_BYTES = 64 * 2**20
MOST_HEADER_BYTES = 64 * 2**10
BLOCK_BYTES = 2**16


class MultipartCapture:
    """Images of a response of the type multipart/x-mixed-replace.

    A time that the server sends with an image (X-Timestamp, seconds) is used as the driver's. A stream that
    takes longer than `IMAGE_S` for an image is closed.
    """

    def __init__(self, response: HTTPResponse, boundary: bytes) -> None:
        self._response = response
        self._boundary = b"--" + boundary.removeprefix(b"--")
        self._buffer = bytearray()
        self._due_s = math.inf

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Driver and format; a stream accepts no requests."""
        return (
            Setting(name="driver", requested=None, found="HTTP"),
            Setting(name="format", requested=None, found="MJPG"),
        )

    def read(self) -> CapturedImage | None:
        """Wait for the next image; None when the stream has ended or sends nothing."""
        self._due_s = time.monotonic() + IMAGE_S
        try:
            return self._next()
        except (OSError, HTTPException, ValueError):
            return None

    def release(self) -> None:
        """Close the connection."""
        self._response.close()

    def _next(self) -> CapturedImage | None:
        self._until(self._boundary, MOST_IMAGE_BYTES)
        headers = _headers(self._until(b"\r\n\r\n", MOST_HEADER_BYTES))
        length = headers.get("content-length")
        if length is None:
            body = self._until(b"\r\n" + self._boundary, MOST_IMAGE_BYTES)
            self._buffer[:0] = self._boundary
        else:
            body = self._exactly(int(length))
        if not body.startswith(JPEG_BEGIN):
            return None
        return CapturedImage(image=None, encoded=body, driver_ns=_time_ns(headers.get("x-timestamp")))

    def _until(self, mark: bytes, most: int) -> bytes:
        """Read up to a mark; return what is before it, and drop the mark."""
        searched = 0
        while (place := self._buffer.find(mark, searched)) < 0:
            if len(self._buffer) > most:
                raise ValueError("the mark is missing")
            searched = max(len(self._buffer) - len(mark) + 1, 0)
            self._buffer += self._more(BLOCK_BYTES)
        before = bytes(self._buffer[:place])
        del self._buffer[: place + len(mark)]
        return before

    def _exactly(self, length: int) -> bytes:
        if not 0 < length <= MOST_IMAGE_BYTES:
            raise ValueError("invalid length")
        parts, missing = [bytes(self._buffer[:length])], length - len(self._buffer)
        del self._buffer[:length]
        while missing > 0:
            part = self._more(min(missing, 16 * BLOCK_BYTES))
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _more(self, most: int) -> bytes:
        if time.monotonic() > self._due_s:
            self._response.close()
            raise TimeoutError("no image in time")
        block = self._response.read1(most)
        if not block:
            raise ConnectionError("the stream has ended")
        return block


def open_stream(url: str) -> Capture | None:
    """Open a stream: Motion JPEG over HTTP unchanged, all others with FFmpeg; None on failure."""
    if scheme_of(url) in ("http", "https"):
        try:
            response = open_http(url)
        except (OSError, HTTPException, ValueError):
            return None
        if response.headers.get_content_type() == "multipart/x-mixed-replace":
            boundary = str(response.headers.get_param("boundary", "--"))
            return MultipartCapture(response, boundary.encode("latin-1", errors="replace"))
        response.close()
    limit_ms = int(1e3 * TIMEOUT_S)
    limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, limit_ms, cv2.CAP_PROP_READ_TIMEOUT_MSEC, limit_ms]
    capture = cv2.VideoCapture(url, cv2.CAP_FFMPEG, limits)
    return OpenCvCapture(capture, CameraRequest(is_mjpg=False), FFMPEG) if capture.isOpened() else None


def scheme_of(url: str) -> str:
    """What is before "://", in lower case."""
    return url.partition("://")[0].lower()


def without_user(url: str) -> str:
    """The address without user and password.

    Raises:
        ValueError: it is no address.
    """
    parts = urlsplit(url)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2]).geturl()


def open_http(url: str) -> HTTPResponse:
    """The answer of a server of HTTP; user and password of the address are sent to this server alone.

    Raises:
        HTTPError: the server refuses the address.
        OSError, HTTPException, ValueError: it does not answer, or this is no address.
    """
    parts = urlsplit(url)
    user, _, host = parts.netloc.rpartition("@")
    name, _, password = user.partition(":")
    passwords = urllib.request.HTTPPasswordMgrWithDefaultRealm()
    passwords.add_password(None, f"{parts.scheme}://{host}/", unquote(name), unquote(password))
    handlers = [
        urllib.request.HTTPDigestAuthHandler(passwords),
        urllib.request.HTTPBasicAuthHandler(passwords),
    ]
    opener = urllib.request.build_opener(*handlers if user else ())
    response: HTTPResponse = opener.open(without_user(url), timeout=TIMEOUT_S)
    return response


def _headers(text: bytes) -> dict[str, str]:
    lines = (line.partition(":") for line in text.decode("latin-1").splitlines())
    return {name.strip().lower(): value.strip() for name, colon, value in lines if colon}


def _time_ns(seconds: str | None) -> int | None:
    if seconds is None:
        return None
    time_ns = 0.0
    with contextlib.suppress(ValueError):
        time_ns = 1e9 * float(seconds)
    return round(time_ns) if math.isfinite(time_ns) and time_ns > 0 else None
