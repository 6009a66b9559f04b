"""Check whether a shift of a pattern by whole pitches within one frame could be detected."""

import numpy as np

from manytouch.calibration.rest_dots import RestDots
from manytouch.tracking import MarkerTracker
from manytouch.tracking.lattice_graph import EXTERIOR_VISIBLE, LatticeGraph
from manytouch.values import Roi, Sensor

UNDETECTABLE_SHIFT = (
    "The pattern is regular, fills the view and its dots are alike: a shift by whole pitches within one "
    "frame cannot be detected."
)
_REGULAR_PITCHES, _REGULAR_NOISES = 0.003, 4.0
_EQUAL_SHARE = (
    0.015,
    0.015,
)  # spread of area and contrast relative to adjacent dots, with the noise of a few frames
_MAD_TO_STD = 1.4826


def shift_is_undetectable(sensor: Sensor, still: RestDots, *, roi_px: Roi | None = None) -> bool:
    """Whether neither border, gaps, irregularity nor dot appearance distinguish a shift by whole pitches.

    Args:
        sensor: with a layout that contains `rest_px`.
        still: the dots that the layout was made from, or registered with.
        roi_px: region of interest.
    """
    assert sensor.layout is not None
    if sensor.layout.is_missing.any() or len(still.centre_px) < 2:
        return False
    graph = MarkerTracker(roi_px=roi_px).start(sensor).graph
    if not graph.can_be_shifted or (graph.arrays.kind == EXTERIOR_VISIBLE).any():
        return False
    known = still.noise_px[np.isfinite(still.noise_px)]
    noise = float(np.median(known)) / graph.spacing_px if len(known) else 0.0
    return bool(
        _irregularity(graph) < _REGULAR_PITCHES + _REGULAR_NOISES * noise
        and _have_equal_appearance(still, graph.spacing_px)
    )


def _irregularity(graph: LatticeGraph) -> float:
    """Median second difference, in pitches, of the displacements implied by the most regular shift."""
    arrays, markers, rest = graph.arrays, graph.marker_count, graph.arrays.rest_px
    least = np.inf
    for shifted in arrays.shifted[1:]:
        is_on = (shifted >= 0) & (shifted < markers)
        is_on[markers:] = False
        moved = np.full_like(rest, np.nan)
        moved[is_on] = rest[shifted[is_on]] - rest[is_on]
        for axis in (0, 2):
            before, after = arrays.opposite[:, axis], arrays.opposite[:, axis + 1]
            inner = (before >= 0) & (after >= 0)
            bend = moved[before[inner]] + moved[after[inner]] - 2.0 * moved[inner]
            length = np.linalg.norm(bend, axis=1)
            length = length[np.isfinite(length)]
            if len(length):
                least = min(least, float(np.median(length)) / graph.spacing_px)
    return least


def _have_equal_appearance(still: RestDots, pitch_px: float) -> bool:
    """Whether areas and contrasts hardly differ from those of the adjacent dots."""
    from scipy.spatial import cKDTree

    near = cKDTree(still.centre_px).query_pairs(1.6 * pitch_px, output_type="ndarray")
    if len(near) == 0:
        return False
    for sign, most in zip((still.area_px2, still.contrast), _EQUAL_SHARE, strict=True):
        total, number = np.zeros(len(sign)), np.zeros(len(sign))
        for a, b in (near.T, near.T[::-1]):
            np.add.at(total, a, sign[b])
            np.add.at(number, a, 1.0)
        off = sign[number > 0] * number[number > 0] / total[number > 0] - 1.0
        if _MAD_TO_STD * np.median(np.abs(off - np.median(off))) > most:
            return False
    return True
