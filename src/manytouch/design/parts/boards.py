"""Calibration boards in the size that the camera sees in focus."""

import math

from manytouch.calibration.camera.board import Board, parse_board
from manytouch.design.parts.patterns import A4_MM, MARGIN_MM
from manytouch.values import Camera

PATTERNS = ("chessboard:9x6", "charuco:10x7", "circles-asymmetric:4x11")
VIEW_SHARE = 0.75
"""Largest side of a board over that of the view at the distance in focus: it must stay in it when tilted."""
STEPS_MM = ((3.0, 0.5), (0.0, 0.1))
"""From which size on, squares are a multiple of which size."""


def view_mm(camera: Camera) -> tuple[float, float]:
    """Width and height of what the camera sees at the distance of its sheet."""
    distance_mm = float(camera.translation_mm[2])
    return distance_mm * camera.width_px / camera.fx_px, distance_mm * camera.height_px / camera.fy_px


def fitting_board(pattern: str, camera: Camera) -> Board:
    """The board with the largest squares that fits the view of a camera and an A4 page.

    Args:
        pattern: such as `chessboard:9x6`.
        camera: with the pose of its sheet, at the distance that is in focus.
    """
    squares = squares_across(parse_board(pattern, 1.0))
    view = (VIEW_SHARE * side for side in view_mm(camera))
    page = (A4_MM[0] - MARGIN_MM, A4_MM[1] - 2 * MARGIN_MM)
    # the long side of a board is turned along the long side of view
    view_mm_of, squares_of = sorted(view), sorted(squares)
    side_mm = min(view_mm_of[axis] / squares_of[axis] for axis in (0, 1))
    side_mm = min(side_mm, *(room / number for room, number in zip(page, squares, strict=True)))
    step_mm = next(step for least, step in STEPS_MM if side_mm >= least)
    return parse_board(pattern, round(max(math.floor(side_mm / step_mm + 1e-9), 1) * step_mm, 1))


def squares_across(board: Board) -> tuple[float, float]:
    """Width and height of what is printed, in squares, or in distances of circles."""
    point = board.point_mm[:, :2] / board.square_mm
    beyond = 2.0 if board.has_corners else 1.0
    width, height = point.max(axis=0) - point.min(axis=0) + beyond
    return float(width), float(height)
