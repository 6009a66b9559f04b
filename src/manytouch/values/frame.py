"""One picture as a source gives it."""

from dataclasses import dataclass

from manytouch.values.arrays import Image


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame:
    """One picture, or the note that there should have been one.

    Attributes:
        index: number of the frame in its source, from 0; gaps are frames that were dropped.
        timestamp_ns: middle of the exposure, monotonic, 0 at the source's start.
        camera: name of the source or camera.
        image: (h, w) or (h, w, 3) in BGR order, uint8 or uint16; None when it could not be decoded.
        encoded: the bytes as the camera gave them, or None.
        arrived_ns: this machine's `time.monotonic_ns` when all of it had arrived; None where nothing arrives.
    """

    index: int
    timestamp_ns: int
    camera: str
    image: Image | None
    encoded: bytes | None = None
    arrived_ns: int | None = None
