"""Frames: the format of their encoded images."""

import cv2
import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.limits import MAX_FRAME_INDEX
from manytouch.values.frame import Frame, image_format


@pytest.mark.parametrize(("suffix", "expected"), [(".png", "png"), (".jpg", "jpeg")])
def test_the_format_of_an_encoded_image_is_found_by_its_bytes(suffix: str, expected: str) -> None:
    _, encoded = cv2.imencode(suffix, np.zeros((4, 6), np.uint8))
    assert image_format(encoded.tobytes()) == expected


@pytest.mark.parametrize("index", [-1, MAX_FRAME_INDEX + 1, 2**40])
def test_a_number_that_tables_and_messages_cannot_have_is_refused(index: int) -> None:
    Frame(index=MAX_FRAME_INDEX, timestamp_ns=0, camera="mine", image=None)
    with pytest.raises(
        SourceError, match=f"^a frame has the number {index}: give whole numbers from 0 to 2147483647$"
    ):
        Frame(index=index, timestamp_ns=0, camera="mine", image=None)
