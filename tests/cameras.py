"""Cameras that are not there: pictures, and drivers that behave as those of each system."""

from collections.abc import Callable

import cv2
import numpy as np

MJPG = cv2.VideoWriter.fourcc(*"MJPG")
YUYV = cv2.VideoWriter.fourcc(*"YUYV")


def numbered(number: int, width: int = 320, height: int = 240) -> np.ndarray:
    """A grey image that encodes its number, modulo 200, as the level of its left half."""
    image = np.full((height, width), 230, np.uint8)
    image[:, : width // 2] = 20 + number % 200
    return image


def number_of(image: np.ndarray) -> int:
    """The number that an image encodes."""
    return round(float(image[:, : image.shape[1] // 2 - 16].mean())) - 20


def jpeg(image: np.ndarray, quality: int = 95) -> bytes:
    return bytes(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1])


class Driver:
    """A camera with its driver, as `cv2.VideoCapture` shows them.

    It returns the same buffer each time, as OpenCV may, and resets what the driver of its system resets.
    """

    def __init__(
        self,
        api: int,
        *,
        has_jpeg: bool = True,
        period_ms: float = 40.0,
        gone: Callable[[], bool] | None = None,
    ) -> None:
        self.api = api
        self.has_jpeg = has_jpeg
        self.calls: list[tuple[int, float]] = []
        self.values: dict[int, float] = {
            cv2.CAP_PROP_FRAME_WIDTH: 640.0,
            cv2.CAP_PROP_FRAME_HEIGHT: 480.0,
            cv2.CAP_PROP_FPS: 30.0,
            cv2.CAP_PROP_FOURCC: YUYV,
            cv2.CAP_PROP_CONVERT_RGB: 1.0,
        }
        self.pending: dict[int, float] = {}
        self.number = -1
        self.is_released = False
        self._period_ms = period_ms
        self._gone = gone
        self._buffer = np.zeros(2**20, np.uint8)

    def isOpened(self) -> bool:
        return self._gone is None or not self._gone()

    def set(self, prop: int, value: float) -> bool:
        self.calls.append((prop, value))
        known = {
            cv2.CAP_V4L2: self._set_v4l2,
            cv2.CAP_DSHOW: self._set_directshow,
            cv2.CAP_AVFOUNDATION: self._set_size_and_rate,
            cv2.CAP_MSMF: self._set_media_foundation,
        }
        return known[self.api](prop, value)

    def get(self, prop: int) -> float:
        if prop == cv2.CAP_PROP_POS_MSEC:
            return 5_000_000.0 + self.number * self._period_ms if self.api == cv2.CAP_V4L2 else 0.0
        return self.values.get(prop, -1.0)

    def grab(self) -> bool:
        if self.is_released or not self.isOpened():
            return False
        self.number += 1
        return True

    def retrieve(self) -> tuple[bool, np.ndarray]:
        size = (int(self.values[cv2.CAP_PROP_FRAME_WIDTH]), int(self.values[cv2.CAP_PROP_FRAME_HEIGHT]))
        image = numbered(self.number, *size)
        if self.values[cv2.CAP_PROP_CONVERT_RGB]:
            colour = self._buffer[: image.size * 3].reshape(*image.shape, 3)
            colour[:] = image[..., None]
            return True, colour
        if self.values[cv2.CAP_PROP_FOURCC] == MJPG:
            encoded = np.frombuffer(jpeg(image), np.uint8)
            self._buffer[: len(encoded)] = encoded
            self._buffer[len(encoded) : len(encoded) + 100] = 0  # what an earlier, longer one left
            return True, self._buffer[None, : len(encoded) + 100]
        return True, self._buffer[: image.size * 2].reshape(*image.shape, 2)

    def release(self) -> None:
        self.is_released = True

    def _set_v4l2(self, prop: int, value: float) -> bool:
        """Width and height act together; the format decides on the sizes: without MJPG nothing large."""
        if prop == cv2.CAP_PROP_FOURCC:
            if value == MJPG and not self.has_jpeg:
                return False
            self.values[prop] = value
        elif prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT):
            self.pending[prop] = value
            if len(self.pending) == 2:
                fits = (
                    self.values[cv2.CAP_PROP_FOURCC] == MJPG or self.pending[cv2.CAP_PROP_FRAME_WIDTH] <= 640
                )
                self.values |= self.pending if fits else {}
                self.pending = {}
        else:
            self.values[prop] = value
        return True

    def _set_directshow(self, prop: int, value: float) -> bool:
        """A rate rebuilds the graph in the driver's own format; a size applies the pending format."""
        if prop == cv2.CAP_PROP_FPS:
            self.values |= {prop: value, cv2.CAP_PROP_FOURCC: YUYV}
        elif prop in (cv2.CAP_PROP_FOURCC, cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT):
            self.pending[prop] = value
            if {cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT} <= set(self.pending):
                self.values |= {cv2.CAP_PROP_FOURCC: YUYV, **self.pending}
                self.pending = {}
        elif prop == cv2.CAP_PROP_CONVERT_RGB:
            return False
        else:
            self.values[prop] = float(int(value))
        return True

    def _set_media_foundation(self, prop: int, value: float) -> bool:
        if prop in (cv2.CAP_PROP_FOURCC, cv2.CAP_PROP_CONVERT_RGB):
            raise AssertionError("Media Foundation takes these for the pictures it shall make")
        self.values[prop] = value
        return True

    def _set_size_and_rate(self, prop: int, value: float) -> bool:
        if prop not in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FPS):
            return False
        self.values[prop] = value
        return True
