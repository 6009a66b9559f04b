"""Are the contacts found, where they are, and how hard do they press?"""

from dataclasses import dataclass

import numpy as np

from manytouch.evaluation.metrics.depth import percentile
from manytouch.evaluation.metrics.markers import ratio
from manytouch.evaluation.metrics.matching import GATE_MM, ContactPairs, match_contacts
from manytouch.evaluation.records.record import ContactRows, subset
from manytouch.values.arrays import Points2, Scalars

SMALLEST_N = 0.05  # below it relative errors are not computed


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactSamples:
    """Counts over all frames, and the k pairs of a true contact and its estimate.

    Attributes:
        required: true contacts that must be found, one per frame and contact.
        estimated: estimated contacts that are right or wrong.
        switches: times that a true contact is found under another identity than before.
        offset_mm: (k, 2) estimated minus true centre.
        offset_std_mm: (k, 2) its predicted deviation.
        true_depth_mm, depth_mm, depth_std_mm: (k,).
        true_force_N, force_N, force_std_N: (k,) normal force.
        true_shear_N, shear_N: (k, 2).
    """

    required: int
    estimated: int
    switches: int
    offset_mm: Points2
    offset_std_mm: Points2
    true_depth_mm: Scalars
    depth_mm: Scalars
    depth_std_mm: Scalars
    true_force_N: Scalars
    force_N: Scalars
    force_std_N: Scalars
    true_shear_N: Points2
    shear_N: Points2


def contact_samples(
    truth: ContactRows, estimated: ContactRows, *, gate_mm: float = GATE_MM, faint_mm: float = 0.3
) -> ContactSamples:
    """Compare contacts of the same frames, see `match_contacts` for who belongs to whom."""
    pairs = match_contacts(truth, estimated, gate_mm=gate_mm, faint_mm=faint_mm)
    mine, theirs = subset(truth, pairs.true_row), subset(estimated, pairs.estimated_row)
    return ContactSamples(
        required=int(pairs.is_required.sum()),
        estimated=int(pairs.is_counted.sum()),
        switches=identity_switches(truth, estimated, pairs),
        offset_mm=theirs.centre_mm - mine.centre_mm,
        offset_std_mm=theirs.centre_std_mm,
        true_depth_mm=mine.depth_mm,
        depth_mm=theirs.depth_mm,
        depth_std_mm=theirs.depth_std_mm,
        true_force_N=mine.normal_force_N,
        force_N=theirs.normal_force_N,
        force_std_N=theirs.normal_force_std_N,
        true_shear_N=mine.shear_N,
        shear_N=theirs.shear_N,
    )


def identity_switches(truth: ContactRows, estimated: ContactRows, pairs: ContactPairs) -> int:
    """Times that a true contact's estimate has another identity than when it was last found."""
    mine, theirs = truth.id[pairs.true_row], estimated.id[pairs.estimated_row]
    frame = truth.frame[pairs.true_row]
    switches = 0
    for contact in np.unique(mine):
        of_it = np.flatnonzero(mine == contact)
        names = theirs[of_it[np.argsort(frame[of_it], kind="stable")]]
        switches += int((names[1:] != names[:-1]).sum())
    return switches


def contact_figures(samples: ContactSamples) -> dict[str, float]:
    """Found and false contacts, and how far off those that were found are.

    `precision_percent`: of the estimated contacts, those within the gate of a true one of their own.
    `recall_percent`: of the true ones, those that were found. Position: distance between the force
    centroids of the pairs, so it cannot exceed the gate: read it together with the recall.
    """
    found = len(samples.offset_mm)
    away = np.linalg.norm(samples.offset_mm, axis=1)
    deep = np.abs(samples.depth_mm - samples.true_depth_mm)
    return {
        "precision_percent": ratio(100.0 * found, samples.estimated),
        "recall_percent": ratio(100.0 * found, samples.required),
        "position_median_mm": percentile(away, 50),
        "position_p95_mm": percentile(away, 95),
        "depth_error_median_mm": percentile(deep, 50),
        "depth_error_p95_mm": percentile(deep, 95),
        "switches": float(samples.switches),
        "true": float(samples.required),
        "estimated": float(samples.estimated),
    }


def force_figures(samples: ContactSamples) -> dict[str, float]:
    """Errors of the normal force and of the shear of the contacts that were found.

    Absolute: |estimated - true|, for the shear the length of the difference. Relative: that over the
    true force, of contacts with at least 0.05 N of it. A contact whose force the method does not give
    counts in `..._given_percent` alone; it is not an error of the whole force.
    """
    normal = samples.force_N - samples.true_force_N
    shear = np.linalg.norm(samples.shear_N - samples.true_shear_N, axis=1)
    true_shear = np.linalg.norm(samples.true_shear_N, axis=1)
    relative = _relative(normal, samples.true_force_N)
    return {
        "normal_given_percent": _given(normal, samples.true_force_N),
        "normal_median_N": percentile(np.abs(normal), 50),
        "normal_p95_N": percentile(np.abs(normal), 95),
        "normal_median_percent": percentile(np.abs(relative), 50),
        "normal_p95_percent": percentile(np.abs(relative), 95),
        "normal_bias_percent": percentile(relative, 50),
        "shear_given_percent": _given(shear, true_shear),
        "shear_median_N": percentile(shear, 50),
        "shear_p95_N": percentile(shear, 95),
        "shear_median_percent": percentile(_relative(shear, true_shear), 50),
        "shear_p95_percent": percentile(_relative(shear, true_shear), 95),
    }


def _relative(error: Scalars, true: Scalars) -> np.ndarray:
    """Errors in % of the true force, where that is large enough."""
    enough = true >= SMALLEST_N
    relative: np.ndarray = 100 * error[enough] / true[enough]
    return relative


def _given(error: Scalars, true: Scalars) -> float:
    known = np.isfinite(true)
    return ratio(100.0 * float(np.isfinite(error[known]).sum()), int(known.sum()))
