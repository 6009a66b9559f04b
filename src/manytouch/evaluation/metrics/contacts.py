"""Metrics of contacts: whether they are found, and errors of their places and forces."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows, subset
from manytouch.evaluation.metrics.depth import percentile
from manytouch.evaluation.metrics.markers import ratio
from manytouch.evaluation.metrics.matching import GATE_MM, REQUIRED_MM, ContactPairs, match_contacts
from manytouch.values.arrays import Mask, Points2, Scalars

SMALLEST_N = 0.05
"""Least true force of which relative errors are computed: a choice. With less, errors of a few mN by noise
would be large relative ones; with more, light presses would not count."""
FRICTION = 0.15
"""Least ratio of true shear to normal force of a contact with friction: that of varied cases with friction,
which have half of the shear at which they slip, by coefficients of 0.3 or more. Without friction it is a few
per cent, where the sheet is inclined."""
FAINT_BAND_MM = (0.15, 0.5)
"""True depths of contacts whose figures are named `faint_...`: around `REQUIRED_MM`, by choice."""
LONG = 1.3
"""Least ratio of true half axes at which an orientation is compared; round contacts have none. A choice."""


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
        true_shear_N, shear_N, shear_std_N: (k, 2).
        true_torque_Nmm, torque_Nmm, torque_std_Nmm: (k,).
        true_area_mm2, area_mm2, area_std_mm2: (k,) of the region; the true one is NaN where the pressure was
            not read out.
        true_half_mm, half_mm: (k, 2) half axes.
        true_orientation_rad, orientation_rad: (k,) angle of the major axis from x towards y.
        is_last: (k,) is it the last pair of its true contact? These are one sample of each contact.
        split: true contacts that must be found and on which several estimates stand.
        faint_required: true contacts 0.15 to 0.5 mm deep.
        faint_true_mm, faint_mm: (l,) depths of those that were found.
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
    shear_std_N: Points2
    true_torque_Nmm: Scalars
    torque_Nmm: Scalars
    torque_std_Nmm: Scalars
    true_area_mm2: Scalars
    area_mm2: Scalars
    area_std_mm2: Scalars
    true_half_mm: Points2
    half_mm: Points2
    true_orientation_rad: Scalars
    orientation_rad: Scalars
    is_last: Mask
    split: int
    faint_required: int
    faint_true_mm: Float64[np.ndarray, " l"]
    faint_mm: Float64[np.ndarray, " l"]


def contact_samples(
    truth: ContactRows, estimated: ContactRows, *, gate_mm: float = GATE_MM, required_mm: float = REQUIRED_MM
) -> ContactSamples:
    """Compare contacts of the same frames, which `match_contacts` pairs."""
    pairs = match_contacts(truth, estimated, gate_mm=gate_mm, required_mm=required_mm)
    true, found = subset(truth, pairs.true_row), subset(estimated, pairs.estimated_row)
    every_true = np.concatenate([pairs.true_row, pairs.optional_true_row])
    every_given = np.concatenate([pairs.estimated_row, pairs.optional_estimated_row])
    is_faint = _is_faint(truth.depth_mm, gate_mm / GATE_MM)
    found_faint = is_faint[every_true]
    is_read_out = np.isfinite(true.half_axes_mm).all(axis=1)
    return ContactSamples(
        required=int(pairs.is_required.sum()),
        estimated=int(pairs.is_counted.sum()),
        switches=identity_switches(truth, estimated, pairs),
        offset_mm=found.centre_mm - true.centre_mm,
        offset_std_mm=found.centre_std_mm,
        true_depth_mm=true.depth_mm,
        depth_mm=found.depth_mm,
        depth_std_mm=found.depth_std_mm,
        true_force_N=true.normal_force_N,
        force_N=found.normal_force_N,
        force_std_N=found.normal_force_std_N,
        true_shear_N=true.shear_N,
        shear_N=found.shear_N,
        shear_std_N=found.shear_std_N,
        true_torque_Nmm=true.torque_Nmm,
        torque_Nmm=found.torque_Nmm,
        torque_std_Nmm=found.torque_std_Nmm,
        true_area_mm2=np.where(is_read_out, true.area_mm2, np.nan),
        area_mm2=found.area_mm2,
        area_std_mm2=found.area_std_mm2,
        true_half_mm=true.half_axes_mm,
        half_mm=found.half_axes_mm,
        true_orientation_rad=true.orientation_rad,
        orientation_rad=found.orientation_rad,
        is_last=_is_last(true),
        split=int(pairs.is_split.sum()),
        faint_required=int(is_faint.sum()),
        faint_true_mm=truth.depth_mm[every_true][found_faint],
        faint_mm=estimated.depth_mm[every_given][found_faint],
    )


def _is_faint(depth_mm: Scalars, scale: float) -> np.ndarray:
    low, high = FAINT_BAND_MM
    return np.asarray((depth_mm >= scale * low) & (depth_mm < scale * high))


def _is_last(rows: ContactRows) -> np.ndarray:
    """(k,) whether a row is the latest of its contact."""
    out = np.zeros(len(rows.id), dtype=bool)
    for contact in np.unique(rows.id):
        of_it = np.flatnonzero(rows.id == contact)
        out[of_it[np.argmax(rows.frame[of_it])]] = True
    return out


def identity_switches(truth: ContactRows, estimated: ContactRows, pairs: ContactPairs) -> int:
    """Times that a true contact's estimate has another identity than when it was last found."""
    true_id, found_id = truth.id[pairs.true_row], estimated.id[pairs.estimated_row]
    frame = truth.frame[pairs.true_row]
    switches = 0
    for contact in np.unique(true_id):
        of_it = np.flatnonzero(true_id == contact)
        names = found_id[of_it[np.argsort(frame[of_it], kind="stable")]]
        switches += int((names[1:] != names[:-1]).sum())
    return switches


