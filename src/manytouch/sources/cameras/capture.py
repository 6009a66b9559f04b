"""Requests to a camera in the order that each system's driver needs, and what the driver reports.

OpenCV passes properties to the driver one by one, and a driver may reset one when another is set:

- V4L2 (Linux): the format first, since it decides which sizes and rates there are; width and height act
  together. Without conversion the driver's JPEG is passed on unchanged.
- DirectShow (Windows): setting a rate rebuilds the graph without the format, and a size resets the format; so
  rate, format, size, and the format again for releases that only then accept it.
- Media Foundation (Windows, where DirectShow does not open): it chooses the format itself.
- AVFoundation (macOS): size and rate only; exposure and focus are not offered.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from manytouch.sources.predicting_codecs import predicts_pictures
from manytouch.sources.quiet_opencv import cv2
from manytouch.values import Setting
from manytouch.values.arrays import Image, read_only

Amount = float | Literal["auto"] | None
JPEG_BEGIN, JPEG_END = b"\xff\xd8", b"\xff\xd9"
MJPG = cv2.VideoWriter.fourcc(*"MJPG")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRequest:
    """Requested settings of a camera; None leaves a setting unchanged.

    Attributes:
        size_px: width, height.
        fps: frames per second.
        is_mjpg: Motion JPEG, without which USB transfers only a few large images per second.
        exposure_ms, white_balance_K: fixed, or "auto".
        focus: in the driver's own unit, or "auto".
        gain: in the driver's own unit.
    """

    size_px: tuple[int, int] | None = None
    fps: float | None = None
    is_mjpg: bool = True
    exposure_ms: Amount = None
    gain: float | None = None
    focus: Amount = None
    white_balance_K: Amount = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CapturedImage:
    """An image from a driver; either `image` or `encoded` is set.

    Attributes:
        image: (h, w) grey or (h, w, 3) BGR, uint8 or uint16, a copy of the driver's buffer.
        encoded: a whole JPEG, a copy of the driver's buffer.
        driver_ns: the driver's time of the image, from any origin (`camera.ArrivalClock`); None where it has
            none.
        is_predicted: as of a frame.
    """

    image: Image | None
    encoded: bytes | None
    driver_ns: int | None
    is_predicted: bool = False


@runtime_checkable
class Capture(Protocol):
    """An open camera or stream.

    `camera.CameraSource` reads the first image in the thread that opens it, all others in a thread of its
    own. After `camera.FAILURES` successive reads without an image it releases the capture and opens another
    one, again and again until it is closed. All images must have the size of the first one.
    """

    @property
    def settings(self) -> tuple[Setting, ...]:
        """What was requested, and what the camera reports.

        `CameraSource.fps` is the first word of `found` of the setting `rate`, a number of frames per second.
        """

    def read(self) -> CapturedImage | None:
        """Wait for the next image; None when none came. It does not raise.

        A wait should end after some seconds: closing the source waits for it for `camera.CLOSE_S`.
        """

    def release(self) -> None:
        """Release the device; it may be opened again afterwards."""


@runtime_checkable
class VideoCapture(Protocol):
    """The part of `cv2.VideoCapture` that is used."""

    def isOpened(self) -> bool: ...

    def set(self, prop: int, value: float) -> bool: ...

    def get(self, prop: int) -> float: ...

    def grab(self) -> bool: ...

    def retrieve(self) -> tuple[bool, Any]: ...

    def release(self) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Backend:
    """How settings are requested from a system's driver.

    Attributes:
        name: for messages.
        api: OpenCV's number of it.
        order: properties in the order in which they are set; others are not offered.
        gives_jpeg: it can pass the camera's JPEG on unchanged.
        exposure_is: unit of exposure: 100 microseconds, or the logarithm to base 2 of seconds.
        manual, automatic: values of the switch for automatic exposure.
        has_timestamps: its POS_MSEC is the time of the image.
    """

    name: str
    api: int
    order: tuple[str, ...]
    gives_jpeg: bool = False
    exposure_is: Literal["100us", "log2_s"] = "log2_s"
    manual: float = 0.0
    automatic: float = 1.0
    has_timestamps: bool = False

    def driver_exposure(self, exposure_ms: float) -> float:
        """The driver's number for an exposure time."""
        return 10.0 * exposure_ms if self.exposure_is == "100us" else math.log2(1e-3 * exposure_ms)

    def exposure_ms(self, driver_exposure: float) -> float:
        """The exposure time of the driver's number."""
        return 0.1 * driver_exposure if self.exposure_is == "100us" else 1e3 * 2.0**driver_exposure


