"""Encoded images of frames, for other programs."""

import threading
from functools import lru_cache

import numpy as np

from manytouch.values import Frame

JPEG_QUALITY = 90
_ENCODING = threading.Lock()


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
