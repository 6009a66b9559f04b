"""Boards as texts."""

import pytest

from manytouch.calibration.camera.board import parse_board
from manytouch.errors import ManytouchError


@pytest.mark.parametrize(
    "text", ["chessboard:9x6", "circles-asymmetric:4x11", "charuco:8x6", "charuco:8x6:DICT_5X5_100"]
)
def test_the_text_of_a_board_describes_it_completely(text: str) -> None:
    board = parse_board(text, 25.0)
    assert str(board) == text
    assert parse_board(str(board), board.square_mm) == board


def test_a_larger_dictionary_is_named_with_a_text_that_is_a_board() -> None:
    with pytest.raises(ManytouchError, match="such as charuco:20x15:DICT_5X5_1000") as raised:
        parse_board("charuco:20x15:DICT_4X4_50", 25.0)
    assert str(parse_board(str(raised.value).rpartition(" ")[2], 25.0)) == "charuco:20x15:DICT_5X5_1000"
