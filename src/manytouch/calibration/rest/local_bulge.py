"""The local bulge of a layout: how far dots of one place lie off a smooth lattice, in the plane of the sheet.

A press moves the dots around it apart, so a large bulge at the start of a recording means that the sheet was
pressed then, or that its print is uneven there. It is no measure of whether the sheet is plane.
"""

import numpy as np
from jaxtyping import Int64
from scipy.ndimage import median_filter

from manytouch.tracking.lattice.arrange import Arrangement
from manytouch.values.arrays import Mask, Points2

START_IS_REST = "the start of the recording is taken as rest."
"""End of the sentence on a lattice that departs by more."""
PRESSED_PITCHES = 0.15
"""A larger bulge means that the pattern is uneven there, or the sheet was touched."""
_LEAST_LINES = 5
_ROUNDS = 8
_TUKEY = 4.685


def bulge_in_pitches(arrangement: Arrangement) -> float:
    """The bulge in pitches: the largest local distance that perspective, lens and uneven rows do not explain.

    A robust bicubic surface over (row, column) takes perspective and distortion, free offsets of whole rows
    and columns absorb uneven spacing; the remainder, smoothed over neighbours, is local. 0 when there
    are no rows and columns, or too few.
    """
    if arrangement.row_column is None:
        return 0.0
    local_px = local_bulge_px(arrangement.row_column, arrangement.centre_px, arrangement.dot >= 0)
    return float(local_px / np.sqrt(np.prod(arrangement.pitch_px)))


def local_bulge_px(row_column: Int64[np.ndarray, "m 2"], place_px: Points2, is_known: Mask) -> float:
    """The bulge of places (m, 2) of a full table of markers; see `bulge_in_pitches`.

    Args:
        row_column: of each marker, row by row.
        place_px: positions, or differences from expected ones.
        is_known: (m,) places that count.
    """
    rows, columns = (int(number) + 1 for number in row_column.max(axis=0))
    if min(rows, columns) < _LEAST_LINES or len(row_column) != rows * columns:
        return 0.0
    known = is_known.reshape(rows, columns)
    position = place_px.reshape(rows, columns, 2)
    row, column = (
        2.0 * index / (index.max()) - 1.0 for index in np.indices((rows, columns)).astype(np.float64)
    )
    design = np.stack([row**a * column**b for a in range(4) for b in range(4) if a + b <= 3], axis=-1)
    residual = _robust_residual(design[known], position[known])
    field = np.zeros((rows, columns, 2))
    field[known] = residual
    for axis in (0, 1):
        field -= np.median(field, axis=axis, keepdims=True)
    local = np.stack([median_filter(field[..., axis], size=3, mode="nearest") for axis in (0, 1)], axis=-1)
    return float(np.linalg.norm(local, axis=-1).max())


def _robust_residual(design: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Residuals of a least-squares fit with Tukey's weights."""
    weight = np.ones(len(value))
    residual = value
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)[:, None]
        coefficients, *_ = np.linalg.lstsq(design * root, value * root, rcond=None)
        residual = value - design @ coefficients
        size = np.linalg.norm(residual, axis=1)
        scale = max(1.4826 * float(np.median(size)), 1e-3)
        weight = np.clip(1.0 - (size / (_TUKEY * scale)) ** 2, 0.0, None) ** 2 + 1e-6
    return residual
