"""Metrics of markers: whether they are found, errors of their places, and wrong identities.

All from the tracked positions of the markers, which is what the tables contain.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording
from manytouch.evaluation.metrics.matching import nearest_dots
from manytouch.values.arrays import Counts, Points2

PerFrame = Int64[np.ndarray, " f"]

GATE_SHARE = 0.3  # of the distance of neighbouring dots


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DotSamples:
    """Counts per frame (f,), and the errors of the n dots that are right.

    Attributes:
        visible: dots that the true image shows.
        found: of them, how many an estimated centre stands on, whatever its number.
        false: estimated centres that stand on no dot, or on one that is already taken.
        wrong: found dots that carry the number of another one.
        swaps: markers that have jumped from one dot to another since they were last seen.
        losses: markers that were followed rightly one frame ago and, though visible, no longer are.
        error_px, std_px: (n, 2) estimated minus true centre, and its predicted deviation.
    """

    visible: PerFrame
    found: PerFrame
    false: PerFrame
    wrong: PerFrame
    swaps: PerFrame
    losses: PerFrame
    error_px: Points2
    std_px: Points2


def dot_samples(truth: EvaluatedRecording, estimated: EvaluatedRecording) -> DotSamples:
    """Compare the dots of the same frames; both recordings must contain the same frame numbers."""
    own = own_numbers(truth, estimated)
    dot = np.full(estimated.centre_px.shape[:2], -1)
    frames = len(truth.frame)
    visible, found, false = (np.zeros(frames, np.int64) for _ in range(3))
    errors, deviations = [np.zeros((0, 2))], [np.zeros((0, 2))]
    is_visible = np.isfinite(truth.centre_px).all(axis=2)
    for frame in range(frames):
        shown = np.flatnonzero(is_visible[frame])
        seen = np.flatnonzero(np.isfinite(estimated.centre_px[frame]).all(axis=1))
        true_px, estimated_px = truth.centre_px[frame, shown], estimated.centre_px[frame, seen]
        which, _ = nearest_dots(true_px, estimated_px, GATE_SHARE * neighbour_distance_px(true_px))
        right = which >= 0
        dot[frame, seen[right]] = shown[which[right]]
        visible[frame], found[frame], false[frame] = len(shown), right.sum(), (~right).sum()
        errors.append(estimated_px[right] - true_px[which[right]])
        deviations.append(estimated.centre_std_px[frame, seen[right]])
    followed = (dot >= 0) & (dot == own)
    return DotSamples(
        visible=visible,
        found=found,
        false=false,
        wrong=((dot >= 0) & (dot != own)).sum(axis=1),
        swaps=_swaps(dot),
        losses=_losses(followed, own, is_visible),
        error_px=np.concatenate(errors),
        std_px=np.concatenate(deviations),
    )


def neighbour_distance_px(dots_px: Points2) -> float:
    """Median distance to the nearest neighbour; infinite for a single dot."""
    if len(dots_px) < 2:
        return np.inf
    distance, _ = cKDTree(dots_px).query(dots_px, k=2)
    return float(np.median(distance[:, 1]))


def own_numbers(truth: EvaluatedRecording, estimated: EvaluatedRecording) -> Counts:
    """Which column of the truth each marker (m,) of the estimate is, -1 for none.

    Equal numbers are the same marker. Where the two do not number the same markers, because the
    method found the arrangement by itself, the numbers are taken from the dots under the estimate's
    markers in the first frame that shows both, and must stay so from then on; unless most of them
    then carry their own number, in which case the two only leave out different markers.
    """
    place = np.searchsorted(truth.marker, estimated.marker).clip(max=max(len(truth.marker) - 1, 0))
    same = np.where(truth.marker[place] == estimated.marker, place, -1)
    if np.array_equal(truth.marker, estimated.marker):
        return same
    found = _numbers_by_place(truth, estimated)
    agree = (found >= 0) & (found == same)
    return same if 2 * agree.sum() > (found >= 0).sum() else found


def _numbers_by_place(truth: EvaluatedRecording, estimated: EvaluatedRecording) -> Counts:
    own = np.full(len(estimated.marker), -1)
    for true_px, estimated_px in zip(truth.centre_px, estimated.centre_px, strict=True):
        shown = np.flatnonzero(np.isfinite(true_px).all(axis=1))
        seen = np.flatnonzero(np.isfinite(estimated_px).all(axis=1))
        gate_px = GATE_SHARE * neighbour_distance_px(true_px[shown])
        which, _ = nearest_dots(true_px[shown], estimated_px[seen], gate_px)
        if (which >= 0).any():
            own[seen[which >= 0]] = shown[which[which >= 0]]
            break
    return own


def _swaps(dot: Int64[np.ndarray, "f m"]) -> PerFrame:
    """Changes (f,) of the dot that a marker stands on; frames without any are passed over."""
    swaps = np.zeros(len(dot), np.int64)
    last = np.full(dot.shape[1], -1)
    for frame, now in enumerate(dot):
        swaps[frame] = ((now >= 0) & (last >= 0) & (now != last)).sum()
        last = np.where(now >= 0, now, last)
    return swaps


def _losses(followed: np.ndarray, own: Counts, is_visible: np.ndarray) -> PerFrame:
    could = np.where(own >= 0, is_visible[:, own], False)
    lost = np.zeros(followed.shape, dtype=bool)
    lost[1:] = followed[:-1] & could[1:] & ~followed[1:]
    return np.asarray(lost.sum(axis=1), dtype=np.int64)


def dot_figures(samples: DotSamples) -> dict[str, float]:
    """Found and false in % of the visible dots, errors of the centres, identities.

    `centre_rms_px` and `centre_p95_px` are of the distance between the estimated and the true
    centroid of a dot's image; `wrong_percent` is of the dots that were found; `losses_per_1000` is
    per 1000 visible dots.
    """
    visible, found = float(samples.visible.sum()), float(samples.found.sum())
    away: Float64[np.ndarray, " n"] = np.linalg.norm(samples.error_px, axis=1)
    return {
        "found_percent": ratio(100 * found, visible),
        "false_percent": ratio(100 * float(samples.false.sum()), visible),
        "centre_rms_px": float(np.sqrt(np.mean(away**2))) if len(away) else np.nan,
        "centre_p95_px": float(np.percentile(away, 95)) if len(away) else np.nan,
        "wrong_percent": ratio(100 * float(samples.wrong.sum()), found),
        "swaps": float(samples.swaps.sum()),
        "losses": float(samples.losses.sum()),
        "losses_per_1000": ratio(1000 * float(samples.losses.sum()), visible),
    }


def ratio(part: float, whole: float | int) -> float:
    """part / whole, NaN of nothing."""
    return part / whole if whole > 0 else float("nan")
