"""Grey levels of cameras with 8 to 16 bits, whose images are stored with 8 or 16."""

import numpy as np
import pytest

from manytouch.values.images.grey_levels import least_scale, level_scale, to_8_bits

EVERY_LEVEL = np.arange(256, dtype=np.uint8).reshape(16, 16)


def stored(image: np.ndarray, bits: int) -> np.ndarray:
    """What a camera of so many bits stores in the lower ones of 16."""
    return np.rint(image * ((2**bits - 1) / 255.0)).astype(np.uint16)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_an_image_of_any_camera_has_the_same_8_bits(bits: int) -> None:
    np.testing.assert_array_equal(to_8_bits(stored(EVERY_LEVEL, bits)), EVERY_LEVEL)
    colour = np.stack([EVERY_LEVEL, EVERY_LEVEL.T, EVERY_LEVEL[::-1]], axis=-1)
    np.testing.assert_array_equal(to_8_bits(stored(colour, bits)), colour)


def test_an_image_of_8_bits_is_returned_as_it_is() -> None:
    assert to_8_bits(EVERY_LEVEL) is EVERY_LEVEL
    assert level_scale(EVERY_LEVEL) == 1.0


@pytest.mark.parametrize(
    ("largest", "white"),
    [(255, 255), (256, 1023), (1023, 1023), (1024, 4095), (4095, 4095), (4096, 16383), (16384, 65535)],
)
def test_the_largest_level_decides_how_many_bits_a_camera_has(largest: int, white: int) -> None:
    image = np.array([[0, largest]], dtype=np.uint16)
    assert level_scale(image) == 255.0 / white


def test_a_dark_image_among_others_of_a_camera_stays_dark() -> None:
    bright, dark = stored(EVERY_LEVEL, 12), stored(EVERY_LEVEL // 8, 12)
    scale = least_scale(least_scale(None, bright), dark)
    np.testing.assert_array_equal(to_8_bits(dark, scale), EVERY_LEVEL // 8)
    assert least_scale(least_scale(None, dark), bright) == scale < level_scale(dark)
