"""The report's tables and sentences: which figures are good and which are poor."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from manytouch.evaluation.metrics.matching import PITCH_MM
from manytouch.evaluation.metrics.metric_specs import (
    METRICS,
    MetricSpec,
    metric_value,
    off_aim,
    rating,
    written,
)
from manytouch.values import LengthUnit

SIGNS = {"good": "●", "fair": "◐", "poor": "○", "none": ""}
NOT_GIVEN = "not given"
SAME_SHARE_PERCENT = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One figure of a table.

    Attributes:
        text: with its unit.
        rating: good, fair, poor or none.
        sign: the same as a shape, for those who do not see the colour.
        is_best: better than those of all other methods?
    """

    text: str
    rating: str
    sign: str
    is_best: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of a table: a label and a cell for each method."""

    section: str
    label: str
    limits: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodRating:
    """What is good and what is poor of one method: labels and figures."""

    method: str
    good: tuple[tuple[str, str], ...]
    poor: tuple[tuple[str, str], ...]
    missing: tuple[str, ...]


def table(data: dict[str, Any], section: str) -> list[Row]:
    """The rows of a section, or of "summary", of all recordings; without figures that nobody gives."""
    everything = [data["figures"][method]["all"] for method in data["methods"]]
    unit: LengthUnit = data["unit"]
    metrics = [
        metric
        for metric in METRICS
        if (metric.is_head if section == "summary" else metric.section == section)
    ]
    rows = []
    for metric in metrics:
        cells = [cell(metric, figured, unit) for figured in everything]
        if section != "summary" and all(one.text == NOT_GIVEN for one in cells):
            continue
        best = _best(metric, everything)
        if best is not None and [one.text for one in cells].count(cells[best].text) == 1:
            cells[best] = replace(cells[best], is_best=True)
        rows.append(
            Row(section=metric.section, label=metric.label, limits=limits(metric, unit), cells=tuple(cells))
        )
    return rows


def cell(metric: MetricSpec, figured: dict[str, Any], unit: LengthUnit) -> Cell:
    """A figure with its rating; a separation that is never reached is poor, not missing."""
    value = metric_value(metric, figured)
    if metric.section == "separation" and not np.isfinite(value) and _pairs(metric, figured):
        return Cell(text="never", rating="poor", sign=SIGNS["poor"])
    word = rating(metric, value, unit)
    return Cell(text=written(metric, value, unit), rating=word, sign=SIGNS[word])


def _pairs(metric: MetricSpec, figured: dict[str, Any]) -> int:
    """Frames with two contacts of the force ratio of a metric."""
    return int(figured["separation"][metric.key.replace("from_mm", "pairs")])


def limits(metric: MetricSpec, unit: LengthUnit) -> str:
    """From where on a figure is good and poor, for the table's last column."""
    if metric.good is None or metric.poor is None:
        return ""
    scale = 1.0 / PITCH_MM if metric.unit == "mm" and unit == "pitch" else 1.0
    good, poor = metric.good * scale, metric.poor * scale
    if metric.is_factor:
        return f"{metric.aim:g} within × {good:g}, poor beyond × {poor:g}"
    if metric.unit == "share" and metric.aim is not None:
        return f"{100 * metric.aim:g} ± {100 * good:g}, poor beyond ± {100 * poor:g}"
    if metric.aim is not None:
        return f"{metric.aim:g} ± {good:g}, poor beyond ± {poor:g}"
    sides = ("≥", "<") if good > poor else ("≤", ">")
    return f"{sides[0]} {good:g}, poor {sides[1]} {poor:g}"


def rate_methods(data: dict[str, Any]) -> list[MethodRating]:
    """What of the summary is good of each method, what is poor, and what it does not give."""
    metrics = [metric for metric in METRICS if metric.is_head]
    rated = []
    for method in data["methods"]:
        shown = [
            (metric.label, cell(metric, data["figures"][method]["all"], data["unit"])) for metric in metrics
        ]
        sides = {
            word: tuple((label, one.text) for label, one in shown if one.rating == word) for word in SIGNS
        }
        rated.append(
            MethodRating(
                method=method,
                good=sides["good"],
                poor=sides["poor"],
                missing=tuple(label for label, _ in sides["none"]),
            )
        )
    return rated


def halves_rows(data: dict[str, Any]) -> list[dict[str, Any]]:
    """Main figures by group and half, one row for each part and method."""
    names = {
        "nominal": "nominal",
        "separation": "separation",
        "stress": "stress",
        "varied": "varied",
        "drawn": "varied, drawn sensor files",
        "calibrated": "varied, calibrated sensors",
        "looked_at": "half that may be looked at",
        "held_out": "half that is held out",
        "pads": "bonded pads, true sensor file",
        "pads_nominal": "bonded pads, nominal sensor file",
        "pads_calibrated": "bonded pads, calibrated sensors",
        "pads_calculix": "bonded pads solved by CalculiX",
    }
    keys = (
        *(("depth", "rmse_median_mm"), ("depth", "rmse_worst_mm"), ("depth", "peak_percent")),
        *(("contacts", "precision_percent"), ("contacts", "recall_percent")),
        *(("contacts", "position_median_mm"), ("force", "normal_median_percent")),
    )
    metrics = [next(metric for metric in METRICS if (metric.section, metric.key) == key) for key in keys]
    rows = []
    for name, words in names.items():
        for method in data["methods"]:
            figured = data["figures"][method].get(name)
            if figured is not None:
                values = [written(metric, metric_value(metric, figured), data["unit"]) for metric in metrics]
                rows.append({"part": words, "method": method, "values": values})
    return rows


def case_rows(data: dict[str, Any]) -> list[dict[str, Any]]:
    """The main figures of every recording."""
    keys = (("depth", "rmse_median_mm"), ("contacts", "recall_percent"), ("contacts", "precision_percent"))
    metrics = [next(metric for metric in METRICS if (metric.section, metric.key) == key) for key in keys]
    return [
        {
            "title": one["title"],
            "case": one["case"],
            "cells": [
                [cell(metric, one["figures"][method], data["unit"]) for metric in metrics]
                for method in data["methods"]
            ],
        }
        for one in data["cases"]
    ]


def _best(metric: MetricSpec, everything: list[dict[str, Any]]) -> int | None:
    """The method with the best figure; None where they cannot be compared.

    Errors of depth and force are those of what is given, so they are not ranked when the methods do
    not give about the same share.
    """
    if metric.good is None or metric.poor is None:
        return None
    known = [(metric_value(metric, one), index) for index, one in enumerate(everything)]
    known = [(value, index) for value, index in known if np.isfinite(value)]
    given = {"depth": "given_percent", "force": "normal_given_percent"}.get(metric.section)
    if given is not None and metric.key != given:
        shares = [float(one[metric.section][given] or 0.0) for one in everything]
        if max(shares) - min(shares) > SAME_SHARE_PERCENT:
            return None
    if len(known) < 2:
        return None
    if metric.aim is not None:
        known = [(off_aim(metric, value), index) for value, index in known]
    elif metric.good > metric.poor:
        known = [(-value, index) for value, index in known]
    return min(known)[1]
