"""A board of which only a part was stated is named; the stated board is never taken for a part of another."""

from dataclasses import replace

import numpy as np
import pytest

import boards
from boards import BOARD, picture, poses, true_camera
from manytouch.calibration.camera.board import Board, find_board, parse_board
from manytouch.calibration.camera.calibrate import calibrate_camera
from manytouch.calibration.camera.larger_board import chessboard_in, larger_board
from manytouch.errors import ManytouchError
from manytouch.values import Frame


def drawn(board: Board, count: int) -> list[np.ndarray]:
    return [picture(true_camera(), board, pose, seed=n) for n, pose in enumerate(poses(count, board=board))]


def frames(images) -> list[tuple[str, Frame]]:
    return [
        (f"view {number}", Frame(index=number, timestamp_ns=number, camera="test", image=image))
        for number, image in enumerate(images)
    ]


@pytest.mark.parametrize(
    ("true", "stated"),
    [("chessboard:8x5", "chessboard:7x5"), ("circles:8x5", "circles:7x5"), ("circles:8x5", "circles:8x4")],
)
def test_a_part_of_a_board_is_refused_with_the_size_of_the_whole(true, stated):
    images = drawn(parse_board(true, 20.0), 6)
    sentence = rf"good views show a {true}, of which the given {stated} is only a part: give --board {true}"
    with pytest.raises(ManytouchError, match=sentence):
        calibrate_camera(frames(images), parse_board(stated, 20.0))


@pytest.mark.parametrize("stated", ["chessboard:8x4", "chessboard:6x4"])
def test_the_size_that_is_proposed_is_that_of_the_whole_board(stated):
    with pytest.raises(ManytouchError, match="they show a chessboard:8x5: give --board chessboard:8x5"):
        calibrate_camera(frames(drawn(BOARD, 3)), parse_board(stated, 20.0))


def test_a_grid_of_circles_has_each_circle_once():
    for image in drawn(parse_board("circles:8x5", 20.0), 6):
        found = find_board(image, parse_board("circles:8x4", 20.0))
        assert found is None or len(np.unique(found.place_px, axis=0)) == len(found.place_px)


@pytest.mark.parametrize("kind", ["chessboard", "circles"])
@pytest.mark.parametrize(
    ("around", "margin"),
    [("dark", 0.0), ("dark", 0.5), ("grey", 0.0), ("checks", 0.0), ("stripes", 0.5), ("things", 0.0)],
)
def test_the_stated_board_is_not_taken_for_a_part(kind, margin, around, monkeypatch):
    board = parse_board(f"{kind}:8x5", 20.0)
    plain = boards.printed

    def on_a_table(which: Board, place_mm: np.ndarray) -> np.ndarray:
        square = place_mm / which.square_mm
        outside = np.full(square.shape[:-1], {"dark": 0.05, "grey": 0.5}.get(around, 0.6))
        if around == "checks":  # as large as the squares, but elsewhere
            outside = np.floor(square + np.array([0.4, 0.5])).sum(axis=-1) % 2
        if around == "stripes":  # each continues a column of squares, up to the margin
            outside = np.floor(square[..., 0]) % 2
        if around == "things":
            chance = np.random.default_rng(5)
            for _ in range(60):
                centre, half = chance.uniform(-6, 14, 2), chance.uniform(0.2, 2, 2)
                outside[(np.abs(square - centre) < half).all(axis=-1)] = chance.random()
        is_paper = (square >= -1 - margin) & (square < np.array([which.columns, which.rows]) + margin)
        return np.where(is_paper.all(axis=-1), plain(which, place_mm), outside).astype(np.float32)

    monkeypatch.setattr(boards, "printed", on_a_table)
    detections = [(image, find_board(image, board)) for image in drawn(board, 4)]
    found = [larger_board(image, each, board) for image, each in detections if each is not None]
    assert found
    assert found == [None] * len(found)


def test_a_board_may_be_stated_with_columns_and_rows_exchanged():
    turned = replace(BOARD, columns=BOARD.rows, rows=BOARD.columns)
    images = drawn(BOARD, 3)
    assert chessboard_in(images, BOARD) == BOARD
    assert chessboard_in(images, turned) == turned
    for image in images:
        detection = find_board(image, turned)
        assert detection is not None
        assert larger_board(image, detection, turned) is None


def test_images_without_a_chessboard_show_none():
    assert chessboard_in([np.full((120, 160), 120, dtype=np.uint8)], BOARD) is None
