"""One image of a source."""

import math
from dataclasses import dataclass
from types import NoneType
from typing import Literal

import numpy as np

from manytouch.errors import ArgumentError, SourceError, require_type
from manytouch.limits import MAX_FRAME_INDEX
from manytouch.values.arrays import Image, plain, reduced

LEVEL_TYPES = (np.dtype(np.uint8), np.dtype(np.uint16))
"""Types of the pixels of an image."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame:
    """One image of a source, or the place of one that could not be decoded.

    Attributes:
        index: number of the frame in its source, from 0 to `MAX_FRAME_INDEX`; a gap means dropped frames.
        timestamp_ns: time of the image, monotonic, 0 at the start of the source: the middle of the exposure
            in simulation; else as the driver or the file states it, by the frame rate, or of arrival.
        camera: name of the source or camera.
        image: (h, w) or (h, w, 3) in BGR order, uint8 or uint16; None if it could not be decoded.
        encoded: the bytes as the camera delivered them, JPEG or PNG (`image_format`), or None.
        arrived_ns: `time.monotonic_ns` when the frame had arrived. None from a source that is not live; a
            live session or a playback then sets it, to when the frame is due or shown.
        is_predicted: whether a codec such as H.264 predicted its pixels from those of other pictures, so that
            they may differ less than what the camera saw. False where the source does not know; a recording
            does not keep it.
    """

    index: int
    timestamp_ns: int
    camera: str
    image: Image | None
    encoded: bytes | None = None
    arrived_ns: int | None = None
    is_predicted: bool = False

    __reduce__ = reduced

    def __post_init__(self) -> None:
        """Check the members; times are rounded, and an image of a single channel becomes grey.

        Raises:
            ArgumentError: it has another type or another number of channels, or another member has a wrong
                type.
            SourceError: the index is negative, or larger than `MAX_FRAME_INDEX`.
        """
        index, time_ns, arrived_ns = plain(self.index), _rounded(self.timestamp_ns), _rounded(self.arrived_ns)
        require_type("the number of a frame", index, int, "a whole number")
        require_type("the time of a frame", time_ns, int, "a whole number of nanoseconds")
        require_type("arrived_ns", arrived_ns, (int, NoneType), "a whole number of nanoseconds")
        require_type("the camera of a frame", self.camera, str, "the name of its camera, a text")
        require_type("encoded", self.encoded, (bytes, bytearray, NoneType), "the bytes of a JPEG or PNG")
        object.__setattr__(self, "index", index)
        object.__setattr__(self, "timestamp_ns", time_ns)
        object.__setattr__(self, "arrived_ns", arrived_ns)
        if self.encoded is not None:  # a bytearray may change later
            object.__setattr__(self, "encoded", bytes(self.encoded))
        if not 0 <= self.index <= MAX_FRAME_INDEX:
            raise SourceError(
                f"a frame has the number {self.index}: give whole numbers from 0 to {MAX_FRAME_INDEX}"
            )
        image = self.image
        if image is not None and not _is_image(image):
            kind = type(image).__name__
            if isinstance(image, np.ndarray):
                kind = f"{image.dtype} with the shape {image.shape}"
            raise ArgumentError(
                f"the image of a frame is of type {kind}: give an array of uint8 or uint16 with the shape "
                "(h, w), or (h, w, 3) in BGR order"
            )
        if image is not None and image.ndim == 3 and image.shape[2] == 1:
            object.__setattr__(self, "image", image[..., 0])

    def __repr__(self) -> str:
        if self.image is None:
            shown = "not decoded"
        else:
            shown = f"{self.image.shape[1]} x {self.image.shape[0]} px, {self.image.dtype}"
        return f"Frame({self.index} of {self.camera!r}, {self.timestamp_ns * 1e-9:.3f} s, {shown})"


def _rounded(time_ns: object) -> object:
    """A time in whole nanoseconds; what is no finite number is unchanged."""
    found = plain(time_ns)
    return round(found) if isinstance(found, float) and math.isfinite(found) else found


def _is_image(image: object) -> bool:
    """Whether something is an image that can be processed; a grey one may have an axis of one channel."""
    return (
        isinstance(image, np.ndarray)
        and image.dtype in LEVEL_TYPES
        and (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (1, 3)))
    )


def image_format(encoded: bytes) -> Literal["jpeg", "png"]:
    """The format of `Frame.encoded`: PNG by its first four bytes, else JPEG."""
    return "png" if encoded.startswith(b"\x89PNG") else "jpeg"
