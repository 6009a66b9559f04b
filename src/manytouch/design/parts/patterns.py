"""Marker patterns and calibration boards as SVG and PDF in true size (extra `parts`)."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manytouch.calibration.camera.board import Board, charuco_pattern
from manytouch.errors import MissingExtraError, OutputError
from manytouch.values import Sensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

MM_PER_INCH = 25.4
MARGIN_MM = 10.0
RULER_MM = 50.0
A4_MM = (297.0, 210.0)
CIRCLE_SHARE = 0.3  # radius of a circle over the distance of two


def write_marker_pattern(sensor: Sensor, stem: Path) -> tuple[Path, Path]:
    """Writes the markers of a sensor as viewed by the camera, with the clamped outline.

    The page is the outline with a margin. It must be printed at 100 %: its ruler is 50 mm long.

    Raises:
        OutputError: a file cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    sheet, layout = sensor.sheet, sensor.layout
    assert sheet is not None and layout is not None  # noqa: PT018 - a design has both
    size = np.asarray(sheet.size_mm) + 2 * MARGIN_MM

    def draw(axes: "Axes") -> None:
        from matplotlib.collections import PatchCollection
        from matplotlib.patches import Circle, Rectangle

        shown = ~layout.is_missing
        background, colour = ("black", "white") if layout.polarity == "light" else ("white", "black")
        half = 0.5 * np.asarray(sheet.size_mm)
        axes.add_patch(
            Rectangle((-half[0], -half[1]), 2 * half[0], 2 * half[1], fc=background, ec="black", lw=0.3)
        )
        circles = [
            Circle(place, radius)
            for place, radius in zip(layout.rest_mm[shown, :2], layout.radius_mm[shown], strict=True)
        ]
        axes.add_collection(PatchCollection(circles, fc=colour, ec="none"))
        _ruler(axes, -half[0], half[1] + 4.0)

    return _save(_page((float(size[0]), float(size[1])), draw), stem)


def write_board(board: Board, stem: Path) -> tuple[Path, Path]:
    """Writes a board for `calibrate camera` on an A4 page in landscape format.

    Raises:
        OutputError: the board does not fit the page, or a file cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    return _save(board_page(board), stem)


def board_page(board: Board) -> "Figure":
    """The page of `write_board`.

    Raises:
        OutputError: the board does not fit the page.
        MissingExtraError: matplotlib is not installed.
    """
    side = board.square_mm
    beyond = 2 * side if board.has_corners else side
    size = np.ptp(board.point_mm[:, :2], axis=0) + beyond
    if size[0] > A4_MM[0] - MARGIN_MM or size[1] > A4_MM[1] - 2 * MARGIN_MM:
        raise OutputError(
            f"the board {board} with {side:g} mm is {size[0]:g} x {size[1]:g} mm and does not fit "
            "an A4 page: use smaller squares or fewer of them"
        )

    def draw(axes: "Axes") -> None:
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path as Outline

        # One path, because patches that are filled one by one are printed with a hairline between them.
        outlines = [
            patch.get_patch_transform().transform_path(patch.get_path())
            for patch in _black_patches(board, -0.5 * size)
        ]
        axes.add_patch(PathPatch(Outline.make_compound_path(*outlines), fc="black", ec="none"))
        label = f"{board}, {'squares' if board.has_corners else 'distance'} of {side:g} mm"
        axes.text(-size[0] / 2, -size[1] / 2 - 4.0, label, ha="left", va="center", fontsize=8)
        _ruler(axes, -size[0] / 2, size[1] / 2 + 5.0)

    return _page(A4_MM, draw)


def _black_patches(board: Board, corner_mm: np.ndarray) -> "list[Patch]":
    """The black areas of a board whose first corner is at `corner_mm`."""
    from matplotlib.patches import Circle, Rectangle

    side = board.square_mm
    if not board.has_corners:
        places = corner_mm + 0.5 * side + board.point_mm[:, :2]
        return [Circle((x, y), CIRCLE_SHARE * side) for x, y in places]
    if board.kind == "charuco":
        is_black, side_px = charuco_pattern(board)
    else:
        is_black, side_px = np.indices((board.rows + 1, board.columns + 1)).sum(axis=0) % 2 == 0, 1
    cuts = np.flatnonzero(np.any(np.diff(is_black, axis=0), axis=1)) + 1
    patches: list[Patch] = []
    for top, bottom in pairwise([0, *cuts, len(is_black)]):
        change = np.flatnonzero(np.diff(is_black[top], prepend=False, append=False))
        for left, right in change.reshape(-1, 2):
            low, high = np.array([[left, top], [right, bottom]]) * side / side_px
            patches.append(Rectangle((corner_mm + low).tolist(), *(high - low).tolist()))
    return patches


def _page(size_mm: tuple[float, float], draw: Callable[["Axes"], None]) -> "Figure":
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("printed patterns", "matplotlib", "parts") from None
    figure = Figure(figsize=(size_mm[0] / MM_PER_INCH, size_mm[1] / MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(-size_mm[0] / 2, size_mm[0] / 2), ylim=(size_mm[1] / 2, -size_mm[1] / 2))
    draw(axes)
    return figure


def _save(figure: "Figure", stem: Path) -> tuple[Path, Path]:
    from matplotlib import rc_context

    paths = (stem.with_suffix(".svg"), stem.with_suffix(".pdf"))
    try:
        with rc_context({"svg.hashsalt": stem.name, "pdf.compression": 0}):
            figure.savefig(paths[0], metadata={"Date": None})
            figure.savefig(paths[1], metadata={"CreationDate": None})
    except OSError as error:
        raise OutputError(f"cannot write {stem}: {error.strerror}") from None
    return paths


def _ruler(axes: "Axes", x_mm: float, y_mm: float) -> None:
    axes.plot([x_mm, x_mm + RULER_MM], [y_mm, y_mm], color="black", lw=0.6, solid_capstyle="butt")
    for place in np.arange(0.0, RULER_MM + 1.0, 10.0):
        axes.plot([x_mm + place] * 2, [y_mm - 1.0, y_mm + 1.0], color="black", lw=0.6, solid_capstyle="butt")
    axes.text(x_mm + RULER_MM + 2.0, y_mm, f"{RULER_MM:g} mm", va="center", fontsize=8)
