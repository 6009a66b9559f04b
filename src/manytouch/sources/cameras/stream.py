"""Motion JPEG over HTTP, as network cameras and phones send it: one JPEG after the other, untouched."""

import math
import urllib.error
import urllib.request
from http.client import HTTPException, HTTPResponse

from manytouch.sources.cameras.capture import FFMPEG, JPEG_BEGIN, CameraRequest, Capture, OpenCvCapture, Shot
from manytouch.sources.quiet_opencv import cv2
from manytouch.values import Setting

SILENCE_S = 3.0
LARGEST_PICTURE = 64 * 2**20
LONGEST_HEADERS = 64 * 2**10
BLOCK = 2**16


class MultipartCapture:
    """A response of the kind multipart/x-mixed-replace.

    A time that the server sends with a picture (X-Timestamp, seconds) counts as the driver's.
    """

    def __init__(self, response: HTTPResponse, boundary: bytes) -> None:
        self._response = response
        self._boundary = b"--" + boundary.removeprefix(b"--")
        self._held = b""

    @property
    def settings(self) -> tuple[Setting, ...]:
        """A stream cannot be asked for anything."""
        return (
            Setting(name="driver", requested=None, found="HTTP"),
            Setting(name="format", requested=None, found="MJPG"),
        )

    def read(self) -> Shot | None:
        """Wait for the next picture; None when the stream has ended or keeps silent."""
        try:
            return self._next()
        except (OSError, HTTPException, ValueError):
            return None

    def release(self) -> None:
        """Close the connection."""
        self._response.close()

    def _next(self) -> Shot | None:
        self._until(self._boundary, LARGEST_PICTURE)
        headers = _headers(self._until(b"\r\n\r\n", LONGEST_HEADERS))
        length = headers.get("content-length")
        if length is None:
            body = self._until(b"\r\n" + self._boundary, LARGEST_PICTURE)
            self._held = self._boundary + self._held
        else:
            body = self._exactly(int(length))
        if not body.startswith(JPEG_BEGIN):
            return None
        return Shot(image=None, encoded=body, driver_ns=_time_ns(headers.get("x-timestamp")))

    def _until(self, mark: bytes, most: int) -> bytes:
        """What comes before a mark; both are taken."""
        searched = 0
        while (place := self._held.find(mark, searched)) < 0:
            if len(self._held) > most:
                raise ValueError("the mark does not come")
            searched = max(len(self._held) - len(mark) + 1, 0)
            self._held += self._more()
        before, self._held = self._held[:place], self._held[place + len(mark) :]
        return before

    def _exactly(self, length: int) -> bytes:
        if not 0 < length <= LARGEST_PICTURE:
            raise ValueError("no such length")
        parts, missing = [self._held[:length]], length - len(self._held)
        self._held = self._held[length:]
        while missing > 0:
            part = self._response.read1(min(missing, 16 * BLOCK))
            if not part:
                raise ConnectionError("the stream has ended")
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    def _more(self) -> bytes:
        block = self._response.read1(BLOCK)
        if not block:
            raise ConnectionError("the stream has ended")
        return block


def open_stream(url: str) -> Capture | None:
    """A stream by its address: Motion JPEG over HTTP as it comes, all else by FFmpeg; None when closed."""
    if url.startswith(("http://", "https://")):
        try:
            response = urllib.request.urlopen(url, timeout=SILENCE_S)
        except (OSError, HTTPException, ValueError):
            return None
        if response.headers.get_content_type() == "multipart/x-mixed-replace":
            boundary = str(response.headers.get_param("boundary", "--"))
            return MultipartCapture(response, boundary.encode("latin-1", errors="replace"))
        response.close()
    limit_ms = int(1e3 * SILENCE_S)
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
