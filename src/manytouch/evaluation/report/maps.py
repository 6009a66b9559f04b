"""The report's maps of the sheet: errors of a method, and the worst frames."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from manytouch.evaluation.metrics.comparison import MethodErrors
from manytouch.evaluation.metrics.depth import error_map
from manytouch.evaluation.metrics.worst_frame import WorstFrame
from manytouch.evaluation.report.svg_theme import FAINT, FOREGROUND, SOFT, empty_chart, figure, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CELLS = (14, 20)  # rows, columns
DEPTH_COLOURS, ERROR_COLOURS, SIZE_COLOURS = "cividis", "PuOr_r", "magma"


def error_maps(compared: Mapping[str, MethodErrors]) -> list[str]:
    """For each method where on the sheet it errs: RMS of the depth error, one scale by factors for all."""
    found = {
        method: error_map(one.depth.place, one.depth.error_mm, CELLS) for method, one in compared.items()
    }
    known = np.concatenate([values[values > 0.0] for values in found.values()] or [np.zeros(0)])
    low, high = np.percentile(known, [2, 98]).tolist() if len(known) else (0.1, 1.0)
    limits = (min(low, high / 2), high)
    return [_error_map(method, values, limits, compared[method].unit) for method, values in found.items()]


def _error_map(method: str, values: np.ndarray, limits: tuple[float, float], unit: str) -> str:
    from matplotlib.colors import LogNorm

    with figure(4.7, 3.0) as drawn:
        axes = drawn.add_subplot()
        shown = axes.imshow(
            np.where(values > 0.0, values, np.where(values == 0.0, limits[0], np.nan)),
            norm=LogNorm(*limits, clip=True),
            cmap=SIZE_COLOURS,
            extent=(-1, 1, 1, -1),
            aspect=0.66,
        )
        if not np.isfinite(values).any():
            empty_chart(axes, "no depth is given")
        axes.grid(visible=False)
        axes.set_xticks([-1, 0, 1], ["left rim", "middle", "right rim"])
        axes.set_yticks([-1, 0, 1], ["upper", "middle", "lower"])
        axes.set_title(method)
        _scale(drawn, shown, axes, f"RMS error of depth ({unit})")
        return svg(drawn, f"RMS error of the depth over the sheet, method {method}")


def worst_figure(worst_frame: WorstFrame, unit: str) -> str:
    """Truth, estimate and their difference in one frame, with the contacts."""
    wide, tall = np.maximum(np.ptp(worst_frame.place, axis=0), 1e-9)
    with figure(7.4, float(np.clip(1.15 + 2.45 * tall / wide, 2.3, 4.2))) as drawn:
        panels: Any = drawn.subplots(1, 3, sharex=True, sharey=True)
        both = np.concatenate([worst_frame.true_mm, worst_frame.estimated_mm])
        largest = float(np.nanmax(np.abs(both)))
        error = worst_frame.estimated_mm - worst_frame.true_mm
        worst = float(np.nanmax(np.abs(error))) or 1.0
        _panel(panels[0], worst_frame, worst_frame.true_mm, DEPTH_COLOURS, (0.0, largest))
        first = _panel(panels[1], worst_frame, worst_frame.estimated_mm, DEPTH_COLOURS, (0.0, largest))
        last = _panel(panels[2], worst_frame, error, ERROR_COLOURS, (-worst, worst))
        panels[0].set_title("truth")
        panels[1].set_title("estimate")
        panels[2].set_title("estimate − truth")
        for axes in panels:
            axes.set_xlabel(
                "column" if worst_frame.place_unit == "column" else f"x ({worst_frame.place_unit})"
            )
        panels[0].set_ylabel("row" if worst_frame.place_unit == "column" else f"y ({worst_frame.place_unit})")
        if worst_frame.place_unit == unit:
            _contacts(panels[0], worst_frame.true_contact_mm, worst_frame.is_found, "+")
            _contacts(panels[1], worst_frame.contact_mm, worst_frame.is_right, "x")
        _scale(drawn, first, panels[:2], f"depth ({unit})", below=True)
        _scale(drawn, last, panels[2], f"error ({unit})", below=True)
        return svg(drawn, f"True and estimated depth in frame {worst_frame.frame} of {worst_frame.recording}")


def worst_frames(comparisons: Sequence[MethodErrors], count: int) -> list[WorstFrame]:
    """The worst frames of as many different recordings."""
    worst = [one.worst for one in comparisons if one.worst is not None]
    return sorted(worst, key=lambda worst_frame: -worst_frame.rmse_mm)[:count]


def _panel(
    axes: "Axes", worst_frame: WorstFrame, values: np.ndarray, colours: str, limits: tuple[float, float]
) -> Any:
    """Values at the markers, as cells of a lattice where there is one, else as dots."""
    axes.set_aspect("equal")
    axes.grid(visible=False)
    x, column = np.unique(np.round(worst_frame.place[:, 0], 6), return_inverse=True)
    y, row = np.unique(np.round(worst_frame.place[:, 1], 6), return_inverse=True)
    low, high = limits
    if worst_frame.place_unit == "px" or len(x) * len(y) > 4 * len(values) or min(len(x), len(y)) < 2:
        shown: Any = axes.scatter(
            worst_frame.place[:, 0],
            worst_frame.place[:, 1],
            c=values,
            s=12,
            cmap=colours,
            vmin=low,
            vmax=high,
        )
        if axes.get_ylim()[0] < axes.get_ylim()[1]:
            axes.invert_yaxis()
        return shown
    grid = np.full((len(y), len(x)), np.nan)
    grid[row, column] = values
    half_x, half_y = (x[1] - x[0]) / 2, (y[1] - y[0]) / 2
    extent = (x[0] - half_x, x[-1] + half_x, y[-1] + half_y, y[0] - half_y)
    return axes.imshow(grid, cmap=colours, vmin=low, vmax=high, extent=extent)


def _contacts(axes: "Axes", centre_mm: np.ndarray, is_good: np.ndarray, sign: str) -> None:
    """Rings where contacts are; a cross where one was missed (+) or is false (x)."""
    for chosen, marker, size in ((is_good, "o", 8.0), (~is_good, sign, 8.0)):
        axes.plot(
            *centre_mm[chosen].T, marker, color="black", markersize=size, markerfacecolor="none", mew=2.6
        )
        axes.plot(
            *centre_mm[chosen].T, marker, color="white", markersize=size, markerfacecolor="none", mew=1.3
        )


def _scale(drawn: "Figure", shown: Any, axes: Any, words: str, *, below: bool = False) -> None:
    if below:
        bar = drawn.colorbar(shown, ax=axes, location="bottom", shrink=0.8, aspect=28, pad=0.03)
    else:
        bar = drawn.colorbar(shown, ax=axes, shrink=0.9, aspect=18)
    bar.set_label(words, color=SOFT)
    bar.ax.tick_params(color=FAINT, labelcolor=SOFT)
    bar.outline.set_edgecolor(FOREGROUND)
    bar.outline.set_linewidth(0.4)
