"""Pictures of a design: where it will be how accurate, and what other measures would cost or gain."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manytouch.design.accuracy import (
    FEW_PLACES,
    PredictedAccuracy,
    changed,
    predicted_accuracy,
    usual_force_N,
)
from manytouch.design.choose import Design
from manytouch.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FACTORS = (0.7, 1.0, 1.4)
MEASURES = ("pitch", "thickness", "stand_off")
COLOURS = ("#0072b2", "#d55e00", "#009e73")


def draw_accuracy(found: Design, predicted: PredictedAccuracy, path: Path) -> None:
    """Maps of the deviations of position, depth and force over the area, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = _figure((13.0, 3.6))
    figure.suptitle(
        f"predicted deviations of a fingertip of about {np.nanmean(predicted.force_N):.2g} N on "
        f"{found.sensor.name}, {found.material.name}, calibrated\n"
        "pressed where the numbers stand; the other quarters are its mirror images",
        fontsize=11,
    )
    maps = (
        ("position, mm", predicted.position_std_mm),
        ("depth, µm", 1e3 * predicted.depth_std_mm),
        ("normal force, % of it", 100 * predicted.force_std_N / predicted.force_N),
    )
    for axes, (name, values) in zip(figure.subplots(1, 3), maps, strict=True):
        _map(axes, predicted.place_mm, values, name)
    figure.savefig(path, dpi=110)


def draw_tradeoff(found: Design, path: Path, *, say: Callable[[str], object] | None = None) -> None:
    """Deviations of presses in middle, sides and corner against pitch, thickness and stand-off, as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = _figure((12.0, 3.8))
    figure.suptitle(
        "what another pitch, thickness or stand-off would cost or gain (middle, two sides and a corner)",
        fontsize=11,
    )
    panels = figure.subplots(1, 3)
    names = ("position, mm", "depth, µm", "normal force, % of it")
    as_designed = _usual(found, {})
    for measure, colour in zip(MEASURES, COLOURS, strict=True):
        rows = []
        for factor in FACTORS:
            if say is not None and factor != 1.0:
                say(f"trying {factor:g} times the {measure.replace('_', '-')}")
            rows.append(as_designed if factor == 1.0 else _usual(found, {measure: factor}))
        for axes, values, name in zip(panels, np.transpose(rows), names, strict=True):
            label = measure.replace("_", "-")
            axes.plot(FACTORS, values, "o-", color=colour, label=f"{label} ({_now(found, measure)})")
            axes.set(title=name, xlabel="times as large as designed", xticks=FACTORS)
    for axes in panels:
        axes.set_ylim(0.0, 1.05 * axes.get_ylim()[1])
    panels[0].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def _usual(found: Design, factors: dict[str, float]) -> tuple[float, float, float]:
    """Deviations with some measures a factor larger, over a few places."""
    sensor, force_N = changed(found, **factors), usual_force_N(found)
    wished = found.wishes.area_mm
    return predicted_accuracy(sensor, area_mm=wished, force_N=force_N, places=FEW_PLACES).usual


def _figure(size: tuple[float, float]) -> "Figure":
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("pictures of a design", "matplotlib", "plot") from None
    return Figure(figsize=size, layout="constrained")


def _now(found: Design, measure: str) -> str:
    sensor = found.sensor
    assert sensor.layout is not None and sensor.sheet is not None  # noqa: PT018 - a design has both
    sizes = {
        "pitch": float(sensor.layout.pitch_mm[0]),
        "thickness": sensor.sheet.thickness_mm,
        "stand_off": float(sensor.camera.translation_mm[2]),
    }
    return f"{sizes[measure]:g} mm"


def _map(axes: "Axes", place_mm: np.ndarray, values: np.ndarray, name: str) -> None:
    """A quarter and its mirror images, with the numbers written in the quarter."""
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
