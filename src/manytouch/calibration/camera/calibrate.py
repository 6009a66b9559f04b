"""Camera calibration from images of a board: select views, refine corners, fit, reject outliers."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from manytouch.calibration.camera.board import Board, refine_corners, spacing_px
from manytouch.calibration.camera.board_views import PARTS, BoardView, ViewCollection, grey, part_of
from manytouch.calibration.camera.intrinsics import LEAST_VIEWS, Intrinsics, Model, fit_intrinsics
from manytouch.calibration.camera.larger_board import chessboard_in, larger_board
from manytouch.errors import ManytouchError
from manytouch.values import Frame

HALF_WINDOWS_PX = (3, 4, 5, 6, 8, 10, 13, 16)
"""Half widths of the windows in which corners are refined; the one with the smallest residual is kept."""
_WINDOW_SHARE = 0.42  # of the distance to the next corner, which must not be in the window
_OUTLIER = 2.5
_OUTLIER_PX = 0.3
_NAMED_WITHOUT_BOARD = 3
_LEAST_LARGER = 3  # views that show a larger board than stated, so that an error of one has no effect


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CameraCalibration:
    """A calibrated camera with its residuals and the views used.

    Attributes:
        board: in the views.
        intrinsics: the result.
        views: used, in the order of `intrinsics.residual_px`.
        refused: name of the image and reason.
        half_window_px: half width of the window in which corners were refined; None for circles.
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
        """(9,) RMS residual in each part of the image (`PARTS`); NaN without points."""
        camera = self.intrinsics.camera
        place = np.concatenate([view.detection.place_px for view in self.views])
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
    on_view: Callable[[ViewCollection, str | None], bool] | None = None,
) -> CameraCalibration:
    """Calibrate a camera.

    Args:
        frames: images with their names.
        board: in the images.
        model: of the lens.
        on_view: called after each image with all views so far and the reason for a rejection; capture ends
            when it returns True.

    Raises:
        ManytouchError: no board was found, the views show a larger one, too few were accepted, or no camera
            fits them.
    """
    collection = ViewCollection(board=board)
    first_without: list[Frame] = []
    larger: list[Board | None] = []
    for name, frame in frames:
        reason = collection.add(frame, name)
        if reason is None and frame.image is not None:
            view = collection.views[-1]
            larger.append(larger_board(view.image, view.detection, board))
            _require_whole(board, larger)
        if reason is not None and len(first_without) < _NAMED_WITHOUT_BOARD:
            first_without.append(frame)
        if on_view is not None and on_view(collection, reason):
            break
    if len(collection.views) < LEAST_VIEWS:
        _require_whole(board, larger, least=1)
        raise ManytouchError(_too_few_views_message(collection, first_without))
    intrinsics, views, half_px, dropped = _fit(collection, model)
    return CameraCalibration(
        board=board,
        intrinsics=intrinsics,
        views=views,
        refused=(*collection.refused, *dropped),
        half_window_px=half_px,
        missing=collection.missing(),
    )


def _require_whole(board: Board, larger: list[Board | None], least: int = _LEAST_LARGER) -> None:
    """Check that views show the stated board and not a larger one.

    Args:
        board: as stated.
        larger: of each view, what it shows instead, if anything.
        least: number of views that count as evidence.

    Raises:
        ManytouchError: most of them, and at least `least`, show the same larger board.
    """
    other, count = Counter(larger).most_common(1)[0] if larger else (None, 0)
    if other is not None and count >= least and 2 * count > len(larger):
        inner = " (inner corners, one less than squares)" if board.kind == "chessboard" else ""
        raise ManytouchError(
            f"{count} of the first {len(larger)} good views show a {other}, of which the given {board} is "
            f"only a part: give --board {other}{inner}, and check --square-mm"
        )


def _fit(
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
    """The fit with the smallest residual over the corner windows."""
    assert collection.size_px is not None
    board, (width_px, height_px) = collection.board, collection.size_px

    def fit(used: tuple[BoardView, ...]) -> Intrinsics:
        detections = [view.detection for view in used]
        return fit_intrinsics(board, detections, width_px=width_px, height_px=height_px, model=model)

    if not board.has_corners:
        return fit(views), views, None
    found = []
    most_px = max(_WINDOW_SHARE * spacing_px(view.detection) for view in views)
    for half_px in [half for half in HALF_WINDOWS_PX if half <= max(most_px, HALF_WINDOWS_PX[0])]:
        sharper = tuple(_with_window(view, half_px) for view in views)
        found.append((fit(sharper), sharper, half_px))
    return min(found, key=lambda item: item[0].rms_px)


def _with_window(view: BoardView, half_px: int) -> BoardView:
    from dataclasses import replace

    room_px = max(2, int(_WINDOW_SHARE * spacing_px(view.detection)))
    return replace(view, detection=refine_corners(view.image, view.detection, min(half_px, room_px)))


def _too_few_views_message(collection: ViewCollection, without: list[Frame]) -> str:
    board, number = collection.board, len(collection.views)
    reasons = [reason for _, reason in collection.refused]
    if not reasons and not number:
        return "no image was given: give views of a board, a video or a camera"
    if number == 0 and all(reason.startswith("does not show a complete") for reason in reasons):
        other = _other_size(board, without)
        hint = (
            f"they show a {other}: give --board {other}"
            if other is not None
            else "check that the complete board is visible, flat, sharp and evenly lit, and that kind and "
            "size are correct (a chessboard by its inner corners, one less than squares)"
        )
        return f"none of the {len(reasons)} images shows a {board}: {hint}"
    blurred = sum(reason.startswith("is blurred") for reason in reasons)
    hint = (
        f"{blurred} of {number + len(reasons)} images are blurred: focus the lens, keep board and camera "
        "still, increase the light; "
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


def _other_size(board: Board, frames: list[Frame]) -> Board | None:
    """A chessboard of another size, if the images show one."""
    if board.kind != "chessboard":
        return None
    other = chessboard_in([grey(frame.image) for frame in frames if frame.image is not None], board)
    return None if other == board else other
