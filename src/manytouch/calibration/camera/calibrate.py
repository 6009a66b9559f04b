"""A camera calibrated from pictures of a board: choose views, refine corners, fit, drop what does not fit."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from manytouch.calibration.camera.board import Board, board_of, find_board, refined, spacing_px
from manytouch.calibration.camera.board_views import PARTS, BoardView, ViewCollection, grey, part_of
from manytouch.calibration.camera.intrinsics import LEAST_VIEWS, Intrinsics, Model, fit_intrinsics
from manytouch.errors import ManytouchError
from manytouch.values import Frame

HALF_WINDOWS_PX = (3, 4, 5, 6, 8, 10, 13, 16)
"""Corners are refined in windows of these halves; the one with the least residual is kept."""
_WINDOW_SHARE = 0.42  # of the distance to the next corner, which must not be in the window
_OUTLIER = 2.5
_OUTLIER_PX = 0.3
_NAMED_WITHOUT_BOARD = 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CameraCalibration:
    """A calibrated camera with all that tells how far to trust it.

    Attributes:
        board: what was looked at.
        intrinsics: the result.
        views: used, in the order of `intrinsics.residual_px`.
        refused: name of the picture and reason.
        half_window_px: in which corners were refined; None for circles.
        missing: what further views should show.
    """

    board: Board
    intrinsics: Intrinsics
    views: tuple[BoardView, ...]
    refused: tuple[tuple[str, str], ...]
    half_window_px: int | None
    missing: tuple[str, ...]

    @property
    def part_rms_px(self) -> np.ndarray:
        """(9,) residual in each part of the picture (`PARTS`), NaN where no point lies."""
        camera = self.intrinsics.camera
        place = np.concatenate([view.sighting.place_px for view in self.views])
        square = (np.concatenate(self.intrinsics.residual_px) ** 2).sum(axis=1)
        part = part_of(place, (camera.width_px, camera.height_px))
        counts = np.bincount(part, minlength=len(PARTS))
        sums = np.bincount(part, weights=square, minlength=len(PARTS))
        return np.where(counts > 0, np.sqrt(sums / np.maximum(counts, 1)), np.nan)


def calibrate_camera(
    frames: Iterable[tuple[str, Frame]],
    board: Board,
    *,
    model: Model = "pinhole",
    look: Callable[[ViewCollection, str | None], bool] | None = None,
) -> CameraCalibration:
    """Calibrate a camera.

    Args:
        frames: pictures with their names.
        board: what they show.
        model: of the lens.
        look: called after each picture with all views so far and the reason why this one was refused;
            once it says True no more pictures are taken.

    Raises:
        ManytouchError: no board, too few good views, or no camera explains them; it says what to do.
    """
    collection = ViewCollection(board=board)
    first_without: list[Frame] = []
    for name, frame in frames:
        reason = collection.offer(frame, name)
        if reason is not None and len(first_without) < _NAMED_WITHOUT_BOARD:
            first_without.append(frame)
        if look is not None and look(collection, reason):
            break
    if len(collection.views) < LEAST_VIEWS:
        raise ManytouchError(_too_few(collection, first_without))
    intrinsics, views, half_px, dropped = _fitted(collection, model)
    return CameraCalibration(
        board=board,
        intrinsics=intrinsics,
        views=views,
        refused=(*collection.refused, *dropped),
        half_window_px=half_px,
        missing=collection.missing(),
    )


def _fitted(
    collection: ViewCollection, model: Model
) -> tuple[Intrinsics, tuple[BoardView, ...], int | None, list[tuple[str, str]]]:
    views = tuple(collection.views)
    dropped: list[tuple[str, str]] = []
    while True:
        intrinsics, views, half_px = _best_window(collection, views, model)
        rms = intrinsics.view_rms_px
        usual, worst = float(np.median(rms)), int(np.argmax(rms))
        if rms[worst] < max(_OUTLIER * usual, usual + _OUTLIER_PX) or len(views) <= LEAST_VIEWS:
            return intrinsics, views, half_px, dropped
        dropped.append(
            (
                views[worst].name,
                f"does not fit the others: {rms[worst]:.2f} px against {usual:.2f} px (moved or bent?)",
            )
        )
        views = views[:worst] + views[worst + 1 :]


def _best_window(
    collection: ViewCollection, views: tuple[BoardView, ...], model: Model
) -> tuple[Intrinsics, tuple[BoardView, ...], int | None]:
    """The fit with the least residual over the windows in which corners can be refined."""
    assert collection.size_px is not None
    board, (width_px, height_px) = collection.board, collection.size_px

    def fit(used: tuple[BoardView, ...]) -> Intrinsics:
        sightings = [view.sighting for view in used]
        return fit_intrinsics(board, sightings, width_px=width_px, height_px=height_px, model=model)

    if not board.has_corners:
        return fit(views), views, None
    found = []
    most_px = max(_WINDOW_SHARE * spacing_px(view.sighting) for view in views)
    for half_px in [half for half in HALF_WINDOWS_PX if half <= max(most_px, HALF_WINDOWS_PX[0])]:
        sharper = tuple(_with_window(view, half_px) for view in views)
        found.append((fit(sharper), sharper, half_px))
    return min(found, key=lambda item: item[0].rms_px)


def _with_window(view: BoardView, half_px: int) -> BoardView:
    from dataclasses import replace

    room_px = max(2, int(_WINDOW_SHARE * spacing_px(view.sighting)))
    return replace(view, sighting=refined(view.image, view.sighting, min(half_px, room_px)))


def _too_few(collection: ViewCollection, without: list[Frame]) -> str:
    board, number = collection.board, len(collection.views)
    reasons = [reason for _, reason in collection.refused]
    if not reasons and not number:
        return "there is no picture: give views of a board, a video or a camera that shows it"
    if number == 0 and all(reason.startswith("shows no whole") for reason in reasons):
        other = _other_size(board, without)
        hint = (
            f"they show a {other}, so give --board {other}"
            if other is not None
            else "see that the whole board is in the picture, flat, sharp and evenly lit, and that kind "
            "and size are named right (a chessboard by its inner corners, one less than squares)"
        )
        return f"none of the {len(reasons)} pictures shows a {board}: {hint}"
    blurred = sum(reason.startswith("is blurred") for reason in reasons)
    hint = (
        f"{blurred} of {number + len(reasons)} pictures are blurred: focus the lens, hold board and camera "
        "still, give more light; "
        if 2 * blurred > len(reasons)
        else ""
    )
    lines = "; ".join(f"{name} {reason}" for name, reason in collection.refused[:5])
    more = f"; and {len(reasons) - 5} more" if len(reasons) > 5 else ""
    return (
        f"{hint}only {number} good view{'s' * (number != 1)} of the {board}, at least {LEAST_VIEWS} are "
        f"needed, better 15, with the board tilted in different directions, near and far, and in every corner"
        + (f" (refused: {lines}{more})" if lines else "")
    )


def _other_size(board: Board, frames: list[Frame]) -> str | None:
    """A chessboard of another size near the one that was named, if that is what the pictures show."""
    if board.kind != "chessboard":
        return None
    tried = [
        (board.columns + dx, board.rows + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)
    ]
    for columns, rows in [size for size in tried if min(size) >= 3]:
        other = board_of(f"chessboard:{columns}x{rows}", board.square_mm)
        for frame in frames:
            if frame.image is not None and find_board(grey(frame.image), other) is not None:
                return str(other)
    return None