_LIGHT = (
    *("automatic exposure", "exposure", "gain"),
    *("automatic focus", "focus", "automatic white balance", "white balance"),
)
V4L2 = Backend(
    name="V4L2",
    api=cv2.CAP_V4L2,
    order=("format", "width", "height", "rate", "convert", *_LIGHT),
    gives_jpeg=True,
    exposure_is="100us",
    manual=1.0,
    automatic=3.0,
    has_timestamps=True,
)
DIRECTSHOW = Backend(
    name="DirectShow", api=cv2.CAP_DSHOW, order=("rate", "format", "width", "height", "format", *_LIGHT)
)
MEDIA_FOUNDATION = Backend(
    name="Media Foundation", api=cv2.CAP_MSMF, order=("width", "height", "rate", *_LIGHT), has_timestamps=True
)
AVFOUNDATION = Backend(name="AVFoundation", api=cv2.CAP_AVFOUNDATION, order=("width", "height", "rate"))
FFMPEG = Backend(name="FFmpeg", api=cv2.CAP_FFMPEG, order=(), has_timestamps=True)

_PROPERTY = {
    "format": cv2.CAP_PROP_FOURCC,
    "width": cv2.CAP_PROP_FRAME_WIDTH,
    "height": cv2.CAP_PROP_FRAME_HEIGHT,
    "rate": cv2.CAP_PROP_FPS,
    "convert": cv2.CAP_PROP_CONVERT_RGB,
    "automatic exposure": cv2.CAP_PROP_AUTO_EXPOSURE,
    "exposure": cv2.CAP_PROP_EXPOSURE,
    "gain": cv2.CAP_PROP_GAIN,
    "automatic focus": cv2.CAP_PROP_AUTOFOCUS,
    "focus": cv2.CAP_PROP_FOCUS,
    "automatic white balance": cv2.CAP_PROP_AUTO_WB,
    "white balance": cv2.CAP_PROP_WB_TEMPERATURE,
}
_AMOUNTS: dict[str, Callable[[CameraRequest], Amount]] = {
    "exposure": lambda request: request.exposure_ms,
    "focus": lambda request: request.focus,
    "white balance": lambda request: request.white_balance_K,
}


def backends(platform: str = sys.platform) -> tuple[Backend, ...]:
    """The backends of a system; the first that opens a camera is used."""
    if platform == "darwin":
        return (AVFOUNDATION,)
    return (DIRECTSHOW, MEDIA_FOUNDATION) if platform == "win32" else (V4L2,)


def driver_values(request: CameraRequest, backend: Backend) -> dict[str, float]:
    """Values to set, by property, in the driver's units."""
    wanted: dict[str, float] = {}
    if request.is_mjpg:
        wanted["format"] = float(MJPG)
        if backend.gives_jpeg:
            wanted["convert"] = 0.0
    if request.size_px is not None:
        wanted["width"], wanted["height"] = map(float, request.size_px)
    if request.fps is not None:
        wanted["rate"] = request.fps
    if request.gain is not None:
        wanted["gain"] = request.gain
    for name, amount_of in _AMOUNTS.items():
        amount = amount_of(request)
        if amount is None:
            continue
        manual, automatic = (backend.manual, backend.automatic) if name == "exposure" else (0.0, 1.0)
        wanted[f"automatic {name}"] = automatic if amount == "auto" else manual
        if amount != "auto":
            wanted[name] = backend.driver_exposure(amount) if name == "exposure" else amount
    return {name: value for name, value in wanted.items() if name in backend.order}


