"""The report's curves: each takes methods with their comparisons and gives an <svg> element."""

from collections.abc import Mapping

import numpy as np

from manytouch.evaluation.metrics.comparison import MethodErrors, gates
from manytouch.evaluation.metrics.depth import error_against_depth
from manytouch.evaluation.metrics.separation import RESOLVED_SHARE, separation_curve
from manytouch.evaluation.metrics.uncertainty_calibration import UncertaintyCalibration
from manytouch.evaluation.report.svg_theme import (
    DASHES,
    FAINT,
    FOREGROUND,
    METHOD_COLOURS,
    PAGE_BACKGROUND,
    PLOT_SYMBOLS,
    SOFT,
    empty_chart,
    figure,
    legend,
    svg,
)
from manytouch.evaluation.suite.runner import Trial

Compared = Mapping[str, MethodErrors]


def colour(number: int) -> str:
    """The colour of the method with this number."""
    return METHOD_COLOURS[number % len(METHOD_COLOURS)]


def depth_error_chart(compared: Compared) -> str:
    """Error of single markers against their true depth: median and the middle 80 %."""
    with figure() as drawn:
        axes = drawn.add_subplot()
        unit = next(iter(compared.values())).unit
        axes.axhline(0.0, color=FOREGROUND, linewidth=0.8)
        for number, (method, one) in enumerate(compared.items()):
            curve = error_against_depth(one.depth.true_mm, one.depth.error_mm)
            if not curve["count"]:
                continue
            axes.fill_between(
                curve["depth_mm"],
                curve["p10_mm"],
                curve["p90_mm"],
                color=colour(number),
                alpha=0.12,
                linewidth=0,
            )
            axes.plot(
                curve["depth_mm"],
                curve["median_mm"],
                color=colour(number),
                linestyle=DASHES[number],
                marker=PLOT_SYMBOLS[number],
                markersize=3.5,
                label=method,
            )
        axes.set(xlabel=f"true depth of the marker ({unit})", ylabel=f"estimated − true ({unit})")
        axes.set_title("Error against depth: median and middle 80 %")
        legend(axes, loc="best")
        return svg(drawn, "Error of the depth of single markers against their true depth, for each method")


def rmse_chart(trials: tuple[Trial, ...], methods: tuple[str, ...]) -> str:
    """Depth RMSE of each recording, its median pressed frame, by group."""
    from matplotlib.ticker import LogLocator, NullFormatter

    groups = list(dict.fromkeys("recording" if t.case is None else t.case.group for t in trials))
    with figure() as drawn:
        axes = drawn.add_subplot()
        chance = np.random.default_rng(0)
        unit = trials[0].comparisons[0].unit if trials else "mm"
        for number, method in enumerate(methods):
            points = [
                (groups.index("recording" if t.case is None else t.case.group), float(np.median(rmse)))
                for t in trials
                for one in t.comparisons
                if one.method == method and len(rmse := _known(one.depth.rmse_mm[one.depth.is_pressed]))
            ]
            if points:
                x, y = np.array(points, dtype=np.float64).T
                x = x + 0.7 * ((number + 0.5) / len(methods) - 0.5) + chance.uniform(-0.06, 0.06, len(x))
                axes.plot(
                    x, y, PLOT_SYMBOLS[number], color=colour(number), markersize=4, alpha=0.75, label=method
                )
        axes.set_yscale("log")
        axes.set_xticks(range(len(groups)), groups)
        axes.set_xlim(-0.6, len(groups) - 0.4)
        axes.grid(visible=False, axis="x")
        axes.set(ylabel=f"depth RMSE over the sheet ({unit})")
        axes.set_title("Every recording: its median pressed frame")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        legend(axes, loc="best")
        return svg(drawn, "Depth RMSE of every recording by group and method, logarithmic")


def position_chart(compared: Compared) -> str:
    """Share of the true contacts that are found within a distance: ends at the recall."""
    with figure() as drawn:
        axes = drawn.add_subplot()
        unit = next(iter(compared.values())).unit
        gate_mm = gates(unit)[0]
        for number, (method, one) in enumerate(compared.items()):
            if one.contacts.required == 0:
                continue
            away = np.sort(np.linalg.norm(one.contacts.offset_mm, axis=1))
            share = 100 * np.arange(1, len(away) + 1) / one.contacts.required
            axes.step(
                [0.0, *away, gate_mm],
                [0.0, *share, share[-1] if len(share) else 0.0],
                where="post",
                color=colour(number),
                linestyle=DASHES[number],
                label=method,
            )
        axes.set(xlim=(0, gate_mm), ylim=(0, 102), xlabel=f"within a distance of ({unit})")
        axes.set_ylabel("true contacts found (%)")
        axes.set_title("Contacts found within a distance")
        legend(axes, loc="best")
        return svg(drawn, "Share of the true contacts that are found within a distance, for each method")


