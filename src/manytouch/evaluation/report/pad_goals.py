"""The figures of bonded pads next to their goals, with true, nominal and calibrated sensor files."""

import math
from collections.abc import Iterator
from typing import Any

from manytouch.evaluation.metrics.comparison import figures
from manytouch.evaluation.metrics.metric_specs import METRICS, MetricSpec, metric_value, written
from manytouch.evaluation.report.report_data import part
from manytouch.evaluation.suite.cases import HOLD_FRAMES, PAD_GROUPS
from manytouch.evaluation.suite.runner import Evaluation

Goals = dict[tuple[str, str], float]
"""Limits by section and key of the metric."""


def _goals(*, normal_median_percent: float, normal_p95_percent: float) -> Goals:
    return {
        ("contacts", "precision_percent"): 97.0,
        ("contacts", "recall_percent"): 95.0,
        ("contacts", "position_median_mm"): 0.25,
        ("force", "normal_median_percent"): normal_median_percent,
        ("force", "normal_p95_percent"): normal_p95_percent,
        ("force", "friction_shear_median_percent"): 8.0,
        ("force", "friction_shear_angle_median_deg"): 6.0,
        ("depth", "rmse_of_peak_percent"): 6.0,
        ("calibration", "force.coverage_95"): 0.95,
    }


_EXACT = _goals(normal_median_percent=6.0, normal_p95_percent=18.0)
GOALS = {
    "pads": _EXACT,
    "pads_nominal": _goals(normal_median_percent=12.0, normal_p95_percent=35.0),
    "pads_calibrated": _EXACT,
    "pads_calculix": _EXACT,
}
"""At most, or at least where more is better; the share of the 95 % interval within its binomial band."""
WORDS = {
    "pads": "bonded pads, true sensor file",
    "pads_nominal": "bonded pads, nominal sensor file",
    "pads_calibrated": "bonded pads, calibrated sensors",
    "pads_calculix": "bonded pads solved by CalculiX",
}


def goal_rows(evaluation: Evaluation) -> list[dict[str, Any]]:
    """A row for each goal of the groups that were run: part, label, goal, cells (text, reached) by method."""
    rows = []
    for name in PAD_GROUPS:
        parts = [part(evaluation, method, name) for method in evaluation.methods]
        everything = [None if one is None else figures(one) for one in parts]
        if any(everything):
            rows += [
                {"part": WORDS[name], "label": metric.label, "goal": goal, "cells": cells}
                for metric, goal, cells in _metrics(name, everything)
            ]
    return rows


def goal_sentences(evaluation: Evaluation) -> list[str]:
    """A line for each group of pads and each method that gives forces: figures, and goals in brackets."""
    sentences = []
    for name in PAD_GROUPS:
        for method in evaluation.methods:
            one = part(evaluation, method, name)
            everything = None if one is None else figures(one)
            if everything is None or not math.isfinite(everything["force"]["normal_median_percent"]):
                continue
            texts = [
                f"{metric.label} {cells[0][0]} ({goal})"
                for metric, goal, cells in _metrics(name, [everything])
            ]
            sentences.append(f"{WORDS[name]}, {method}: {', '.join(texts)}")
    return sentences


def _metrics(
    name: str, everything: list[dict[str, Any] | None]
) -> Iterator[tuple[MetricSpec, str, list[tuple[str, bool]]]]:
    """Each goal of a group: its metric, the goal in words, and a figure and whether it is reached."""
    for (section, key), limit in GOALS[name].items():
        metric = next(each for each in METRICS if (each.section, each.key) == (section, key))
        cells, presses = [], 1
        for one in everything:
            value = math.nan if one is None else metric_value(metric, one)
            presses = presses if one is None else max(int(one["contacts"]["true"]) // HOLD_FRAMES, 1)
            cells.append((written(metric, value), _is_reached(metric, value, limit, presses)))
        if metric.unit == "share":
            goal = f"goal {100 * limit:g} ± {100 * _band(limit, presses):.0f} %"
        else:
            goal = f"goal {'≥' if _is_more_better(metric) else '≤'} {limit:g} {metric.unit}"
        yield metric, goal, cells


def _is_reached(metric: MetricSpec, value: float, limit: float, presses: int) -> bool:
    if metric.unit == "share":
        return abs(value - limit) <= _band(limit, presses)
    return value >= limit if _is_more_better(metric) else value <= limit


def _is_more_better(metric: MetricSpec) -> bool:
    return metric.good is not None and metric.poor is not None and metric.good > metric.poor


def _band(share: float, count: int) -> float:
    """Two standard deviations of a share among so many presses; the frames of a press are one."""
    return 2.0 * math.sqrt(share * (1.0 - share) / count)
