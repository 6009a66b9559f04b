"""An evaluation as plain numbers: the content of report.json and of the page."""

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from manytouch.evaluation.metrics.comparison import (
    MethodErrors,
    curves,
    figures,
    pooled,
    uncertainty_calibrations,
)
from manytouch.evaluation.metrics.metric_specs import METRICS, metric_value, rating, written
from manytouch.evaluation.report.goals import goal_table
from manytouch.evaluation.suite.cases import PAD_GROUPS
from manytouch.evaluation.suite.runner import Evaluation, Trial

SCHEMA = 1
APART = ("drawn", "calibrated", *PAD_GROUPS)
"""Groups whose figures stand in no other part."""
PARTS = ("all", "nominal", "separation", "stress", "varied", "looked_at", "held_out", *APART)


def contents(evaluation: Evaluation) -> dict[str, Any]:
    """Everything in numbers and words; None where a figure is not given."""
    whole = {method: part(evaluation, method) for method in evaluation.methods}
    data: dict[str, Any] = plain(
        {
            "schema": SCHEMA,
            "title": evaluation.title,
            "truth": evaluation.truth_description,
            "warnings": list(evaluation.warnings),
            "unit": unit_of(evaluation),
            "methods": list(evaluation.methods),
            "recordings": len(evaluation.trials),
            "seconds": evaluation.seconds,
            "figures": {method: _parts(evaluation, method) for method in evaluation.methods},
            "curves": {method: curves(one) for method, one in whole.items() if one is not None},
            "promised": _promised(whole.values()),
            "verdicts": {method: _ratings(one) for method, one in whole.items() if one is not None},
            "cases": [_case(trial) for trial in evaluation.trials],
            "left_out": dict(evaluation.left_out),
            "goals": [asdict(row) for row in goal_table(evaluation)],
            "notes": {method: list(one.notes) for method, one in whole.items() if one is not None},
            "settings": dict(evaluation.settings),
        }
    )
    return data


def part(evaluation: Evaluation, method: str, name: str = "all") -> MethodErrors | None:
    """A method's errors on one of `PARTS` of the recordings, pooled; None when there are none.

    Pads, and cases with drawn sensor files, are in no other part than their own, unless there is nothing
    else.
    """
    some = [
        one
        for trial in (evaluation.trials if name in APART else main_trials(evaluation))
        if belongs(trial, name)
        for one in trial.comparisons
        if one.method == method
    ]
    return pooled(some, evaluation.title) if some else None


def in_short(evaluation: Evaluation, method: str) -> str:
    """The main figures of a method in one line."""
    keys = (
        *(("depth", "rmse_median_mm"), ("depth", "peak_percent"), ("contacts", "precision_percent")),
        *(("contacts", "recall_percent"), ("contacts", "position_median_mm"), ("latency", "p50_ms")),
    )
    one = part(evaluation, method)
    if one is None:
        return "no recording"
    everything = figures(one)
    metrics = [metric for metric in METRICS if (metric.section, metric.key) in keys]
    return ", ".join(
        f"{metric.label} {written(metric, metric_value(metric, everything), one.unit)}" for metric in metrics
    )


def forces_in_short(evaluation: Evaluation, method: str) -> str | None:
    """The errors of the normal forces of a method in one line; None if it gives no force."""
    keys = (
        *(("force", "normal_median_percent"), ("force", "normal_p95_percent"), ("force", "normal_median_N")),
        ("calibration", "force.coverage_95"),
    )
    one = part(evaluation, method)
    everything = None if one is None else figures(one)
    if one is None or everything is None or not math.isfinite(everything["force"]["normal_median_N"]):
        return None
    metrics = [metric for metric in METRICS if (metric.section, metric.key) in keys]
    return ", ".join(
        f"{metric.label} {written(metric, metric_value(metric, everything), one.unit)}" for metric in metrics
    )


def unit_of(evaluation: Evaluation) -> str:
    """The unit of all lengths."""
    return evaluation.trials[0].comparisons[0].unit if evaluation.trials else "mm"


def main_trials(evaluation: Evaluation) -> tuple[Trial, ...]:
    """The recordings without those that stand apart, unless there is nothing else."""
    main = [trial for trial in evaluation.trials if trial.case is None or trial.case.group not in APART]
    return tuple(main) or evaluation.trials


def belongs(trial: Trial, name: str) -> bool:
    """Whether a recording belongs to one of `PARTS`."""
    if name == "all":
        return True
    if trial.case is None:
        return False
    if name in {"looked_at", "held_out"}:
        return trial.case.looked_at == (name == "looked_at")
    return trial.case.group == name


def _promised(compared: Iterable[MethodErrors | None]) -> dict[str, bool]:
    """Whether any method gives deviations of a quantity that can be rated, by quantity."""
    given = [uncertainty_calibrations(one) for one in compared if one is not None]
    return {name: any(one[name] for one in given) for name in ("centre", "depth", "position", "force")}


def _parts(evaluation: Evaluation, method: str) -> dict[str, Any]:
    parts = {name: part(evaluation, method, name) for name in PARTS}
    return {name: figures(one) for name, one in parts.items() if one is not None}


def _ratings(comparison: MethodErrors) -> dict[str, str]:
    everything = figures(comparison)
    return {
        f"{metric.section}.{metric.key}": word
        for metric in METRICS
        if (word := rating(metric, metric_value(metric, everything), comparison.unit)) != "none"
    }


def _case(trial: Trial) -> dict[str, Any]:
    return {
        "title": trial.title,
        "case": None if trial.case is None else asdict(trial.case),
        "figures": {one.method: figures(one) for one in trial.comparisons},
        "notes": {one.method: list(one.notes) for one in trial.comparisons},
    }


def plain(value: Any) -> Any:
    """Only what JSON knows: arrays become lists, NaN and infinity become None."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, bool) or value is None or isinstance(value, str | int):
        return value
    number = float(value)
    return number if math.isfinite(number) else None
