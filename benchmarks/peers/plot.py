"""The medians as bars."""

from pathlib import Path
from typing import TYPE_CHECKING

from rounds import Timing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OWN, PAPER, OTHER, FLOOR = "#1b6ca8", "#b5651d", "#8a8a8a", "#c9c9c9"


def plot(
    timings: dict[str, Timing], file: Path, scaling: list[dict[str, float]] | None, *, title: str
) -> None:
    """Horizontal bars on a logarithmic axis, fastest on top; a tick marks the 99th percentile.

    Next to them, where `scaling` is known, the time over the number of dots.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = sorted(
        ((name, timing) for name, timing in timings.items() if not name.startswith("stage")),
        key=lambda item: item[1].median_cpu_ms,
    )
    wide = 14.5 if scaling else 9.5
    figure = Figure(figsize=(wide, 0.3 * len(rows) + 1.5), layout="constrained")
    FigureCanvasAgg(figure)
    if scaling:
        axes, right = figure.subplots(1, 2, width_ratios=(2, 1))
        _scaled(right, scaling)
    else:
        axes = figure.add_subplot()
    for place, (name, timing) in enumerate(rows):
        ms = timing.median_cpu_ms
        axes.barh(place, ms, color=_colour(name), height=0.72)
        if timing.p99_ms is not None:
            axes.plot([timing.p99_ms] * 2, [place - 0.36, place + 0.36], color="black", linewidth=1.2)
        axes.text(
            0.93 * ms,
            place,
            _label(ms),
            va="center",
            ha="right",
            fontsize=8,
            color=_text_colour(_colour(name)),
        )
    axes.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=8)
    axes.set_xscale("log")
    axes.invert_yaxis()
    fastest_ms = rows[0][1].median_cpu_ms
    axes.set_xlim(0.2 * fastest_ms, 2.0 * max(timing.median_cpu_ms for _, timing in rows))
    axes.set_xlabel("ms of processor time per frame, median (tick: 99th percentile of the time on the wall)")
    axes.set_title(title, fontsize=9)
    axes.grid(axis="x", color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=130)


def _scaled(axes: "Axes", scaling: list[dict[str, float]]) -> None:
    """Lines of tracked frames and frames from nothing for each size of image, and what linear would be."""
    marks = {"480p": "s", "720p": "^", "1440p": "o"}
    for size in dict.fromkeys(row["size"] for row in scaling):
        rows = [row for row in scaling if row["size"] == size]
        dots = [row["dots"] for row in rows]
        for name, line, colour in (("tracked", "-", OWN), ("from_nothing", "--", OTHER)):
            label = f"{size}, {name.replace('_', ' ')}"
            ms = [row[f"{name}_ms"] for row in rows]
            axes.plot(
                dots, ms, line, marker=marks[size], color=colour, label=label, markersize=5, linewidth=1.2
            )
    last = max(scaling, key=lambda row: row["dots"])
    ends = [1040, last["dots"]]
    axes.plot(
        ends, [last["tracked_ms"] * each / ends[1] for each in ends], ":", color="black", label="linear"
    )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("dots")
    axes.set_ylabel("ms of processor time per frame, median")
    axes.set_title("number of dots and size of the image", fontsize=9)
    axes.grid(color="#e4e4e4", linewidth=0.8)
    axes.legend(fontsize=7, frameon=False)
    axes.spines[["top", "right"]].set_visible(False)


def _colour(name: str) -> str:
    if name.startswith("manytouch"):
        return OWN
    if name.startswith("paper"):
        return PAPER
    return FLOOR if name.startswith(("copy", "JPEG")) else OTHER


def _text_colour(colour: str) -> str:
    return "black" if colour == FLOOR else "white"


def _label(ms: float) -> str:
    if ms < 10:
        return f"{ms:.2f}"
    return f"{ms:.1f}" if ms < 100 else f"{ms:.0f}"
