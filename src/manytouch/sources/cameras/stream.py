"""Motion JPEG over HTTP, as network cameras and phones send it: one JPEG after the other, unchanged."""

import math
import urllib.error
import urllib.request
from http.client import HTTPException, HTTPResponse

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
MOST_IMAGE_BYTES = 64 * 2**20
MOST_HEADER_BYTES = 64 * 2**10
BLOCK_BYTES = 2**16


class MultipartCapture:
    """Images of a response of the type multipart/x-mixed-replace.

    A time that the server sends with an image (X-Timestamp, seconds) is used as the driver's.
    """

    def __init__(self, response: HTTPResponse, boundary: bytes) -> None:
        self._response = response
        self._boundary = b"--" + boundary.removeprefix(b"--")
        self._buffer = b""

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Driver and format; a stream accepts no requests."""
        return (
            Setting(name="driver", requested=None, found="HTTP"),
            Setting(name="format", requested=None, found="MJPG"),
        )

    def read(self) -> CapturedImage | None:
        """Wait for the next image; None when the stream has ended or sends nothing."""
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
            self._buffer = self._boundary + self._buffer
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
            self._buffer += self._more()
        before, self._buffer = self._buffer[:place], self._buffer[place + len(mark) :]
        return before

    def _exactly(self, length: int) -> bytes:
        if not 0 < length <= MOST_IMAGE_BYTES:
            raise ValueError("invalid length")
        parts, missing = [self._buffer[:length]], length - len(self._buffer)
        self._buffer = self._buffer[length:]
        while missing > 0:
            part = self._response.read1(min(missing, 16 * BLOCK_BYTES))
            if not part:
                raise ConnectionError("the stream has ended")
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _more(self) -> bytes:
        block = self._response.read1(BLOCK_BYTES)
        if not block:
            raise ConnectionError("the stream has ended")
        return block


def open_stream(url: str) -> Capture | None:
    """Open a stream: Motion JPEG over HTTP unchanged, all others with FFmpeg; None on failure."""
    if url.startswith(("http://", "https://")):
        try:
            response = urllib.request.urlopen(url, timeout=TIMEOUT_S)
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


def _headers(text: bytes) -> dict[str, str]:
    lines = (line.partition(":") for line in text.decode("latin-1").splitlines())
    return {name.strip().lower(): value.strip() for name, colon, value in lines if colon}


def _time_ns(seconds: str | None) -> int | None:
    if seconds is None:
        return None
    value = float(seconds)
    return round(value * 1e9) if math.isfinite(value) and value > 0 else None


def refusal_of(url: str) -> str:
    """With what a server refuses an address, such as "HTTP status 404 Not Found"; empty if not known."""
    if not url.startswith(("http://", "https://")):
        return ""
    try:
        urllib.request.urlopen(url, timeout=TIMEOUT_S).close()
    except urllib.error.HTTPError as error:
        error.close()
        return f"HTTP status {error.code} {error.reason}".strip()
    except (OSError, HTTPException, ValueError):
        return ""
    return ""
