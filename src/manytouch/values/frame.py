"""One image of a source."""

from dataclasses import dataclass
from typing import Literal

from manytouch.values.arrays import Image


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame:
    """One image of a source, or the place of one that could not be decoded.

    Attributes:
        index: number of the frame in its source, from 0; a gap means dropped frames.
        timestamp_ns: time of the image, monotonic, 0 at the start of the source: the middle of the exposure
            in simulation; else as the driver or the file states it, by the frame rate, or of arrival.
        camera: name of the source or camera.
        image: (h, w) or (h, w, 3) in BGR order, uint8 or uint16; None if it could not be decoded.
        encoded: the bytes as the camera delivered them, JPEG or PNG (`image_format`), or None.
        arrived_ns: `time.monotonic_ns` when the frame had arrived. None from a source that is not live; a
            live session or a playback then sets it, to when the frame is due or shown.
    """

    index: int
    timestamp_ns: int
    camera: str
    image: Image | None
    encoded: bytes | None = None
    arrived_ns: int | None = None

    def __repr__(self) -> str:
        if self.image is None:
            shown = "not decoded"
        else:
            shown = f"{self.image.shape[1]} x {self.image.shape[0]} px, {self.image.dtype}"
        return f"Frame({self.index} of {self.camera!r}, {self.timestamp_ns * 1e-9:.3f} s, {shown})"


def image_format(encoded: bytes) -> Literal["jpeg", "png"]:
    """The format of `Frame.encoded`: PNG by its first four bytes, else JPEG."""
    return "png" if encoded.startswith(b"\x89PNG") else "jpeg"
