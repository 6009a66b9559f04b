"""Which figures a report shows, in which words and unit, and from where on they are good or poor.

The limits are what users of such sensors need, not what any method reaches: see docs/metrics.md.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

from manytouch.evaluation.metrics.matching import PITCH_MM
from manytouch.values import LengthUnit

RatingName = Literal["good", "fair", "poor", "none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricSpec:
    """A metric, which is a row in the tables of a report.

    Attributes:
        section, key: where the figure stands in `comparison.figures`; calibration has "quantity.key".
        label: in words.
        unit: "" for a plain number, "share" for a share that is shown in %.
        good, poor: limits; which side is good follows from their order. None: no rating.
        aim: value that the figure should have; `good` and `poor` are then limits of its difference from it.
            None: they are limits of the figure itself.
        is_factor: `good` and `poor` are limits of the factor between the figure and `aim` instead.
        digits: significant digits to show.
        is_head: does it stand in the summary?
    """

    section: str
    key: str
    label: str
    unit: str = ""
    good: float | None = None
    poor: float | None = None
    aim: float | None = None
    is_factor: bool = False
    digits: int = 3
    is_head: bool = False


def _metrics(section: str, *metrics: tuple[Any, ...], head: tuple[str, ...] = ()) -> tuple[MetricSpec, ...]:
    return tuple(
        MetricSpec(
            section=section,
            key=key,
            label=label,
            unit=unit,
            good=limits[0] if limits else None,
            poor=limits[1] if limits else None,
            aim=limits[2] if len(limits) > 2 else None,
            is_factor=key.endswith((".chi2_per_dof", ".spread")),
            is_head=key in head,
        )
        for key, label, unit, *limits in metrics
    )


_QUANTITIES = {
    "centre": "dot centre",
    "depth": "depth",
    "position": "contact position",
    "force": "normal force",
}

METRICS: tuple[MetricSpec, ...] = (
    *_metrics(
        "detection",
        ("found_percent", "dots found", "%", 99.5, 95.0),
        ("false_percent", "false dots", "%", 0.1, 1.0),
        ("centre_rms_px", "centre error, RMS", "px", 0.05, 0.2),
        ("centre_p95_px", "centre error, 95th percentile", "px", 0.1, 0.4),
        ("wrong_percent", "dots under a wrong number", "%", 0.01, 0.5),
        ("swaps", "swaps of number", ""),
        ("losses", "dots lost while visible", ""),
        ("losses_per_1000", "losses per 1000 dots", "", 1.0, 20.0),
        head=("found_percent", "centre_rms_px", "wrong_percent"),
    ),
    *_metrics(
        "depth",
        ("rmse_median_mm", "depth RMSE over the sheet, median frame", "mm", 0.05, 0.3),
        ("rmse_worst_mm", "depth RMSE over the sheet, worst frame", "mm", 0.2, 1.0),
        ("rmse_of_peak_percent", "depth RMSE over the peak depth, median frame", "%", 6.0, 20.0),
        ("worst_mm", "worst error of a single marker", "mm", 0.5, 2.0),
        ("peak_percent", "peak depth error, median", "%", 3.0, 20.0),
        ("peak_p95_percent", "peak depth error, 95th percentile", "%", 8.0, 50.0),
        ("peak_bias_percent", "peak depth error, with its sign", "%", 2.0, 15.0, 0.0),
        ("at_peak_percent", "error at the truly deepest marker", "%", 3.0, 20.0),
        ("given_percent", "markers whose depth is given", "%", 98.0, 90.0),
        ("rest_rmse_mm", "depth RMSE while nothing touches", "mm", 0.02, 0.1),
        head=("rmse_median_mm", "rmse_worst_mm", "peak_percent", "given_percent"),
    ),
    *_metrics(
        "contacts",
        ("precision_percent", "precision", "%", 98.0, 80.0),
        ("recall_percent", "recall", "%", 95.0, 80.0),
        ("position_median_mm", "position error, median", "mm", 0.5, 1.5),
        ("position_p95_mm", "position error, 95th percentile", "mm", 1.5, 2.5),
        ("depth_error_median_mm", "depth error at the contact, median", "mm", 0.1, 0.5),
        ("depth_error_p95_mm", "depth error at the contact, 95th percentile", "mm", 0.3, 1.5),
        ("split_percent", "contacts split into several", "%", 1.0, 10.0),
        ("faint_recall_percent", "contacts of 0.15 to 0.5 mm found", "%", 95.0, 80.0),
        ("faint_depth_percent", "their depth error, relative, median", "%", 5.0, 20.0),
        ("faint_depth_bias_percent", "their depth error, relative, with its sign", "%", 2.0, 15.0, 0.0),
        ("switches", "changes of identity", ""),
        ("true", "true contacts, over all frames", ""),
        ("estimated", "estimated contacts, over all frames", ""),
        head=("precision_percent", "recall_percent", "position_median_mm", "position_p95_mm"),
    ),
    *_metrics(
        "force",
        ("normal_given_percent", "normal force given", "%", 98.0, 90.0),
        ("normal_median_percent", "normal force error, relative, median", "%", 6.0, 20.0),
        ("normal_p95_percent", "normal force error, relative, 95th percentile", "%", 20.0, 60.0),
        ("normal_bias_percent", "normal force error, relative, with its sign", "%", 3.0, 15.0, 0.0),
        ("normal_median_N", "normal force error, median", "N"),
        ("normal_p95_N", "normal force error, 95th percentile", "N"),
        ("shear_given_percent", "shear given", "%", 98.0, 90.0),
        ("shear_median_N", "shear error, median", "N"),
        ("shear_p95_N", "shear error, 95th percentile", "N"),
        ("shear_median_percent", "shear error, relative, median", "%", 15.0, 40.0),
        ("shear_p95_percent", "shear error, relative, 95th percentile", "%", 40.0, 100.0),
        ("friction_shear_median_percent", "shear error with friction, relative, median", "%", 15.0, 40.0),
        ("friction_shear_p95_percent", "the same, 95th percentile", "%", 40.0, 100.0),
        (
            "friction_shear_angle_median_deg",
            "direction of shear with friction, median error",
            "deg",
            6.0,
            20.0,
        ),
        ("torque_given_percent", "torque given", "%", 98.0, 90.0),
        ("torque_median_Nmm", "torque error, median", "N mm"),
        ("torque_p95_Nmm", "torque error, 95th percentile", "N mm"),
        head=("normal_median_percent", "shear_median_percent"),
    ),
    *_metrics(
        "region",
        ("area_given_percent", "area given", "%", 98.0, 90.0),
        ("area_median_percent", "area error, relative, median", "%", 15.0, 40.0),
        ("area_bias_percent", "area error, relative, with its sign", "%", 10.0, 40.0, 0.0),
        ("half_major_median_percent", "major half axis error, relative, median", "%", 15.0, 40.0),
        ("half_minor_median_percent", "minor half axis error, relative, median", "%", 15.0, 40.0),
        ("angle_median_deg", "orientation error of long contacts, median", "deg", 5.0, 20.0),
    ),
    *_metrics(
        "separation",
        ("from_mm_at_1_to_1", "two equal contacts resolved from", "mm", 8.0, 24.0),
        ("from_mm_at_1_to_0.3", "two contacts of 1 : 0.3 resolved from", "mm", 12.0, 32.0),
        head=("from_mm_at_1_to_1", "from_mm_at_1_to_0.3"),
    ),
    *_metrics(
        "latency",
        ("p50_ms", "time per frame, median", "ms", 10.0, 33.3),
        ("p99_ms", "time per frame, 99th percentile", "ms", 20.0, 66.7),
        ("frames_per_second", "frames per second", "", 60.0, 25.0),
        head=("p50_ms", "p99_ms"),
    ),
    *(
        metric
        for quantity, words in _QUANTITIES.items()
        for metric in _metrics(
            "calibration",
            (f"{quantity}.chi2_per_dof", f"{words}: chi² per component", "", 1.5, 3.0, 1.0),
            (f"{quantity}.spread", f"{words}: spread of z", "", 1.25, 1.75, 1.0),
            (f"{quantity}.coverage_68", f"{words}: within the 68 % interval", "share", 0.05, 0.15, 0.68),
            (f"{quantity}.coverage_95", f"{words}: within the 95 % interval", "share", 0.03, 0.10, 0.95),
            head=("depth.coverage_95", "position.coverage_95"),
        )
    ),
)


def metric_value(metric: MetricSpec, figures: dict[str, Any]) -> float:
    """The value of a metric in `comparison.figures`; NaN when it is not given."""
    place: Any = figures
    for name in (
        metric.section,
        *(metric.key.split(".", 1) if metric.section == "calibration" else [metric.key]),
    ):
        place = None if place is None else place.get(name)
    return math.nan if place is None else float(place)


def rating(metric: MetricSpec, value: float, unit: LengthUnit = "mm") -> RatingName:
    """Good, fair or poor; "none" where there is no limit or no figure."""
    if metric.good is None or metric.poor is None or not math.isfinite(value):
        return "none"
    scale = 1.0 / PITCH_MM if metric.unit == "mm" and unit == "pitch" else 1.0
    good, poor = metric.good * scale, metric.poor * scale
    off = off_aim(metric, value)
    if good > poor:
        off, good, poor = -off, -good, -poor
    return "good" if off <= good else "poor" if off > poor else "fair"


def off_aim(metric: MetricSpec, value: float) -> float:
    """How far a figure is from where it should be: itself, its distance, or its factor."""
    if metric.aim is None:
        return value
    if metric.is_factor:
        return max(value / metric.aim, metric.aim / value) if value > 0 else math.inf
    return abs(value - metric.aim)


def written(metric: MetricSpec, value: float, unit: LengthUnit = "mm") -> str:
    """A figure with its unit, or "not given"."""
    if not math.isfinite(value):
        return "not given"
    if metric.unit == "share":
        return f"{100 * value:.1f} %"
    return f"{plain(value, metric.digits)} {unit if metric.unit == 'mm' else metric.unit}".strip()


def plain(value: float, digits: int = 3) -> str:
    """Significant digits without exponent: 0.0123, 1.23, 123, 12346; with a true minus sign."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "not given"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    text = f"{value:.{min(decimals, 4)}f}"
    return text.replace("-", "\N{MINUS SIGN}")
