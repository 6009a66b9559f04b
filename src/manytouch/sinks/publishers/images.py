"""Encoded images of frames, for other programs."""

import threading
from functools import lru_cache

import numpy as np

from manytouch.sinks.publishers.address import OutputAddress
from manytouch.values import Frame

JPEG_QUALITY = 90
IMAGES_PER_S = 10.0
"""Images that are encoded per second; one of 1280 x 720 px takes longer than all else of a reading."""
_ENCODING = threading.Lock()


class ImageTurns:
    """Which frames' images are sent: all that the camera encoded, of others at most some per second.

    Outputs with the same rate choose the same frames, whose images are encoded once for all of them.
    """

    def __init__(self, address: OutputAddress) -> None:
        """Take the rate from the option `images` of an address.

        Raises:
            ManytouchError: it is not a rate.
        """
        self._per_s = address.number("images", IMAGES_PER_S, (0.1, 1000.0))
        self._slot: int | None = None

    def take(self, frame: Frame) -> bool:
        """Whether the image of a frame is sent, if it is read."""
        if frame.encoded is not None or frame.image is None:
            return frame.encoded is not None
        slot = int(frame.timestamp_ns * 1e-9 * self._per_s)
        is_due = slot != self._slot
        self._slot = slot
        return is_due


def encoded_image(frame: Frame) -> tuple[bytes, str]:
    """The image of a frame as the camera sent it, else as JPEG, and the format: "jpeg" or "png".

    Several outputs that send the same frame encode it once.
    """
    if frame.encoded is not None:
        return frame.encoded, "png" if frame.encoded.startswith(b"\x89PNG") else "jpeg"
    if frame.image is None:
        return b"", "jpeg"
    with _ENCODING:
        return _as_jpeg(frame), "jpeg"


@lru_cache(maxsize=2)
def _as_jpeg(frame: Frame) -> bytes:
    import cv2

    image = frame.image
    assert image is not None
    if image.dtype != np.uint8:
        image = (image >> 8).astype(np.uint8)
    _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()
