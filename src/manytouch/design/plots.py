"""Plots of a design: maps of the predicted accuracy, and its change with pitch, thickness and stand-off."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manytouch.design.accuracy import (
    FEW_PLACES,
    PredictedAccuracy,
    predicted_accuracy,
    scale_design,
    typical_force_N,
)
from manytouch.design.dimensions import Design
from manytouch.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FACTORS = (0.7, 1.0, 1.4)
DIMENSIONS = ("pitch", "thickness", "stand_off")
COLOURS = ("#0072b2", "#d55e00", "#009e73")


def require_plots() -> None:
    """Check that plots can be drawn.

    Raises:
        MissingExtraError: matplotlib is missing.
    """
    if find_spec("matplotlib") is None:
        raise MissingExtraError("the plot of the predicted accuracy", "matplotlib", "lab")


def draw_accuracy(found: Design, predicted: PredictedAccuracy, path: Path) -> None:
    """Draws maps of the standard deviations of position, depth and force over the area, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure((13.0, 3.6))
    figure.suptitle(
        f"predicted standard deviations for a fingertip of about {np.nanmean(predicted.force_N):.2g} N on "
        f"{found.sensor.name}, {found.material.name}, calibrated\n"
        "computed at the numbers; the other quarters are mirror images",
        fontsize=11,
    )
    maps = (
        ("position, mm", predicted.position_std_mm),
        ("depth, µm", 1e3 * predicted.depth_std_mm),
        ("normal force, %", 100 * predicted.force_std_N / predicted.force_N),
    )
    for axes, (name, values) in zip(figure.subplots(1, 3), maps, strict=True):
        _map(axes, predicted.place_mm, values, name)
    figure.savefig(path, dpi=110)


def draw_tradeoff(found: Design, path: Path, *, on_message: Callable[[str], object] | None = None) -> None:
    """Draws standard deviations against pitch, thickness and stand-off, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure((12.0, 3.8))
    figure.suptitle(
        "change of the accuracy with pitch, thickness and stand-off (middle, two sides and a corner)",
        fontsize=11,
    )
    panels = figure.subplots(1, 3)
    names = ("position, mm", "depth, µm", "normal force, %")
    at_design = _rms(found, {})
    for dimension, colour in zip(DIMENSIONS, COLOURS, strict=True):
        rows = []
        for factor in FACTORS:
            if on_message is not None and factor != 1.0:
                on_message(f"predicting the accuracy at {factor:g} times the {dimension.replace('_', '-')}")
            rows.append(at_design if factor == 1.0 else _rms(found, {dimension: factor}))
        for axes, values, name in zip(panels, np.transpose(rows), names, strict=True):
            label = dimension.replace("_", "-")
            axes.plot(
                FACTORS, values, "o-", color=colour, label=f"{label} ({_designed_value(found, dimension)})"
            )
            axes.set(title=name, xlabel="factor of the designed value", xticks=FACTORS)
    for axes in panels:
        axes.set_ylim(0.0, 1.05 * axes.get_ylim()[1])
    panels[0].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def _rms(found: Design, factors: dict[str, float]) -> tuple[float, float, float]:
    """Standard deviations over a few positions, with some dimensions multiplied by factors."""
    sensor, force_N = scale_design(found, **factors), typical_force_N(found)
    area_mm = found.requirements.area_mm
    return predicted_accuracy(sensor, area_mm=area_mm, force_N=force_N, places=FEW_PLACES).rms


def new_figure(size: tuple[float, float]) -> "Figure":
    """A figure of a size in inches; raises MissingExtraError when matplotlib is not installed."""
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("pictures of a design", "matplotlib", "lab") from None
    return Figure(figsize=size, layout="constrained")


def _designed_value(found: Design, dimension: str) -> str:
    sensor = found.sensor
    assert sensor.layout is not None and sensor.sheet is not None  # noqa: PT018 - a design has both
    sizes = {
        "pitch": float(sensor.layout.pitch_mm[0]),
        "thickness": sensor.sheet.thickness_mm,
        "stand_off": float(sensor.camera.translation_mm[2]),
    }
    return f"{sizes[dimension]:g} mm"


def _map(axes: "Axes", place_mm: np.ndarray, values: np.ndarray, name: str) -> None:
    """Draws a quarter and its mirror images, with the numbers in the quarter."""
    x, y = (np.unique(side) for side in place_mm.T)
    quarter = values.reshape(len(y), len(x))
    whole = np.hstack([quarter[:, :0:-1], quarter])
    whole = np.vstack([whole[:0:-1], whole])
    both = [np.concatenate([-side[:0:-1], side]) for side in (x, y)]
    drawn = axes.pcolormesh(*both, whole, shading="gouraud", cmap="cividis_r", vmin=0.0)
    for (here_x, here_y), value in zip(place_mm, values, strict=True):
        shown = "not found" if np.isnan(value) else f"{value:.0f}" if value >= 10 else f"{value:.2g}"
        axes.text(
            here_x,
            here_y,
            shown,
            ha="center",
            va="center",
            fontsize=8,
            bbox={"fc": "white", "ec": "none", "pad": 1},
        )
    axes.set(title=name, xlabel="x, mm", ylabel="y, mm", aspect="equal")
    axes.use_sticky_edges = False
    axes.margins(0.1)
    axes.invert_yaxis()
    axes.figure.colorbar(drawn, ax=axes, shrink=0.8)
