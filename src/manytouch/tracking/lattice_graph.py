"""The graph of a layout: which nodes are neighbours, and what lies around the pattern.

Nodes are the markers, in their order, and after them the exterior nodes: empty positions that continue their
lattice beyond the outline. A dot on an exterior node is evidence that identities are shifted.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from manytouch.tracking.lattice.find import find_lattice, predict_positions
from manytouch.tracking.neighbour_prediction import interpolation_weights
from manytouch.values.arrays import Mask, Points2, read_only

PRESENT, MISSING, EXTERIOR_VISIBLE, EXTERIOR_HIDDEN = 0, 1, 2, 3
"""Kinds of nodes: markers; markers that are known to be missing; exterior nodes that the image shows to be
empty at rest; exterior nodes that the image does not show at rest, where there may be dots."""

_NEIGHBOURS = 20
_NEIGHBOUR_REACH = 2.4
_ADJACENT_REACH = 1.6
_EXTERIOR_RINGS = 2
_LEAST_ON_LATTICE = 0.9
_SHIFTS = tuple(
    (r, c) for r in range(-2, 3) for c in range(-2, 3) if r * r + c * c > 0 and (abs(r) + abs(c) < 3)
)
_OPPOSITE = ((0, -1), (0, 1), (-1, 0), (1, 0))
_NO_PLACE = np.iinfo(np.int64).min // 4

Bounds = tuple[float, float, float, float]


class GraphArrays(NamedTuple):
    """The graph of N nodes, the first m of which are markers, in the arrays that kernels take.

    Attributes:
        rest_px: (N, 2) reference centres.
        kind: (N,) PRESENT, MISSING, EXTERIOR_VISIBLE or EXTERIOR_HIDDEN.
        spacing_px: (N,) distance to the nearest neighbour, smoothed over neighbours.
        start: (N + 1,) where the neighbours of each node begin in `neighbour`.
        adjacent_end: (N,) where those of its inner ring end in `neighbour`.
        neighbour: (k,) neighbours of all nodes, of each the nearest first.
        weight: (k,) of each of them in a fit, falling with distance.
        interpolation: (k,) coefficients that give a marker's displacement from all its neighbours', exact for
            quadratic fields, or for affine ones where few neighbours are present or a quadratic fit would
            amplify noise; 0 of neighbours that are not present.
        is_interpolated: (N,) nodes that have such coefficients.
        opposite: (N, 4) adjacent nodes along the lattice: column before, after, row before, after; -1: none.
        shifted: (s, N) the node that each becomes after a shift; -1 beyond the exterior nodes. The first
            shift is none.
        triangle: (t, 3) Delaunay triangles at rest, all of one orientation, slivers left out.
        bounds_px: (4,) least x, y and largest x, y of the centre of a dot that is wholly in the image.
    """

    rest_px: np.ndarray
    kind: np.ndarray
    spacing_px: np.ndarray
    start: np.ndarray
    adjacent_end: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray
    interpolation: np.ndarray
    is_interpolated: np.ndarray
    opposite: np.ndarray
    shifted: np.ndarray
    triangle: np.ndarray
    bounds_px: np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LatticeGraph:
    """The graph of a layout.

    Attributes:
        marker_count: m.
        is_present: (m,) markers that are not known to be missing.
        expected_count: number of these that are wholly in the image at rest.
        spacing_px: median of their spacings.
        arrays: neighbourhoods, exterior nodes and shifts.
    """

    marker_count: int
    is_present: Mask
    expected_count: int
    spacing_px: float
    arrays: GraphArrays

    @property
    def can_be_shifted(self) -> bool:
        """Whether the layout is a lattice, along which identities may be shifted."""
        return len(self.arrays.shifted) > 1

    def is_expected(self, position_px: Points2) -> Mask:
        """(m,) markers that are wholly in the image if they are at these positions (m, 2)."""
        return np.asarray(self.is_present & _is_shown(position_px, self.arrays.bounds_px))


def build_lattice_graph(
    rest_px: Points2,
    is_missing: Mask,
    *,
    row_column: np.ndarray | None = None,
    bounds_px: Bounds = (-np.inf, -np.inf, np.inf, np.inf),
) -> LatticeGraph:
    """The graph of any layout, rectangle or table, from its reference centres in the image.

    Args:
        rest_px: (m, 2) centres at rest.
        is_missing: (m,) markers that are known to be absent.
        row_column: (m, 2) places on the lattice; found from the centres when not given.
        bounds_px: least x, y and largest x, y of the centre of a dot that is wholly in the image.
    """
    place, exterior_place, exterior_px = _extend_lattice(rest_px, is_missing, row_column)
    points = np.concatenate([np.asarray(rest_px, dtype=np.float64), exterior_px])
    bounds = np.array(bounds_px, dtype=np.float64)
    exterior_kind = np.where(_is_shown(exterior_px, bounds), EXTERIOR_VISIBLE, EXTERIOR_HIDDEN)
    kind = np.concatenate([np.where(is_missing, MISSING, PRESENT), exterior_kind])
    spacing, spacing_px, start, adjacent_end, neighbour = _neighbours(points, kind == PRESENT)
    weight, interpolation, is_interpolated = interpolation_weights(
        points, kind == PRESENT, spacing, start, neighbour
    )
    node_place = np.concatenate([place, exterior_place])
    shifts = ((0, 0), *_SHIFTS) if len(exterior_px) else ((0, 0),)
    arrays = GraphArrays(
        rest_px=read_only(points),
        kind=read_only(kind.astype(np.uint8)),
        spacing_px=read_only(spacing),
        start=read_only(start),
        adjacent_end=read_only(adjacent_end),
        neighbour=read_only(neighbour.astype(np.int32)),
        weight=read_only(weight.astype(np.float32)),
        interpolation=read_only(interpolation.astype(np.float32)),
        is_interpolated=read_only(is_interpolated),
        opposite=read_only(_nodes_at_steps(node_place, _OPPOSITE).T.astype(np.int32, order="C")),
        shifted=read_only(_nodes_at_steps(node_place, shifts)),
        triangle=read_only(_triangles(points, np.flatnonzero(kind == PRESENT))),
        bounds_px=read_only(bounds),
    )
    return LatticeGraph(
        marker_count=len(rest_px),
        is_present=read_only(~is_missing),
        expected_count=int((~is_missing & _is_shown(rest_px, bounds)).sum()),
        spacing_px=spacing_px,
        arrays=arrays,
    )


def _is_shown(points: Points2, bounds_px: np.ndarray) -> Mask:
    """Which of the points (n, 2) are inside the bounds: least x, y and largest x, y."""
    return np.asarray(((points > bounds_px[:2]) & (points < bounds_px[2:])).all(axis=1))


def _extend_lattice(
    rest_px: Points2, is_missing: Mask, row_column: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (m, 2) of the markers; places and rest centres (g, 2) of the exterior nodes of a lattice."""
    off = np.full((len(rest_px), 2), _NO_PLACE)
    nothing = (off, np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2)))
    place = off.copy()
    if row_column is not None:
        place[:] = row_column
    else:
        present = np.flatnonzero(~is_missing)
        lattice = find_lattice(rest_px[present])
        if lattice is None or lattice.is_closed or lattice.is_member.mean() < _LEAST_ON_LATTICE:
            return nothing
        members = present[lattice.is_member]
        place[members] = lattice.place[lattice.is_member]
    member = np.flatnonzero(place[:, 0] >= 0)
    if len(member) < 4 or np.ptp(place[member], axis=0).min() < 1:
        return nothing
    low = place[member].min(axis=0) - _EXTERIOR_RINGS
    shape = place[member].max(axis=0) + _EXTERIOR_RINGS + 1 - low
    position = np.full((*shape, 2), np.nan)
    position[tuple((place[member] - low).T)] = rest_px[member]
    is_marker = np.isfinite(position[..., 0])
    for _ in range(_EXTERIOR_RINGS):
        predicted, _ = predict_positions(position)
        empty = np.isnan(position[..., 0])
        position[empty] = predicted[empty]
    exterior = np.argwhere(np.isfinite(position[..., 0]) & ~is_marker)
    return place, exterior + low, position[tuple(exterior.T)]


