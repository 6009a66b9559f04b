"""Boards with more points than the user states, a part of which is found as well."""

from collections import Counter
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from scipy.spatial import KDTree

from manytouch.calibration.camera.board import (
    SEARCH_WIDTH_PX,
    Board,
    BoardDetection,
    find_board,
    parse_board,
    spacing_px,
)

_SEEDS = ((3, 3), (4, 4))  # sizes from which a chessboard is grown: one alone ends early in some images
_SAME_SHARE = 0.25  # of the spacing, within which two points are the same
_OUTWARD = (0.12, 0.24, 0.36)  # where squares beyond the outer corners are sampled, shares of a square
_ALONG = (0.3, 0.5, 0.7)
_LEAST_OPPOSITE = 0.9  # of the samples: background that has the colours of squares by chance has half


def larger_board(image: np.ndarray, detection: BoardDetection, board: Board) -> Board | None:
    """The board of which the one that was found is only a part; None if there is none.

    Every point that was found must be one of it. ChArUco boards have none: the number of a marker states
    its place, so that a part of one gives the same camera.

    Args:
        image: (h, w) grey.
        detection: of the stated board in it.
        board: as stated.
    """
    if board.kind == "chessboard":
        found: Iterable[tuple[tuple[int, int], np.ndarray]] = _grown(
            image, (board.columns, board.rows), board
        )
    elif board.kind == "circles":
        found = _with_one_more_line(image, board)
    else:
        return None
    for (columns, rows), place_px in found:
        is_as_large = columns >= board.columns and rows >= board.rows
        if is_as_large and (columns, rows) != (board.columns, board.rows):
            distance_px, _ = KDTree(place_px).query(detection.place_px)
            if distance_px.max() < _SAME_SHARE * spacing_px(detection):
                return parse_board(f"{board.kind}:{columns}x{rows}", board.square_mm)
    return None


def chessboard_in(images: Iterable[np.ndarray], board: Board) -> Board | None:
    """The chessboard that most grey images show, whatever its size; None if they show none."""
    sizes: Counter[tuple[int, int]] = Counter()
    for image in images:
        grown = [size for seed in _SEEDS for size, _ in _grown(image, seed, board)]
        sizes.update([max(grown, key=lambda size: size[0] * size[1])] if grown else [])
    if not sizes:
        return None
    columns, rows = sizes.most_common(1)[0][0]
    return parse_board(f"chessboard:{columns}x{rows}", board.square_mm)


def _grown(
    image: np.ndarray, least: tuple[int, int], board: Board
) -> Iterator[tuple[tuple[int, int], np.ndarray]]:
    """The chessboard with at least so many columns and rows: its size and (n, 2) its corners, px.

    Its longer side is that of `board`, since a board may be seen turned.
    """
    share = min(1.0, SEARCH_WIDTH_PX / image.shape[1])
    small = (
        image if share == 1.0 else cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    )
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_LARGER
    is_found, place, meta = cv2.findChessboardCornersSBWithMeta(small, least, flags)
    if is_found and _has_outer_squares(small, np.asarray(place, dtype=np.float64).reshape(*meta.shape, 2)):
        short, long = sorted(meta.shape)
        size = (long, short) if board.columns >= board.rows else (short, long)
        yield size, (np.asarray(place, dtype=np.float64).reshape(-1, 2) + 0.5) / share - 0.5


def _has_outer_squares(image: np.ndarray, corner_px: np.ndarray) -> bool:
    """Whether squares continue beyond the outer corners of a chessboard on each of its four sides.

    They do not where a margin, or what lies around the board, was taken as a further row of corners.

    Args:
        image: (h, w) grey.
        corner_px: (rows, columns, 2).
    """
    across = np.array([*_OUTWARD, *(-step for step in _OUTWARD)])[:, None, None, None]
    along = np.array(_ALONG)[:, None, None]
    height, width = image.shape
    for turns in range(4):
        side = np.rot90(corner_px, turns)[:2]
        edge, next_row = (row[:-1] + along * (row[1:] - row[:-1]) for row in side)
        x, y = np.moveaxis(np.rint(edge + across * (next_row - edge)).astype(int), -1, 0)
        is_inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        level = image[y.clip(0, height - 1), x.clip(0, width - 1)].astype(np.float64)
        inner, outer = np.split(level, 2)
        square = inner.mean(axis=(0, 1))
        other = np.append(square[1:], square[-2])
        is_opposite = (outer - (square + other) / 2) * (square - other) < 0
        is_known = np.split(is_inside, 2)[1]
        if np.count_nonzero(is_opposite & is_known) < _LEAST_OPPOSITE * np.count_nonzero(is_known):
            return False
    return True


def _with_one_more_line(image: np.ndarray, board: Board) -> Iterator[tuple[tuple[int, int], np.ndarray]]:
    """Grids of circles with one more column or row than a board."""
    for columns, rows in ((board.columns + 1, board.rows), (board.columns, board.rows + 1)):
        other = parse_board(f"{board.kind}:{columns}x{rows}", board.square_mm)
        found = find_board(image, other)
        if found is not None:
            yield (columns, rows), found.place_px
