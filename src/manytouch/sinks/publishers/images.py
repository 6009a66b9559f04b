"""Encoded images of frames, for other programs."""

import numpy as np

from manytouch.values import Frame

JPEG_QUALITY = 90


def encoded_image(frame: Frame) -> tuple[bytes, str]:
    """The image of a frame as the camera sent it, else as JPEG, and the format: "jpeg" or "png"."""
    if frame.encoded is not None:
        return frame.encoded, "png" if frame.encoded.startswith(b"\x89PNG") else "jpeg"
    import cv2

    image = frame.image
    if image is None:
        return b"", "jpeg"
    if image.dtype != np.uint8:
        image = (image >> 8).astype(np.uint8)
    _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return encoded.tobytes(), "jpeg"
