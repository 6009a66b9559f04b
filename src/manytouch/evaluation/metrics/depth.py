"""How far is the estimated shape of the sheet from the true one?"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording
from manytouch.evaluation.metrics.markers import own_numbers, ratio
from manytouch.values.arrays import Points2, Scalars

PerFrame = Float64[np.ndarray, " f"]

SHALLOWEST_PEAK_MM = 0.3
EDGES_MM = (0.0, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DepthSamples:
    """Depth per frame (f), and per marker that is given in a frame in which something touches (n).

    Attributes:
        is_pressed: (f,) does anything touch in truth?
        rmse_mm: (f,) over the markers that are given; NaN where none is.
        worst_mm: (f,) largest absolute error of a marker.
        given: (f,) share of the true markers whose depth is given.
        true_peak_mm, peak_mm: (f,) largest true and largest estimated depth of any marker.
        at_peak_mm: (f,) estimated depth at the marker that is truly deepest.
        place: (n, 2) of the marker at rest: -1 to 1 from the left to the right, and from the upper
            to the lower border of the lattice.
        true_mm, error_mm, std_mm: (n,) true depth, estimated minus true, predicted deviation.
    """

    is_pressed: Bool[np.ndarray, " f"]
    rmse_mm: PerFrame
    worst_mm: PerFrame
    given: PerFrame
    true_peak_mm: PerFrame
    peak_mm: PerFrame
    at_peak_mm: PerFrame
    place: Points2
    true_mm: Scalars
    error_mm: Scalars
    std_mm: Scalars


def depth_samples(truth: EvaluatedRecording, estimated: EvaluatedRecording) -> DepthSamples:
    """Compare the depth at the markers of the same frames, marker by marker."""
    own = own_numbers(truth, estimated)
    estimate, deviation = (np.full(truth.depth_mm.shape, np.nan) for _ in range(2))
    estimate[:, own[own >= 0]] = estimated.depth_mm[:, own >= 0]
    deviation[:, own[own >= 0]] = estimated.depth_std_mm[:, own >= 0]
    error = estimate - truth.depth_mm
    is_known, is_given = np.isfinite(truth.depth_mm), np.isfinite(error)
    is_pressed = np.isin(truth.frame, truth.contacts.frame)
    chosen = is_given & is_pressed[:, None]
    place: np.ndarray = np.tile(relative_place(truth.place), (len(error), 1, 1))
    is_somewhere = is_known.any(axis=1)
    deepest = np.argmax(np.where(is_known, truth.depth_mm, -np.inf), axis=1)
    at_peak = np.take_along_axis(estimate, deepest[:, None], axis=1)[:, 0]
    return DepthSamples(
        is_pressed=is_pressed,
        rmse_mm=np.sqrt(_mean(error**2)),
        worst_mm=_largest(np.abs(error)),
        given=np.where(is_somewhere, is_given.sum(axis=1) / np.maximum(is_known.sum(axis=1), 1), np.nan),
        true_peak_mm=_largest(truth.depth_mm),
        peak_mm=_largest(estimate),
        at_peak_mm=np.where(is_somewhere, at_peak, np.nan),
        place=place[chosen],
        true_mm=truth.depth_mm[chosen],
        error_mm=error[chosen],
        std_mm=deviation[chosen],
    )


def relative_place(place: Points2) -> Points2:
    """Places from -1 to 1 within the box that contains them all."""
    if len(place) == 0:
        return place
    low, high = place.min(axis=0), place.max(axis=0)
    relative: Points2 = (2 * place - low - high) / np.where(high > low, high - low, 1.0)
    return relative


def depth_figures(samples: DepthSamples, *, shallowest_mm: float = SHALLOWEST_PEAK_MM) -> dict[str, float]:
    """RMSE over the sheet, of frames in which something touches: median and worst frame; and the peak.

    `peak_percent` = 100 (largest estimated - largest true depth) / largest true depth of a frame,
    wherever the two lie; the median and the 95th percentile are of its absolute value, `peak_bias_percent`
    is the median with its sign. `at_peak_percent` is the same with the estimate at the marker that is
    truly deepest. Frames less than `shallowest_mm` deep have no peak. `rmse_of_peak_percent`: RMSE of a frame
    over its largest true depth, median of the frames in which something touches. `given_percent`: true
    markers with an estimate. `rest_rmse_mm`: median of the frames in which nothing touches.
    """
    pressed = samples.is_pressed
    deep = pressed & (samples.true_peak_mm >= shallowest_mm)
    with np.errstate(invalid="ignore"):
        peak = 100 * (samples.peak_mm - samples.true_peak_mm)[deep] / samples.true_peak_mm[deep]
        at_peak = 100 * (samples.at_peak_mm - samples.true_peak_mm)[deep] / samples.true_peak_mm[deep]
    has_depth = pressed & (samples.true_peak_mm > 0.0)
    of_peak = 100 * samples.rmse_mm[has_depth] / samples.true_peak_mm[has_depth]
    given = samples.given[pressed & np.isfinite(samples.given)]
    return {
        "rmse_median_mm": percentile(samples.rmse_mm[pressed], 50),
        "rmse_worst_mm": percentile(samples.rmse_mm[pressed], 100),
        "rmse_of_peak_percent": percentile(of_peak, 50),
        "worst_mm": percentile(samples.worst_mm[pressed], 100),
        "peak_percent": percentile(np.abs(peak), 50),
        "peak_p95_percent": percentile(np.abs(peak), 95),
        "peak_bias_percent": percentile(peak, 50),
        "at_peak_percent": percentile(np.abs(at_peak), 50),
        "given_percent": ratio(100 * float(given.sum()), len(given)),
        "rest_rmse_mm": percentile(samples.rmse_mm[~pressed], 50),
        "frames": float(pressed.sum()),
    }


def error_against_depth(true_mm: Scalars, error_mm: Scalars) -> dict[str, list[float]]:
    """Median, 10th and 90th percentile of the error in classes of the true depth that contain 20 markers."""
    rows = []
    for low, high in pairwise(EDGES_MM):
        inside = error_mm[(true_mm >= low) & (true_mm < high)]
        if len(inside) >= 20:
            middle = float(np.median(true_mm[(true_mm >= low) & (true_mm < high)]))
            rows.append([middle, *np.percentile(inside, [10, 50, 90]).tolist(), len(inside)])
    names = ("depth_mm", "p10_mm", "median_mm", "p90_mm", "count")
    return {name: [row[index] for row in rows] for index, name in enumerate(names)}


def error_map(place: Points2, error_mm: Scalars, shape: tuple[int, int]) -> np.ndarray:
    """Root mean square error (rows, columns) over the sheet; NaN where there is no marker."""
    rows, columns = shape
    column = np.clip((0.5 * (place[:, 0] + 1) * columns).astype(np.int64), 0, columns - 1)
    row = np.clip((0.5 * (place[:, 1] + 1) * rows).astype(np.int64), 0, rows - 1)
    cell = row * columns + column
    count = np.bincount(cell, minlength=rows * columns)
    total = np.bincount(cell, weights=error_mm**2, minlength=rows * columns)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return np.sqrt(mean).reshape(shape)


def percentile(values: np.ndarray, rank: int) -> float:
    """Percentile of the values that are given; NaN when there are none."""
    known = values[np.isfinite(values)]
    return float(np.percentile(known, rank)) if len(known) else float("nan")


def _mean(values: np.ndarray) -> Scalars:
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=1)
    return np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan)


def _largest(values: np.ndarray) -> Scalars:
    known = np.isfinite(values)
    largest = np.max(np.where(known, values, -np.inf), axis=1, initial=-np.inf)
    return np.where(known.any(axis=1), largest, np.nan)
