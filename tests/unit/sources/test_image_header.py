"""The header of an image gives its size, and images of a size that is not allowed are never decoded."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.limits import MAX_PIXELS
from manytouch.sources import open_source
from manytouch.sources.encoded import decode
from manytouch.sources.image_header import image_mistake, read_header

SUFFIXES = (".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm")


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def huge_png(width: int = 30_000, height: int = 30_000) -> bytes:
    """A PNG whose header states a size, with few bytes of content."""
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(10_000))) + chunk(b"IEND", b"")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("channels", [1, 3])
def test_the_size_is_that_of_the_decoded_image(suffix: str, channels: int) -> None:
    image = np.full((37, 53, channels), 90, np.uint8)
    if suffix == ".ppm" and channels == 1:
        suffix = ".pgm"
    encoded = np.asarray(cv2.imencode(suffix, image)[1]).tobytes()
    header = read_header(memoryview(encoded))
    assert header is not None
    assert (header.width_px, header.height_px) == (53, 37)
    assert image_mistake(encoded) is None


@pytest.mark.parametrize("count", [60, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_headers_that_are_cut_short_or_damaged_are_refused(suffix: str, count: int) -> None:
    encoded = np.asarray(cv2.imencode(suffix, np.zeros((37, 53, 3), np.uint8))[1]).tobytes()
    random = np.random.default_rng(3)
    for length in (*range(40), 100):
        image_mistake(encoded[:length])
    assert image_mistake(encoded[:8]) is not None
    for _ in range(count):
        damaged = bytearray(encoded)
        damaged[random.integers(min(len(damaged), 200))] = random.integers(256)
        decode(bytes(damaged), is_colour=True)


def test_a_huge_image_is_refused_with_its_size(tmp_path: Path) -> None:
    (tmp_path / "bomb.png").write_bytes(huge_png())
    for given in (tmp_path / "bomb.png", tmp_path):
        with pytest.raises(SourceError, match="30000 x 30000 px are too many"):
            open_source(given)
    assert decode(huge_png(), is_colour=True) is None
    side = int(MAX_PIXELS**0.5)
    assert image_mistake(huge_png(side, side)) is None
    assert image_mistake(huge_png(side, side + 1)) is not None
    assert image_mistake(huge_png(0, 10)) is not None


def test_unknown_formats_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"this is text, not an image" * 10)
    with pytest.raises(SourceError, match="not PNG, JPEG"):
        open_source(tmp_path / "a.png")