def offset_chart(compared: Compared) -> str:
    """Where estimated contacts lie relative to the true ones."""
    with figure() as drawn:
        axes = drawn.add_subplot()
        unit = next(iter(compared.values())).unit
        gate_mm = gates(unit)[0]
        ring = np.linspace(0, 2 * np.pi, 90)
        for radius in (gate_mm / 3, 2 * gate_mm / 3, gate_mm):
            axes.plot(radius * np.cos(ring), radius * np.sin(ring), color=FAINT, linewidth=0.7)
        for number, (method, one) in enumerate(compared.items()):
            offset = one.contacts.offset_mm[:: max(1, len(one.contacts.offset_mm) // 600)]
            if len(offset):
                axes.plot(
                    *offset.T,
                    PLOT_SYMBOLS[number],
                    color=colour(number),
                    markersize=3.5,
                    alpha=0.55,
                    label=method,
                    markeredgewidth=0,
                )
        axes.set(
            aspect="equal", xlim=(-1.05 * gate_mm, 1.05 * gate_mm), ylim=(1.05 * gate_mm, -1.05 * gate_mm)
        )
        axes.set(xlabel=f"error along x ({unit})", ylabel=f"error along y ({unit})")
        axes.set_title(f"Position errors; outer ring: the gate of {gate_mm:g} {unit}")
        legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return svg(drawn, "Errors of the positions of contacts along x and y, for each method")


def force_chart(compared: Compared) -> str:
    """Estimated against true normal force."""
    with figure() as drawn:
        axes = drawn.add_subplot()
        largest = 0.0  # N, of the axes
        for number, (method, one) in enumerate(compared.items()):
            true, estimated = one.contacts.true_force_N, one.contacts.force_N
            both = np.isfinite(true) & np.isfinite(estimated)
            if both.any():
                axes.plot(
                    true[both],
                    estimated[both],
                    PLOT_SYMBOLS[number],
                    color=colour(number),
                    markersize=3.5,
                    alpha=0.6,
                    label=method,
                    markeredgewidth=0,
                )
                largest = max(largest, float(true[both].max()), float(estimated[both].max()))
        axes.plot([0, largest], [0, largest], color=FOREGROUND, linewidth=0.8)
        axes.set(xlabel="true normal force (N)", ylabel="estimated (N)")
        axes.set_title("Normal force of the contacts that were found")
        legend(axes, loc="best")
        return svg(drawn, "Estimated against true normal force, for each method")


def separation_chart(compared: Compared, ratio: float) -> str:
    """Share of frames in which two contacts are resolved against their distance."""
    with figure() as drawn:
        axes = drawn.add_subplot()
        unit = next(iter(compared.values())).unit
        axes.axhline(100 * RESOLVED_SHARE, color=SOFT, linewidth=0.9, linestyle=(0, (2, 2)))
        is_empty = True
        for number, (method, one) in enumerate(compared.items()):
            curve = separation_curve(one.separation, ratio)
            if not curve.frames:
                continue
            is_empty = False
            axes.plot(
                curve.distance_mm,
                100 * np.array(curve.share),
                color=colour(number),
                linestyle=DASHES[number],
                marker=PLOT_SYMBOLS[number],
                markersize=4.5,
                label=method,
            )
        if is_empty:
            empty_chart(axes, "no frame with two such contacts")
        axes.set(
            ylim=(-4, 104), xlabel=f"distance of the two contacts ({unit})", ylabel="resolved (% of frames)"
        )
        axes.set_xlim(left=0)
        axes.set_title(f"Two contacts, forces 1 : {ratio:g}")
        legend(axes, loc="best")
        return svg(drawn, f"Share of frames in which two contacts of force ratio 1 to {ratio:g} are resolved")


def reliability_chart(found: Mapping[str, Mapping[str, UncertaintyCalibration | None]], quantity: str) -> str:
    """Observed against promised coverage: below the diagonal is overconfident."""
    with figure(4.0, 3.4) as drawn:
        axes = drawn.add_subplot()
        axes.plot([0, 100], [0, 100], color=FOREGROUND, linewidth=0.8)
        for number, (method, curves) in enumerate(found.items()):
            curve = curves[quantity]
            if curve is None:
                continue
            axes.plot(
                100 * np.array(curve.levels),
                100 * np.array(curve.coverage),
                color=colour(number),
                linestyle=DASHES[number],
                marker=PLOT_SYMBOLS[number],
                markersize=3.5,
                label=method,
            )
        axes.text(97, 34, "overconfident", ha="right", color=SOFT, fontsize=8)
        axes.text(3, 93, "too cautious", color=SOFT, fontsize=8)
        axes.set(xlim=(0, 100), ylim=(0, 100), aspect="equal")
        axes.set(xlabel="promised interval (%)", ylabel="errors inside it (%)")
        axes.set_title(quantity.capitalize())
        legend(axes, loc="lower right", bbox_to_anchor=(1.02, 0.12))
        return svg(drawn, f"Observed against promised coverage of the {quantity}, for each method")


def latency_chart(compared: Compared) -> str:
    """Distribution of the time per frame: 1 to 99 %, 25 to 75 %, median."""
    from matplotlib.ticker import LogLocator, NullFormatter

    with figure(9.6, 0.9 + 0.42 * len(compared)) as drawn:
        axes = drawn.add_subplot()
        is_empty = True
        for number, (_, one) in enumerate(compared.items()):
            known = _known(one.milliseconds)
            if not len(known):
                continue
            is_empty = False
            low, begin, middle, end, high = np.percentile(known, [1, 25, 50, 75, 99])
            axes.plot([low, high], [number] * 2, color=colour(number), linewidth=2.0)
            axes.plot([begin, end], [number] * 2, color=colour(number), linewidth=9.0, solid_capstyle="butt")
            axes.plot(middle, number, "|", color=PAGE_BACKGROUND, markersize=9, markeredgewidth=2.0)
        axes.set_yticks(range(len(compared)), list(compared))
        axes.set_ylim(len(compared) - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
        if is_empty:
            empty_chart(axes, "no times in frames.csv")
        else:
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.axvline(1000 / 30, color=SOFT, linewidth=0.9, linestyle=(0, (2, 2)))
            axes.text(1000 / 30, -0.55, " 30 frames per second", color=SOFT, fontsize=8, va="top")
        axes.set_xlabel("milliseconds per frame (thin: 1 to 99 %, thick: 25 to 75 %, mark: median)")
        return svg(drawn, "Time per frame of each method")


def _known(values: np.ndarray) -> np.ndarray:
    known: np.ndarray = values[np.isfinite(values)]
    return known