def _nodes_at_steps(place: np.ndarray, steps: tuple[tuple[int, int], ...]) -> np.ndarray:
    """(s, N) int32 node at each node's place plus a step, -1 where there is none."""
    known = np.flatnonzero(place[:, 0] > _NO_PLACE // 2)
    found = np.full((len(steps), len(place)), -1, dtype=np.int32)
    found[[k for k, step in enumerate(steps) if step == (0, 0)]] = np.arange(len(place))
    if len(known) == 0:
        return found
    low = place[known].min(axis=0)
    shape = place[known].max(axis=0) - low + 1
    grid = np.full(shape + 4, -1)
    grid[tuple((place[known] - low + 2).T)] = known
    for k, step in enumerate(steps):
        found[k, known] = grid[tuple((place[known] - low + 2 + np.array(step)).T)]
    return found


def _neighbours(
    points: Points2, is_present: Mask
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray, np.ndarray]:
    """Spacing (N,), its median, and the neighbours of all nodes as in `GraphArrays`."""
    present = np.flatnonzero(is_present)
    number = len(points)
    near = min(_NEIGHBOURS + 1, number)
    none = np.zeros(0, dtype=np.int64)
    if len(present) < 2:
        start = np.zeros(number + 1, dtype=np.int64)
        # px; a choice: without neighbours no spacing is known, but gates are shares of it
        return np.full(number, 100.0), 100.0, start, start[:-1].copy(), none
    distance, index = cKDTree(points).query(points, k=near)
    distance, index = np.atleast_2d(distance)[:, 1:], np.atleast_2d(index)[:, 1:]
    among = min(_NEIGHBOURS + 1, len(present))
    own, own_index = cKDTree(points[present]).query(points[present], k=among)
    own, own_index = own[:, 1:], own_index[:, 1:]
    # The mean of the four nearest is between the two pitches of a lattice that is not square.
    reach = np.median(own[:, : min(4, among - 1)].mean(axis=1)[own_index[:, :4]], axis=1)
    nearest = np.median(own[own_index[:, :4], 0], axis=1)
    _, to_present = cKDTree(points[present]).query(points)
    spacing, wide = nearest[to_present], reach[to_present]
    within = distance <= _NEIGHBOUR_REACH * wide[:, None]
    start = np.concatenate([[0], np.cumsum(within.sum(axis=1))]).astype(np.int64)
    adjacent = (distance <= _ADJACENT_REACH * wide[:, None]).sum(axis=1)
    return (
        np.ascontiguousarray(spacing),
        float(np.median(spacing[present])),
        start,
        start[:-1] + adjacent,
        index[within].astype(np.int64),
    )


def _triangles(points: Points2, present: np.ndarray) -> np.ndarray:
    if len(present) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    chosen = points[present]
    try:
        corner = Delaunay(chosen).simplices
    except QhullError:  # all dots on one line: nothing can fold
        return np.zeros((0, 3), dtype=np.int64)
    edge_a = chosen[corner[:, 1]] - chosen[corner[:, 0]]
    edge_b = chosen[corner[:, 2]] - chosen[corner[:, 0]]
    twice_area = edge_a[:, 0] * edge_b[:, 1] - edge_a[:, 1] * edge_b[:, 0]
    corner = np.where((twice_area > 0)[:, None], corner, corner[:, [0, 2, 1]])
    edges = chosen[corner] - chosen[np.roll(corner, 1, axis=1)]
    longest = np.linalg.norm(edges, axis=-1).max(axis=1)
    return np.asarray(present[corner[np.abs(twice_area) > 0.25 * longest**2]], dtype=np.int64)
