"""Frames: the format of their encoded images."""

import cv2
import numpy as np
import pytest

from manytouch.values.frame import image_format


@pytest.mark.parametrize(("suffix", "expected"), [(".png", "png"), (".jpg", "jpeg")])
def test_the_format_of_an_encoded_image_is_found_by_its_bytes(suffix: str, expected: str) -> None:
    _, encoded = cv2.imencode(suffix, np.zeros((4, 6), np.uint8))
    assert image_format(encoded.tobytes()) == expected
