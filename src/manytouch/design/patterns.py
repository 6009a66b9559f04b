"""Marker patterns and calibration boards as SVG and PDF in true size (extra `plot`)."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manytouch.errors import MissingExtraError, OutputError
from manytouch.values import Sensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MM_PER_INCH = 25.4
MARGIN_MM = 10.0
RULER_MM = 50.0
A4_MM = (297.0, 210.0)


def write_pattern(sensor: Sensor, stem: Path) -> tuple[Path, Path]:
    """The markers of a sensor as they lie on the sheet seen from the camera, with the clamped outline.

    The page is the outline and a margin. Print it at 100 %: the ruler below is 50 mm long.

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
        ground, ink = ("black", "white") if layout.polarity == "light" else ("white", "black")
        half = 0.5 * np.asarray(sheet.size_mm)
        axes.add_patch(
            Rectangle((-half[0], -half[1]), 2 * half[0], 2 * half[1], fc=ground, ec="black", lw=0.3)
        )
        circles = [
            Circle(place, radius)
            for place, radius in zip(layout.rest_mm[shown, :2], layout.radius_mm[shown], strict=True)
        ]
        axes.add_collection(PatchCollection(circles, fc=ink, ec="none"))
        _ruler(axes, -half[0], half[1] + 4.0)

    return _pages(stem, (float(size[0]), float(size[1])), draw)


def write_chessboard(stem: Path, *, columns: int, rows: int, square_mm: float) -> tuple[Path, Path]:
    """A chessboard of inner corners for `calibrate camera`, on an A4 page, lying.

    Raises:
        OutputError: it does not fit the page, or a file cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    width, height = (columns + 1) * square_mm, (rows + 1) * square_mm
    if width > A4_MM[0] - MARGIN_MM or height > A4_MM[1] - 2 * MARGIN_MM:
        raise OutputError(
            f"a chessboard of {columns} x {rows} corners and {square_mm:g} mm is {width:g} x {height:g} mm "
            f"and does not fit an A4 page: take smaller squares or fewer of them"
        )

    def draw(axes: "Axes") -> None:
        from matplotlib.patches import Rectangle

        for column in range(columns + 1):
            for row in range(column % 2, rows + 1, 2):
                corner = (column * square_mm - width / 2, row * square_mm - height / 2)
                axes.add_patch(Rectangle(corner, square_mm, square_mm, fc="black", ec="none"))
        label = f"chessboard:{columns}x{rows}, squares of {square_mm:g} mm"
        axes.text(width / 2, height / 2 + 7.0, label, ha="right", va="center", fontsize=8)
        _ruler(axes, -width / 2, height / 2 + 5.0)

    return _pages(stem, A4_MM, draw)


def _pages(stem: Path, size_mm: tuple[float, float], draw: Callable[["Axes"], None]) -> tuple[Path, Path]:
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("printed patterns", "matplotlib", "plot") from None
    figure = Figure(figsize=(size_mm[0] / MM_PER_INCH, size_mm[1] / MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(-size_mm[0] / 2, size_mm[0] / 2), ylim=(size_mm[1] / 2, -size_mm[1] / 2))
    draw(axes)
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
