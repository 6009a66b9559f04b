"""Text on images."""

import numpy as np

from manytouch.sinks.pictures.drawing import text_size, write_text


def test_plus_minus_is_as_wide_as_a_plus():
    assert text_size("1.0 ± 0.1", 20.0) == text_size("1.0 + 0.1", 20.0)
    plain, signed = np.zeros((2, 60, 200, 3), np.uint8)
    write_text(plain, "+", (10.0, 40.0), 20.0, (255, 255, 255))
    write_text(signed, "±", (10.0, 40.0), 20.0, (255, 255, 255))
    assert signed[38:44].sum() > plain[38:44].sum()
