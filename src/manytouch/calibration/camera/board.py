"""Calibration boards and their detection in an image."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

import cv2
import numpy as np

from manytouch.errors import ManytouchError
from manytouch.values.arrays import Points2, Points3, read_only

Kind = Literal["chessboard", "charuco", "circles", "circles-asymmetric"]
FORMS = "chessboard:9x6 (inner corners), charuco:8x6 (squares), circles:9x6 or circles-asymmetric:4x11"

MARKER_SHARE = 0.75
"""Side of a ChArUco marker over the side of a square."""
DEFAULT_DICTIONARY = "DICT_4X4_250"
"""Dictionary of ChArUco markers, as OpenCV names it."""
LONGEST_SHOWN = 60  # characters of a text in a message
LEAST_SQUARE_MM, LARGEST_SQUARE_MM = 1e-3, 1e5
SEARCH_WIDTH_PX = 1280  # boards are searched in images of at most this width, then refined


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A flat board with known points.

    Attributes:
        kind: what is printed on it.
        columns, rows: inner corners of a chessboard, squares of a ChArUco board, circles.
        square_mm: side of a square, or distance of neighbouring circles (in an asymmetric grid half the
            distance along a row, as OpenCV counts).
        dictionary: of the ChArUco markers, as OpenCV names it.
    """

    kind: Kind
    columns: int
    rows: int
    square_mm: float
    dictionary: str = DEFAULT_DICTIONARY

    def __str__(self) -> str:
        """As `parse_board` reads it."""
        end = "" if self.dictionary == DEFAULT_DICTIONARY else f":{self.dictionary}"
        return f"{self.kind}:{self.columns}x{self.rows}{end}"

    @property
    def has_corners(self) -> bool:
        """Whether its points are corners of squares, which can be refined in a window."""
        return self.kind in ("chessboard", "charuco")

    @property
    def point_mm(self) -> Points3:
        """(n, 3) its points, z = 0, mm."""
        if self.kind == "charuco":
            return np.asarray(_charuco(self).getChessboardCorners(), dtype=np.float64)
        row, column = (index.ravel().astype(np.float64) for index in np.indices((self.rows, self.columns)))
        if self.kind == "circles-asymmetric":
            column = 2 * column + row % 2
        return np.column_stack([column, row, np.zeros(len(row))]) * self.square_mm


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BoardDetection:
    """Points of a board in one image.

    Attributes:
        number: (n,) indices of the points.
        place_px: (n, 2) their positions.
    """

    number: np.ndarray
    place_px: Points2


def parse_board(text: str, square_mm: float) -> Board:
    """Parse a board such as `chessboard:9x6`.

    Raises:
        ManytouchError: unknown kind, too few points, or an invalid size.
    """
    shown = repr(text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}...")
    kind, _, rest = text.partition(":")
    size, _, dictionary = rest.partition(":")
    columns, _, rows = size.partition("x")
    if kind not in get_args(Kind) or not (columns.isdecimal() and rows.isdecimal()):
        raise ManytouchError(f"{shown} is not a board: give KIND:COLUMNSxROWS, such as {FORMS}")
    if max(len(columns), len(rows)) > 3:
        raise ManytouchError(f"the board {shown} is too large: at most 999 by 999 points are found")
    if min(int(columns), int(rows)) < 3:
        raise ManytouchError(f"the board {shown} is too small: at least 3 by 3 points are needed")
    if not LEAST_SQUARE_MM <= square_mm <= LARGEST_SQUARE_MM:
        raise ManytouchError(
            f"a square of {square_mm:g} mm is not valid: it must have {LEAST_SQUARE_MM:g} to "
            f"{LARGEST_SQUARE_MM:g} mm; measure one on the printed board"
        )
    if dictionary and (kind != "charuco" or not hasattr(cv2.aruco, dictionary)):
        raise ManytouchError(
            f"the end of {shown} is not a dictionary of ChArUco markers: give one of OpenCV's names, such as "
            "charuco:8x6:DICT_5X5_100"
        )
    options = {"dictionary": dictionary} if dictionary else {}
    board = Board(kind=kind, columns=int(columns), rows=int(rows), square_mm=square_mm, **options)  # type: ignore[arg-type]
    if board.kind == "charuco":
        _charuco(board)
    return board


def charuco_pattern(board: Board) -> tuple[np.ndarray, int]:
    """Black pixels of a ChArUco board (h, w), and the side of a square in pixels."""
    charuco = _charuco(board)
    modules = charuco.getDictionary().markerSize + 2
    # a multiple of the modules and of twice 1 / (1 - share), so that modules and margins are whole pixels
    side_px = 2 * modules * round(1.0 / (1.0 - MARKER_SHARE))
    image = charuco.generateImage((board.columns * side_px, board.rows * side_px), marginSize=0)
    return np.asarray(image) < 128, side_px


