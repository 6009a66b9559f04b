"""Images are those of OpenCV; JPEG data without their image are refused."""

import cv2
import numpy as np
import pytest

from manytouch.sources.decoding import decode_image
from manytouch.sources.encoded import decode

READ = (cv2.IMREAD_GRAYSCALE, cv2.IMREAD_COLOR, cv2.IMREAD_ANYCOLOR)


def picture(*, is_colour: bool = False) -> np.ndarray:
    """Dark dots on a grey sheet with noise."""
    image = np.full((240, 320), 120.0)
    for y in range(20, 240, 30):
        for x in range(20, 320, 30):
            cv2.circle(image, (x, y), 7, 30.0, -1, cv2.LINE_AA)
    image += np.random.default_rng(0).normal(0.0, 3.0, image.shape)
    grey = np.clip(image, 0.0, 255.0).astype(np.uint8)
    return np.dstack([grey, 255 - grey, np.roll(grey, 9, axis=1)]) if is_colour else grey


def jpeg(*, is_colour: bool = False, flags: tuple[int, ...] = ()) -> bytes:
    return cv2.imencode(".jpg", picture(is_colour=is_colour), flags)[1].tobytes()


def without_tables(encoded: bytes) -> bytes:
    """As many USB cameras send Motion JPEG: without its Huffman tables, which are the usual ones."""
    kept = (encoded[begin:end] for begin, end, marker in segments(encoded) if marker != 0xC4)
    return encoded[:2] + b"".join(kept)


def segments(encoded: bytes) -> list[tuple[int, int, int]]:
    """Begin, end and marker of each part; the last one has the compressed data."""
    found, at = [], 2
    while encoded[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(encoded[at + 2 : at + 4], "big")
        found.append((at, end, encoded[at + 1]))
        at = end
    return [*found, (at, len(encoded), 0xDA)]


@pytest.mark.parametrize("mode", READ)
@pytest.mark.parametrize("is_colour", [False, True])
@pytest.mark.parametrize(
    "flags",
    [
        (),
        (cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
        (cv2.IMWRITE_JPEG_RST_INTERVAL, 4),
        (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422),
    ],
)
def test_an_image_is_that_of_opencv(mode: int, is_colour: bool, flags: tuple[int, ...]) -> None:
    for encoded in (jpeg(is_colour=is_colour, flags=flags), without_tables(jpeg(is_colour=is_colour))):
        found = decode_image(encoded, mode)
        assert found is not None
        np.testing.assert_array_equal(found, cv2.imdecode(np.frombuffer(encoded, np.uint8), mode))


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif", ".webp"])
def test_other_formats_are_left_to_opencv(suffix: str) -> None:
    encoded = cv2.imencode(suffix, picture())[1].tobytes()
    found = decode_image(encoded, cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(found, cv2.imdecode(np.frombuffer(encoded, np.uint8), 0))


def test_a_jpeg_that_is_to_be_turned_is_turned() -> None:
    orientation = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    part = b"Exif\0\0" + orientation
    encoded = jpeg()
    encoded = encoded[:2] + b"\xff\xe1" + (len(part) + 2).to_bytes(2, "big") + part + encoded[2:]
    found = decode_image(encoded, cv2.IMREAD_GRAYSCALE)
    assert found is not None
    assert found.shape == (320, 240)


@pytest.mark.parametrize("is_colour", [False, True])
def test_data_without_their_image_are_refused(is_colour: bool) -> None:
    encoded = jpeg(is_colour=is_colour)
    begin = segments(encoded)[-1][0] + 100
    missing = encoded[:begin] + encoded[begin + 1500 :]
    assert cv2.imdecode(np.frombuffer(missing, np.uint8), 0) is not None, "OpenCV shows something"
    assert decode(missing, is_colour=is_colour) is None


def test_bytes_after_the_data_are_harmless() -> None:
    encoded = jpeg()
    found = decode_image(encoded[:-2] + bytes(20) + encoded[-2:], cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(found, decode_image(encoded, cv2.IMREAD_GRAYSCALE))