def contact_figures(samples: ContactSamples) -> dict[str, float]:
    """Found and false contacts, and how far off those that were found are.

    `precision_percent`: of the estimated contacts, those within the gate of a true one of their own.
    `recall_percent`: of the true ones, those that were found. Position: distance between the force
    centroids of the pairs, so it cannot exceed the gate: read it together with the recall.
    `split_percent`: of the true ones, those on which several estimates stand.
    `faint_...`: of contacts 0.15 to 0.5 mm deep, relative to their depth.
    """
    found = len(samples.offset_mm)
    away = np.linalg.norm(samples.offset_mm, axis=1)
    deep = np.abs(samples.depth_mm - samples.true_depth_mm)
    faint = 100 * (samples.faint_mm - samples.faint_true_mm) / samples.faint_true_mm
    return {
        "precision_percent": ratio(100.0 * found, samples.estimated),
        "recall_percent": ratio(100.0 * found, samples.required),
        "position_median_mm": percentile(away, 50),
        "position_p95_mm": percentile(away, 95),
        "depth_error_median_mm": percentile(deep, 50),
        "depth_error_p95_mm": percentile(deep, 95),
        "split_percent": ratio(100.0 * samples.split, samples.required),
        "faint_recall_percent": ratio(100.0 * len(samples.faint_mm), samples.faint_required),
        "faint_depth_percent": percentile(np.abs(faint), 50),
        "faint_depth_bias_percent": percentile(faint, 50),
        "switches": float(samples.switches),
        "true": float(samples.required),
        "estimated": float(samples.estimated),
    }