def find_board(image: np.ndarray, board: Board) -> BoardDetection | None:
    """Find a board in a grey image; None if it is not visible.

    A ChArUco board may be partly hidden (at least six of its corners must be visible); the other kinds
    must be completely visible.
    """
    share = min(1.0, SEARCH_WIDTH_PX / image.shape[1])
    small = (
        image if share == 1.0 else cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
    )
    found = _charuco_corners(small, board) if board.kind == "charuco" else _find_whole_board(small, board)
    if found is None:
        return None
    number, place = found
    place = (place + 0.5) / share - 0.5
    detection = BoardDetection(number=read_only(number), place_px=read_only(place))
    if share < 1.0 and board.has_corners:
        return refine_corners(image, detection, max(3, round(1.5 / share)))
    if share < 1.0:
        whole = _find_whole_board(image, board)
        return (
            None
            if whole is None
            else BoardDetection(number=read_only(whole[0]), place_px=read_only(whole[1]))
        )
    return detection


def refine_corners(image: np.ndarray, detection: BoardDetection, half_window_px: int) -> BoardDetection:
    """Refine corners by the gradients within a window (Foerstner and Guelch, 1987)."""
    place = np.ascontiguousarray(detection.place_px, dtype=np.float32).reshape(-1, 1, 2).copy()
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
    window = (half_window_px, half_window_px)
    moved = cv2.cornerSubPix(image, place, window, (-1, -1), stop)
    return BoardDetection(
        number=detection.number, place_px=read_only(np.asarray(moved, dtype=np.float64).reshape(-1, 2))
    )


def spacing_px(detection: BoardDetection) -> float:
    """Smallest distance of two points, px."""
    from scipy.spatial import KDTree

    distance, _ = KDTree(detection.place_px).query(detection.place_px, k=2)
    return float(distance[:, 1].min())


def _find_whole_board(image: np.ndarray, board: Board) -> tuple[np.ndarray, np.ndarray] | None:
    """Find boards all points of which must be visible."""
    size = (board.columns, board.rows)
    if board.kind == "chessboard":
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
        is_found, place = cv2.findChessboardCorners(image, size, flags=flags)
        if not is_found:
            is_found, place = cv2.findChessboardCornersSB(image, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    else:
        grid = cv2.CALIB_CB_SYMMETRIC_GRID if board.kind == "circles" else cv2.CALIB_CB_ASYMMETRIC_GRID
        detector = _circle_detector(image, board)
        flags = grid | cv2.CALIB_CB_CLUSTERING
        is_found, place = cv2.findCirclesGrid(image, size, flags=flags, blobDetector=detector)
    if not is_found or place is None:
        return None
    place = np.asarray(place, dtype=np.float64).reshape(-1, 2)
    # parts of a larger grid of circles are found with some circles twice
    is_whole = len(np.unique(place, axis=0)) == board.columns * board.rows
    return (np.arange(len(place)), place) if is_whole else None


def _circle_detector(image: np.ndarray, board: Board) -> cv2.SimpleBlobDetector:
    """Detector of blobs of the most frequent size: text next to the board would disturb the grid."""
    blobs = cv2.SimpleBlobDetector.Params()
    blobs.maxArea = max(blobs.maxArea, image.size / (board.columns * board.rows))
    sizes_px = [blob.size for blob in cv2.SimpleBlobDetector.create(blobs).detect(image)]
    if sizes_px:
        blobs.minArea = max(blobs.minArea, 0.2 * float(np.median(sizes_px)) ** 2)
    return cv2.SimpleBlobDetector.create(blobs)


def _charuco_corners(image: np.ndarray, board: Board) -> tuple[np.ndarray, np.ndarray] | None:
    place, number, _, _ = cv2.aruco.CharucoDetector(_charuco(board)).detectBoard(image)
    if place is None or number is None or len(number) < 6:
        return None
    number, place = np.asarray(number).ravel(), np.asarray(place, dtype=np.float64).reshape(-1, 2)
    if np.linalg.matrix_rank(board.point_mm[number, :2] - board.point_mm[number[0], :2]) < 2:
        return None
    return number, place


@lru_cache(maxsize=4)
def _charuco(board: Board) -> cv2.aruco.CharucoBoard:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    needed = board.columns * board.rows // 2
    if needed > len(dictionary.bytesList):
        raise ManytouchError(
            f"the board {board} needs {needed} markers and {board.dictionary} has "
            f"{len(dictionary.bytesList)}: name a larger dictionary, such as "
            f"{board.kind}:{board.columns}x{board.rows}:DICT_5X5_1000"
        )
    side = board.square_mm
    return cv2.aruco.CharucoBoard((board.columns, board.rows), side, MARKER_SHARE * side, dictionary)
