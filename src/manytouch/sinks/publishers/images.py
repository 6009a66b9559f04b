"""Encoded images of frames, for other programs."""

import threading
from functools import lru_cache

from manytouch.sinks.publishers.address import OutputAddress
from manytouch.values import Frame
from manytouch.values.frame import image_format
from manytouch.values.images.grey_levels import least_scale, to_8_bits

JPEG_QUALITY = 90
IMAGES_PER_S = 10.0
"""Images that are encoded per second; one of 1280 x 720 px takes longer than all else of a reading."""
_ENCODING = threading.Lock()


class ImageTurns:
    """Which images an output sends: all that the camera encoded, of others at most some per second.

    Outputs with the same rate choose the same frames, whose images are encoded once for all of them.
    """

    def __init__(self, address: OutputAddress) -> None:
        """Take the rate from the option `images` of an address.

        Raises:
            ManytouchError: it is not a rate.
        """
        self._per_s = address.number("images", IMAGES_PER_S, (0.1, 1000.0))
        self._slot: int | None = None
        self._scale: float | None = None

    def take(self, frame: Frame) -> bool:
        """Whether the image of a frame is sent, if it is read."""
        if frame.encoded is not None or frame.image is None:
            return frame.encoded is not None
        slot = int(frame.timestamp_ns * 1e-9 * self._per_s)
        is_due = slot != self._slot
        self._slot = slot
        return is_due

    def encoded(self, frame: Frame) -> tuple[bytes, str]:
        """As `encoded_image`, with the scale of the images so far."""
        if frame.encoded is None and frame.image is not None:
            self._scale = least_scale(self._scale, frame.image)
        return encoded_image(frame, self._scale)


def encoded_image(frame: Frame, scale: float | None = None) -> tuple[bytes, str]:
    """The image of a frame as the camera sent it, else as JPEG, and the format: "jpeg" or "png".

    Several outputs that send the same frame encode it once.

    Args:
        frame: to be sent.
        scale: of its grey levels (`to_8_bits`).
    """
    if frame.encoded is not None:
        return frame.encoded, image_format(frame.encoded)
    if frame.image is None:
        return b"", "jpeg"
    with _ENCODING:
        return _as_jpeg(frame, scale), "jpeg"


@lru_cache(maxsize=2)
def _as_jpeg(frame: Frame, scale: float | None) -> bytes:
    import cv2

    assert frame.image is not None
    image = to_8_bits(frame.image, scale)
    _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes()
