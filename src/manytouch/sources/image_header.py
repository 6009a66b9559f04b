"""Size of an encoded image from its first bytes, so that a size that is not allowed is never decoded.

PNG: W3C, 11.2.1. JPEG: ITU-T T.81, B.2.2. BMP: Microsoft, BITMAPINFOHEADER. TIFF 6.0, section 2. WebP: RFC
9649. PNM: Netpbm.
"""

import re
import struct
from dataclasses import dataclass

from manytouch.limits import MAX_IMAGE_BYTES, size_mistake

FORMATS = "PNG, JPEG, BMP, TIFF, WebP or PNM"
_PNM = re.compile(rb"P[1-6](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s")
_START_OF_SCAN = 0xDA
_START_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_WITHOUT_LENGTH = {0x01, *range(0xD0, 0xD9)}
_TIFF_TYPES = {1: "B", 3: "H", 4: "I", 16: "Q"}  # BYTE, SHORT, LONG, LONG8
_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_BITS = 256, 257, 258
MAX_BITS = 16

Encoded = bytes | memoryview


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageHeader:
    """What the first bytes of an image state; `bits` per sample where they are not 8 or 16 by format."""

    width_px: int
    height_px: int
    bits: int = 8


def image_mistake(encoded: Encoded) -> str | None:
    """Why an encoded image must not be decoded; None if it may be."""
    if len(encoded) > MAX_IMAGE_BYTES:
        return f"it has more than {MAX_IMAGE_BYTES // 10**6} MB"
    try:
        header = read_header(memoryview(encoded))
    except (struct.error, IndexError, ValueError, KeyError):
        header = None
    if header is None:
        return f"it is not {FORMATS}"
    if header.bits > MAX_BITS:
        return f"it has {header.bits} bits per channel, at most {MAX_BITS} are read"
    if header.width_px < 1 or header.height_px < 1:
        return f"its size is {header.width_px} x {header.height_px} px"
    return size_mistake(header.width_px, header.height_px)


def read_header(image: memoryview) -> ImageHeader | None:
    """The header of an image; None if it is of no known format.

    Raises:
        struct.error, IndexError, ValueError, KeyError: it is cut short or damaged.
    """
    head = bytes(image[:4096])
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        return _header(struct.unpack_from(">II", head, 16))
    if head.startswith(b"\xff\xd8"):
        return _jpeg(image)
    if head.startswith(b"BM"):
        return _bmp(head)
    if head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _tiff(image)
    if head.startswith(b"RIFF") and head[8:12] == b"WEBP":
        return _webp(head)
    return _pnm(head)


def _header(size: tuple[int, ...]) -> ImageHeader:
    return ImageHeader(width_px=size[0], height_px=size[1])


def _jpeg(image: memoryview) -> ImageHeader | None:
    place = 2
    while True:
        place += bytes(image[place : place + 2**16]).index(b"\xff")
        marker = image[place + 1]
        if marker == 0xFF:
            place += 1
        elif marker in _WITHOUT_LENGTH:
            place += 2
        elif marker in _START_OF_FRAME:
            height, width = struct.unpack_from(">HH", image, place + 5)
            return _header((width, height))
        elif marker == _START_OF_SCAN:  # the start of the frame must come before
            return None
        else:
            place += 2 + struct.unpack_from(">H", image, place + 2)[0]


def _bmp(head: bytes) -> ImageHeader:
    if struct.unpack_from("<I", head, 14)[0] == 12:
        return _header(struct.unpack_from("<HH", head, 18))
    width, height = struct.unpack_from("<ii", head, 18)
    return _header((width, abs(height)))


def _pnm(head: bytes) -> ImageHeader | None:
    found = _PNM.match(head)
    return None if found is None else _header((int(found[1]), int(found[2])))


def _tiff(image: memoryview) -> ImageHeader | None:
    head = bytes(image[:4])
    order = "<" if head.startswith(b"II") else ">"
    is_big = b"+" in head
    (place,) = struct.unpack_from(f"{order}{'Q' if is_big else 'I'}", image, 8 if is_big else 4)
    (count,) = struct.unpack_from(f"{order}{'Q' if is_big else 'H'}", image, place)
    place += 8 if is_big else 2
    step = 20 if is_big else 12
    values = {_TIFF_BITS: 1}
    for entry in range(place, place + step * min(count, 4096), step):
        tag, kind = struct.unpack_from(f"{order}HH", image, entry)
        if tag in (_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_BITS) and kind in _TIFF_TYPES:
            (number,) = struct.unpack_from(f"{order}{'Q' if is_big else 'I'}", image, entry + 4)
            code, at = f"{order}{_TIFF_TYPES[kind]}", entry + (12 if is_big else 8)
            if number * struct.calcsize(code) > (8 if is_big else 4):
                (at,) = struct.unpack_from(f"{order}{'Q' if is_big else 'I'}", image, at)
            (values[tag],) = struct.unpack_from(code, image, at)
    return ImageHeader(width_px=values[_TIFF_WIDTH], height_px=values[_TIFF_HEIGHT], bits=values[_TIFF_BITS])


def _webp(head: bytes) -> ImageHeader | None:
    kind = head[12:16]
    if kind == b"VP8X":
        width, height = (1 + int.from_bytes(head[at : at + 3], "little") for at in (24, 27))
        return _header((width, height))
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", head, 21)
        return _header((1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)))
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", head, 26)
        return _header((width & 0x3FFF, height & 0x3FFF))
    return None
