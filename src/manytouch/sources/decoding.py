"""Decodes images of any format, but no JPEG with corrupt data.

OpenCV decodes corrupt JPEG data as shifted or grey blocks, and only prints a line; with simplejpeg the same
library, libjpeg-turbo, states it. Images are the same, bit for bit.
"""

import re

import numpy as np
import simplejpeg

from manytouch.sources.image_header import Encoded, image_mistake
from manytouch.sources.quiet_opencv import cv2
from manytouch.values.arrays import Image

_CORRUPT = re.compile(r"premature end of data|bad Huffman code|found marker")
"""Messages of libjpeg-turbo (jerror.h) on data without their image. Bytes between the data and a marker are
harmless: some cameras send them with every image."""
_JPEG = b"\xff\xd8"
_ORIENTED = b"Exif\0\0"
_FIRST_BYTES = 4096  # of them Exif data, which may turn an image, are one of the first parts


def decode_image(encoded: Encoded, mode: int) -> Image | None:
    """Grey or BGR image of 8 or 16 bits; None if its bytes cannot be decoded, or are corrupt JPEG data.

    Args:
        encoded: of any format of `image_mistake`.
        mode: OpenCV's read flag: IMREAD_GRAYSCALE, IMREAD_COLOR or IMREAD_ANYCOLOR.
    """
    if image_mistake(encoded) is not None:
        return None
    first = bytes(encoded[:_FIRST_BYTES])
    if first.startswith(_JPEG) and _ORIENTED not in first:
        try:
            return _jpeg(encoded, mode)
        except ValueError as error:
            if _CORRUPT.search(str(error)):
                return None
            # other warnings are harmless, and some kinds of JPEG only OpenCV reads
    try:
        image: Image | None = cv2.imdecode(np.frombuffer(encoded, np.uint8), mode | cv2.IMREAD_ANYDEPTH)
    except cv2.error:
        return None
    return image


def _jpeg(encoded: Encoded, mode: int) -> Image:
    is_grey = mode == cv2.IMREAD_GRAYSCALE
    if mode == cv2.IMREAD_ANYCOLOR:
        is_grey = simplejpeg.decode_jpeg_header(encoded)[2] == "Gray"
    image: Image = simplejpeg.decode_jpeg(encoded, "GRAY" if is_grey else "BGR", strict=True)
    return image[:, :, 0] if is_grey else image
