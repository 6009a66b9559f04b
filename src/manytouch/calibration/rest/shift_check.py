"""Could a pattern jump by whole pitches within one frame, and every picture look the same?"""

import numpy as np

from manytouch.calibration.rest.rest_frames import StillDots
from manytouch.tracking import MarkerTracker
from manytouch.tracking.lattice_graph import CLOSED, LatticeGraph
from manytouch.values import Sensor

CANNOT_BE_NOTICED = (
    "The pattern is even, fills the view and its dots are alike: a jump by whole pitches within one frame "
    "cannot be noticed."
)
_EVEN_PITCHES, _EVEN_NOISES = 0.003, 4.0
_ALIKE = (0.015, 0.015)  # area, contrast against the adjacent dots'; noise of a few frames included
_MAD_TO_STD = 1.4826


def jumps_unseen(
    sensor: Sensor, still: StillDots, *, roi_px: tuple[int, int, int, int] | None = None
) -> bool:
    """Does nothing tell a slip by whole pitches: neither rim, gaps, irregularity, nor the dots' looks?

    Args:
        sensor: with a layout that holds `rest_px`.
        still: the dots it was made of, or found by.
        roi_px: the part of the image that is looked at.
    """
    assert sensor.layout is not None
    if sensor.layout.is_missing.any() or len(still.centre_px) < 2:
        return False
    mesh = MarkerTracker(roi_px=roi_px).start(sensor).mesh
    if len(mesh.slip) == 1 or (mesh.kind == CLOSED).any():
        return False
    known = still.noise_px[np.isfinite(still.noise_px)]
    noise = float(np.median(known)) / mesh.usual_px if len(known) else 0.0
    return bool(_unevenness(mesh) < _EVEN_PITCHES + _EVEN_NOISES * noise and _are_alike(still, mesh.usual_px))


def _unevenness(mesh: LatticeGraph) -> float:
    """Median second difference, in pitches, of the displacements that the most even slip implies."""
    least = np.inf
    for slip in mesh.slip[1:]:
        is_on = (slip >= 0) & (slip < mesh.markers)
        is_on[mesh.markers :] = False
        moved = np.full_like(mesh.rest_px, np.nan)
        moved[is_on] = mesh.rest_px[slip[is_on]] - mesh.rest_px[is_on]
        for axis in (0, 2):
            before, after = mesh.opposite[:, axis], mesh.opposite[:, axis + 1]
            inner = (before >= 0) & (after >= 0)
            bend = moved[before[inner]] + moved[after[inner]] - 2.0 * moved[inner]
            length = np.linalg.norm(bend, axis=1)
            length = length[np.isfinite(length)]
            if len(length):
                least = min(least, float(np.median(length)) / mesh.usual_px)
    return least


def _are_alike(still: StillDots, pitch_px: float) -> bool:
    """Do areas and contrasts hardly differ from those of the adjacent dots?"""
    from scipy.spatial import cKDTree

    near = cKDTree(still.centre_px).query_pairs(1.6 * pitch_px, output_type="ndarray")
    if len(near) == 0:
        return False
    for sign, most in zip((still.area_px2, still.contrast), _ALIKE, strict=True):
        total, number = np.zeros(len(sign)), np.zeros(len(sign))
        for a, b in (near.T, near.T[::-1]):
            np.add.at(total, a, sign[b])
            np.add.at(number, a, 1.0)
        off = sign[number > 0] * number[number > 0] / total[number > 0] - 1.0
        if _MAD_TO_STD * np.median(np.abs(off - np.median(off))) > most:
            return False
    return True
