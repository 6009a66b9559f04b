"""Decodes images from the bytes of a camera."""

from dataclasses import replace

from manytouch.sources.decoding import decode_image
from manytouch.sources.quiet_opencv import cv2
from manytouch.values import Frame
from manytouch.values.arrays import Image, read_only
from manytouch.values.frame import image_format


def decoded(frame: Frame, *, is_colour: bool) -> Frame:
    """The frame with its image: unchanged when it has one, with None when its bytes cannot be decoded.

    Args:
        frame: with `encoded` bytes, JPEG or PNG.
        is_colour: BGR instead of the luminance alone, which takes a third of the time.
    """
    if frame.image is not None or frame.encoded is None:
        return frame
    return replace(frame, image=decode(frame.encoded, is_colour=is_colour))


def decode(encoded: bytes, *, is_colour: bool) -> Image | None:
    """Grey or BGR image of 8 or 16 bits, from a PNG as stored; None when the bytes cannot be decoded."""
    mode = cv2.IMREAD_COLOR if is_colour else cv2.IMREAD_GRAYSCALE
    if image_format(encoded) == "png":
        mode = cv2.IMREAD_ANYCOLOR
    image = decode_image(encoded, mode)
    return None if image is None else read_only(image)
