"""Calibration boards in the size of the view."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.design.parts.boards import PATTERNS, VIEW_SHARE, fitting_board, squares_across, view_mm
from manytouch.design.parts.patterns import A4_MM, MARGIN_MM, board_page


@pytest.mark.parametrize("distance_mm", [20.0, 68.0, 140.0, 900.0])
@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_board_fits_view_and_page_and_fills_one_of_them(found, pattern: str, distance_mm: float) -> None:
    camera = replace(found.sensor.camera, translation_mm=np.array([0.0, 0.0, distance_mm]))
    board = fitting_board(pattern, camera)
    size_mm = np.sort(np.array(squares_across(board)) * board.square_mm)
    room_mm = VIEW_SHARE * np.sort(view_mm(camera))
    assert np.all(size_mm <= room_mm + 1e-9)
    board_page(board)  # fits A4
    larger_mm = np.array(squares_across(board)) * (board.square_mm + 0.5)
    is_larger_than_page = np.any(larger_mm > np.subtract(A4_MM, (MARGIN_MM, 2 * MARGIN_MM)))
    assert np.any(np.sort(larger_mm) > room_mm) or is_larger_than_page
