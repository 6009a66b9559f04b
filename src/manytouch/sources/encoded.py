"""From the bytes that a camera gave to a picture."""

from dataclasses import replace

import numpy as np

from manytouch.sources.quiet_opencv import cv2
from manytouch.values import Frame
from manytouch.values.arrays import Image, read_only

PNG_BEGIN = b"\x89PNG"


def decoded(frame: Frame, *, is_colour: bool) -> Frame:
    """The frame with its picture; without one when its bytes cannot be decoded, as it is when it has one.

    Args:
        frame: with `encoded` bytes, JPEG or PNG.
        is_colour: BGR instead of the luminance alone, which takes a third of the time.
    """
    if frame.image is not None or frame.encoded is None:
        return frame
    return replace(frame, image=picture_of(frame.encoded, is_colour=is_colour))


def picture_of(encoded: bytes, *, is_colour: bool) -> Image | None:
    """Grey or BGR, of 8 or 16 bits, a PNG as it was stored; None when the bytes are no whole picture."""
    mode = cv2.IMREAD_COLOR if is_colour else cv2.IMREAD_GRAYSCALE
    if encoded.startswith(PNG_BEGIN):
        mode = cv2.IMREAD_ANYCOLOR
    try:
        image = cv2.imdecode(np.frombuffer(encoded, np.uint8), mode | cv2.IMREAD_ANYDEPTH)
    except cv2.error:
        return None
    return None if image is None else read_only(image)