def region_figures(samples: ContactSamples) -> dict[str, float]:
    """Area and shape of the contacts that were found, against the true ones.

    Where the pressure of the truth was not read out nothing is compared. Each is NaN without a sample.
    `area_given_percent`: share of these contacts whose area the method gives, 0 to 100.
    `area_median_percent`: median of |estimated - true| over the true area.
    `area_bias_percent`: median of (estimated - true) over the true area.
    `half_major_median_percent`, `half_minor_median_percent`: median of |estimated - true| over the true half
    axis.
    `angle_median_deg`: median angle between the estimated and the true major axis, 0 to 90, of contacts whose
    true half axes differ by 30 % or more.
    """
    area = 100 * (samples.area_mm2 - samples.true_area_mm2) / samples.true_area_mm2
    with np.errstate(invalid="ignore", divide="ignore"):
        axes = 100 * (samples.half_mm - samples.true_half_mm) / samples.true_half_mm
        is_long = samples.true_half_mm[:, 0] >= LONG * samples.true_half_mm[:, 1]
    error_rad = (samples.orientation_rad - samples.true_orientation_rad + np.pi / 2) % np.pi - np.pi / 2
    return {
        "area_given_percent": _given(area, samples.true_area_mm2),
        "area_median_percent": percentile(np.abs(area), 50),
        "area_bias_percent": percentile(area, 50),
        "half_major_median_percent": percentile(np.abs(axes[:, 0]), 50),
        "half_minor_median_percent": percentile(np.abs(axes[:, 1]), 50),
        "angle_median_deg": percentile(np.rad2deg(np.abs(error_rad[is_long])), 50),
    }


def force_figures(samples: ContactSamples) -> dict[str, float]:
    """Errors of the normal force and of the shear of the contacts that were found.

    Absolute: |estimated - true|, for the shear the length of the difference. Relative: that over the
    true force, of contacts with at least 0.05 N of it. A contact whose force the method does not give
    counts in `..._given_percent` alone, not as an error of the whole force. Friction: shear of contacts
    whose true shear is at least 0.15 of the normal force; without friction, less remains where the sheet is
    inclined. The angle is that between estimated and true shear, of contacts with friction and at least
    0.05 N of shear. Torque: |estimated - true| about the sheet's normal.
    """
    normal = samples.force_N - samples.true_force_N
    shear = np.linalg.norm(samples.shear_N - samples.true_shear_N, axis=1)
    true_shear = np.linalg.norm(samples.true_shear_N, axis=1)
    relative = _relative(normal, samples.true_force_N)
    rubs = true_shear >= FRICTION * samples.true_force_N
    by_friction = _relative(shear[rubs], true_shear[rubs])
    turned = rubs & (true_shear >= SMALLEST_N) & (np.linalg.norm(samples.shear_N, axis=1) > 0.0)
    torque = samples.torque_Nmm - samples.true_torque_Nmm
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
        "friction_shear_median_percent": percentile(by_friction, 50),
        "friction_shear_p95_percent": percentile(by_friction, 95),
        "friction_shear_angle_median_deg": percentile(
            _angle_deg(samples.shear_N[turned], samples.true_shear_N[turned]), 50
        ),
        "torque_given_percent": _given(torque, samples.true_torque_Nmm),
        "torque_median_Nmm": percentile(np.abs(torque), 50),
        "torque_p95_Nmm": percentile(np.abs(torque), 95),
    }


def _relative(error: Scalars, true: Scalars) -> np.ndarray:
    """Errors in % of the true force, where that is large enough."""
    enough = true >= SMALLEST_N
    relative: np.ndarray = 100 * error[enough] / true[enough]
    return relative


def _angle_deg(one_N: Points2, other_N: Points2) -> Scalars:
    """Angles (k,) from 0 to 180 degrees between vectors (k, 2)."""
    across = one_N[:, 0] * other_N[:, 1] - one_N[:, 1] * other_N[:, 0]
    angle_deg: Scalars = np.rad2deg(np.abs(np.arctan2(across, (one_N * other_N).sum(axis=1))))
    return angle_deg


def _given(error: Scalars, true: Scalars) -> float:
    known = np.isfinite(true)
    return ratio(100.0 * float(np.isfinite(error[known]).sum()), int(known.sum()))