class OpenCvCapture:
    """A camera or stream that OpenCV has opened, with the requested settings."""

    def __init__(self, capture: VideoCapture, request: CameraRequest, backend: Backend) -> None:
        self._capture = capture
        self._request = request
        self._backend = backend
        wanted = driver_values(request, backend)
        for name in backend.order:
            if name in wanted:
                capture.set(_PROPERTY[name], wanted[name])
        self._gives_jpeg = "convert" in wanted
        self._is_predicted = predicts_pictures(float(capture.get(cv2.CAP_PROP_FOURCC)))

    @property
    def settings(self) -> tuple[Setting, ...]:
        """What was requested, and what the camera reports."""
        request, rate = self._request, self._found("rate")
        requested_size = (
            None if request.size_px is None else f"{request.size_px[0]} x {request.size_px[1]} px"
        )
        width, height = self._found("width"), self._found("height")
        found_size = None if width is None or height is None else f"{width:g} x {height:g} px"
        code = self._found("format")
        driver_exposure = self._found("exposure")
        return (
            Setting(name="driver", requested=None, found=self._backend.name),
            Setting(name="size", requested=requested_size, found=found_size),
            Setting(
                name="rate", requested=_words(request.fps, "per second"), found=_words(rate, "per second")
            ),
            Setting(
                name="format",
                requested="MJPG" if request.is_mjpg else None,
                found=None if code is None else _letters(int(code)),
            ),
            Setting(
                name="exposure",
                requested=_words(request.exposure_ms, "ms"),
                found=None
                if driver_exposure is None
                else _words(self._backend.exposure_ms(driver_exposure), "ms"),
            ),
            Setting(name="gain", requested=_words(request.gain), found=_words(self._found("gain"))),
            Setting(name="focus", requested=_words(request.focus), found=_words(self._found("focus"))),
            Setting(
                name="white balance",
                requested=_words(request.white_balance_K, "K"),
                found=_words(self._found("white balance"), "K"),
            ),
        )

    def read(self) -> CapturedImage | None:
        """Wait for the next image; None when none came."""
        if not self._capture.grab():
            return None
        driver_ns = self._time_ns()
        decoded, image = self._capture.retrieve()
        if not decoded or image is None or image.size == 0:
            return None
        if not self._gives_jpeg:
            return CapturedImage(
                image=read_only(image.copy()),
                encoded=None,
                driver_ns=driver_ns,
                is_predicted=self._is_predicted,
            )
        encoded = whole_jpeg(image)
        if encoded is None:  # the camera gives no JPEG: let the driver convert
            self._gives_jpeg = False
            self._capture.set(_PROPERTY["convert"], 1.0)
            return None
        return CapturedImage(image=None, encoded=encoded, driver_ns=driver_ns)

    def release(self) -> None:
        """Release the device."""
        self._capture.release()

    def _found(self, name: str) -> float | None:
        """A property as the camera reports it; None where it does not."""
        if name not in self._backend.order and name not in ("width", "height", "rate", "format"):
            return None
        value = float(self._capture.get(_PROPERTY[name]))
        unknown = value == -1.0 and not (name == "exposure" and self._backend.exposure_is == "log2_s")
        is_empty = value <= 0 and name in ("width", "height", "rate", "format", "white balance")
        return None if not math.isfinite(value) or unknown or is_empty else value

    def _time_ns(self) -> int | None:
        milliseconds = self._capture.get(cv2.CAP_PROP_POS_MSEC) if self._backend.has_timestamps else 0.0
        return round(milliseconds * 1e6) if math.isfinite(milliseconds) and milliseconds > 0 else None


def whole_jpeg(buffer: np.ndarray) -> bytes | None:
    """The JPEG at the beginning of a driver's buffer, without what follows it; None when there is none."""
    if buffer.dtype != np.uint8 or (buffer.ndim > 1 and min(buffer.shape[:2]) != 1):
        return None
    encoded = buffer.tobytes()
    end = encoded.rfind(JPEG_END)
    return encoded[: end + 2] if encoded.startswith(JPEG_BEGIN) and end > 0 else None


def open_camera(
    number_or_path: int | str,
    request: CameraRequest,
    open_with: Callable[[int | str, int], VideoCapture] | None = None,
    platform: str = sys.platform,
) -> OpenCvCapture | None:
    """Open a camera with the first of the system's backends that can; None when none can."""
    for backend in backends(platform):
        capture = (open_with or cv2.VideoCapture)(number_or_path, backend.api)
        if capture.isOpened():
            return OpenCvCapture(capture, request, backend)
        capture.release()
    return None


def _words(amount: float | str | None, unit: str = "") -> str | None:
    if amount is None or isinstance(amount, str):
        return amount
    return f"{amount:.4g} {unit}".rstrip()


def _letters(code: int) -> str:
    letters = bytes((code >> shift) & 0xFF for shift in (0, 8, 16, 24))
    return (
        letters.decode("ascii", errors="replace")
        if all(32 <= letter < 127 for letter in letters)
        else hex(code)
    )
