"""Two-point resolution: the smallest distance at which two contacts are found as two."""

from dataclasses import dataclass

import numpy as np

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows
from manytouch.evaluation.metrics.matching import GATE_MM, REQUIRED_MM, assigned, rows_of
from manytouch.values.arrays import Mask, Scalars

RATIOS = (1.0, 0.3)
RATIO_TOLERANCE = 1.25  # a pair belongs to a ratio that it meets within this factor
CLASS_MM = 2.0
RESOLVED_SHARE = 0.9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SeparationSamples:
    """Frames (n,) in which exactly two contacts touch in truth.

    Attributes:
        distance_mm: of their centres.
        force_ratio: weaker over stronger normal force; NaN where the forces are not known.
        is_resolved: whether they were found as two.
    """

    distance_mm: Scalars
    force_ratio: Scalars
    is_resolved: Mask


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SeparationCurve:
    """Share of frames in which two contacts are resolved, against their distance.

    Attributes:
        force_ratio: which pairs: 1 or 0.3.
        distance_mm: (c,) middle of each class that contains frames.
        share: (c,) resolved in it.
        frames: (c,) in it.
        from_mm: least distance from which on the share is 90 % or more; NaN when it never is.
    """

    force_ratio: float
    distance_mm: tuple[float, ...]
    share: tuple[float, ...]
    frames: tuple[int, ...]
    from_mm: float


def separation_samples(
    truth: ContactRows, estimated: ContactRows, *, gate_mm: float = GATE_MM, required_mm: float = REQUIRED_MM
) -> SeparationSamples:
    """Look at the frames in which two contacts touch, both at least `required_mm` deep.

    They are resolved when each has an estimate of its own, nearer to it than the gate and than half
    their distance, and no third estimate lies within their distance of the point halfway between them.
    """
    distances, ratios, resolved = [], [], []
    for frame in np.unique(truth.frame):
        two = rows_of(truth, int(frame))
        if len(two) != 2 or (truth.depth_mm[two] < required_mm).any():
            continue
        centre = truth.centre_mm[two]
        distance = float(np.linalg.norm(centre[1] - centre[0]))
        found = estimated.centre_mm[rows_of(estimated, int(frame))]
        away = np.linalg.norm(centre[:, None] - found[None], axis=2)
        around = np.linalg.norm(found - centre.mean(axis=0), axis=1) <= distance
        pairs = assigned(away, min(gate_mm, 0.5 * distance))
        force = np.sort(truth.normal_force_N[two])
        distances.append(distance)
        ratios.append(float(force[0] / force[1]) if force[1] > 0 else np.nan)
        resolved.append(len(pairs) == 2 and int(around.sum()) == 2)
    return SeparationSamples(
        distance_mm=np.array(distances, dtype=np.float64),
        force_ratio=np.array(ratios, dtype=np.float64),
        is_resolved=np.array(resolved, dtype=bool),
    )


def separation_curve(
    samples: SeparationSamples, force_ratio: float, *, class_mm: float = CLASS_MM
) -> SeparationCurve:
    """The curve of one force ratio, in classes of distance."""
    with np.errstate(invalid="ignore", divide="ignore"):
        fits = np.abs(np.log(samples.force_ratio / force_ratio)) <= np.log(RATIO_TOLERANCE)
    number = np.round(samples.distance_mm[fits] / class_mm).astype(np.int64)
    classes, index = np.unique(number, return_inverse=True)
    frames = np.bincount(index, minlength=len(classes))
    resolved = np.bincount(
        index, weights=samples.is_resolved[fits].astype(np.float64), minlength=len(classes)
    )
    share = resolved / np.maximum(frames, 1)
    good = np.flatnonzero(np.logical_and.accumulate((share >= RESOLVED_SHARE)[::-1])[::-1])
    return SeparationCurve(
        force_ratio=force_ratio,
        distance_mm=tuple((classes * class_mm).tolist()),
        share=tuple(share.tolist()),
        frames=tuple(frames.tolist()),
        from_mm=float(classes[good[0]] * class_mm) if len(good) else float("nan"),
    )
