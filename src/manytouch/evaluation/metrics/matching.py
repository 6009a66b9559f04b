"""Which estimate belongs to which truth."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from manytouch.evaluation.evaluated_recordings.evaluated_recording import ContactRows
from manytouch.values.arrays import Counts, Points2, Scalars, read_only

GATE_MM = 3.0
"""An estimate of a contact may be so far off: three quarters of `PITCH_MM`, a choice. A wider gate finds more
contacts with larger errors of position, which is why docs/metrics.md shows both as one curve."""
GATE_SHARE = 0.2
"""An estimate on a large contact may be so far off, in shares of its half major axis: a choice, which counts
for half axes of more than 15 mm, as those of palms."""
ON_IT = 1.25
"""An estimate is on a contact within its uniform ellipse times this: the corners of a square are at 1.22."""
PITCH_MM = 4.0  # of the sheet for which the gate was chosen; in pitches it is 3 mm of 4 mm
REQUIRED_MM = 0.3
"""Depth from which on a true contact must be found: a choice; nominal cases are 0.3 to 10 mm deep.
Fainter ones have metrics of their own (`contacts.FAINT_BAND_MM`)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactPairs:
    """Contacts of truth and estimate that belong together, as rows of their tables.

    Attributes:
        true_row, estimated_row: (k,) of each pair.
        is_required: true contacts that must be found; the others are not deep enough to be required.
        is_counted: estimated contacts that are right or wrong; the others are paired with a true contact that
            is not required.
        is_split: true contacts that must be found and on which several estimates stand.
        optional_true_row, optional_estimated_row: (l,) of pairs whose true contact is not required.
    """

    true_row: Counts
    estimated_row: Counts
    is_required: Bool[np.ndarray, " t"]
    is_counted: Bool[np.ndarray, " e"]
    is_split: Bool[np.ndarray, " t"]
    optional_true_row: Int64[np.ndarray, " l"]
    optional_estimated_row: Int64[np.ndarray, " l"]


def assigned(distance: Float64[np.ndarray, "a b"], gate: float) -> Int64[np.ndarray, "k 2"]:
    """One-to-one pairs (row, column) nearer than a gate: as many as can be, then of least total distance.

    Hungarian method (Kuhn 1955, doi:10.1002/nav.3800020109). NaN is never near.
    """
    near = np.nan_to_num(distance, nan=np.inf) < gate
    if not near.any():
        return np.zeros((0, 2), dtype=np.int64)
    refused = 10.0 * gate * min(distance.shape)
    row, column = linear_sum_assignment(np.where(near, distance, refused))
    kept = near[row, column]
    return np.column_stack([row[kept], column[kept]]).astype(np.int64)


def gates_of(truth: ContactRows, gate_mm: float) -> Scalars:
    """(t,) how near an estimate of each true contact must be."""
    return np.asarray(np.fmax(gate_mm, GATE_SHARE * truth.half_axes_mm[:, 0]))


def match_contacts(
    truth: ContactRows, estimated: ContactRows, *, gate_mm: float = GATE_MM, required_mm: float = REQUIRED_MM
) -> ContactPairs:
    """Pair the contacts of each frame by the distance of their centres.

    An estimate is near enough within `gate_mm`, or within `GATE_SHARE` of the half major axis of the true
    contact where that is more.

    A true contact that presses less than `required_mm` deep need not be found, and an estimate of it is not
    wrong: both take part in the pairing and are then left out of both counts. A true contact whose depth is
    not known must be found.
    """
    true_rows, estimated_rows = [], []
    is_split = np.zeros(len(truth.frame), dtype=bool)
    gates_mm = gates_of(truth, gate_mm)
    for frame in np.intersect1d(truth.frame, estimated.frame):
        true, found = rows_of(truth, int(frame)), rows_of(estimated, int(frame))
        away = np.linalg.norm(truth.centre_mm[true][:, None] - estimated.centre_mm[found][None], axis=2)
        pair = assigned(away / gates_mm[true][:, None], 1.0)
        is_split[true] = _split(truth, estimated, true, found, pair, gate_mm)
        true_rows.append(true[pair[:, 0]])
        estimated_rows.append(found[pair[:, 1]])
    true_row = np.concatenate([np.zeros(0, np.int64), *true_rows])
    estimated_row = np.concatenate([np.zeros(0, np.int64), *estimated_rows])
    is_required = ~(truth.depth_mm < required_mm)
    is_counted = np.ones(len(estimated.frame), dtype=bool)
    is_counted[estimated_row] = is_required[true_row]
    kept = is_required[true_row]
    return ContactPairs(
        true_row=read_only(true_row[kept]),
        estimated_row=read_only(estimated_row[kept]),
        is_required=read_only(is_required),
        is_counted=read_only(is_counted),
        is_split=read_only(is_split & is_required),
        optional_true_row=read_only(true_row[~kept]),
        optional_estimated_row=read_only(estimated_row[~kept]),
    )


def _split(  # noqa: PLR0917 - rows of one frame
    truth: ContactRows,
    estimated: ContactRows,
    true: Int64[np.ndarray, " a"],
    found: Int64[np.ndarray, " b"],
    pair: Int64[np.ndarray, "k 2"],
    gate_mm: float,
) -> Bool[np.ndarray, " a"]:
    """(a,) whether several estimates belong to each true contact of a frame.

    An estimate of a pair stands on the contact of that pair, any other on the nearest true contact, if it is
    on it or within the gate.
    """
    count = np.bincount(pair[:, 0], minlength=len(true))
    left = np.setdiff1d(np.arange(len(found)), pair[:, 1])
    if not len(left) or not len(true):
        return np.asarray(count > 1)
    off_mm = estimated.centre_mm[found[left]][None] - truth.centre_mm[true][:, None]
    away_mm = np.linalg.norm(off_mm, axis=2)
    cosine, sine = np.cos(truth.orientation_rad[true]), np.sin(truth.orientation_rad[true])
    along = cosine[:, None] * off_mm[..., 0] + sine[:, None] * off_mm[..., 1]
    across = -sine[:, None] * off_mm[..., 0] + cosine[:, None] * off_mm[..., 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        axes_mm = ON_IT * truth.half_axes_mm[true]
        is_on = np.hypot(along / axes_mm[:, :1], across / axes_mm[:, 1:]) <= 1.0
    is_on |= away_mm < gate_mm
    is_nearest = np.arange(len(true))[:, None] == np.argmin(away_mm, axis=0)[None]
    return np.asarray(count + (is_on & is_nearest).sum(axis=1) > 1)


def rows_of(rows: ContactRows, frame: int) -> Counts:
    """Which rows belong to a frame; they stand together, for rows are in the order of their frames."""
    begin, end = np.searchsorted(rows.frame, [frame, frame + 1])
    return np.arange(begin, end)


def nearest_dots(
    truth: Float64[np.ndarray, "t 2"], estimated: Points2, gate_px: float
) -> tuple[Counts, Scalars]:
    """For each estimated dot (n,) the true dot it stands for, -1 for none, and their distance.

    It is the nearest one within the gate; of several estimates on one true dot only the nearest is
    right.
    """
    count = len(estimated)
    which, away = np.full(count, -1), np.full(count, np.nan)
    if count == 0 or len(truth) == 0:
        return which, away
    distance, nearest = cKDTree(truth).query(estimated, distance_upper_bound=gate_px)
    order = np.argsort(distance, kind="stable")
    order = order[np.isfinite(distance[order])]
    _, first = np.unique(nearest[order], return_index=True)
    right = order[first]
    which[right], away[right] = nearest[right], distance[right]
    return which, away
