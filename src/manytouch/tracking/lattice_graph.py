"""Which markers are neighbours, and what lies around the pattern: what the layout decides of tracking.

Nodes are the markers, in their order, and after them the empty places that continue their lattice beyond the
outline ("ghosts"): a dot on a ghost says that the numbers have slipped.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from manytouch.tracking.interpolation_weights import blends
from manytouch.tracking.lattice.find import find_lattice, predicted
from manytouch.values.arrays import Mask, Points2, read_only

PRESENT, MISSING, CLOSED, OPEN = 0, 1, 2, 3
_NEAR = 20
_NEAR_REACH = 2.4
_ADJACENT_REACH = 1.6
_RINGS = 2
_LEAST_ON_LATTICE = 0.9
_SLIPS = tuple(
    (r, c) for r in range(-2, 3) for c in range(-2, 3) if r * r + c * c > 0 and (abs(r) + abs(c) < 3)
)

Bounds = tuple[float, float, float, float]
Net = tuple[np.ndarray, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LatticeGraph:
    """Neighbourhoods of m markers and of the ghosts around them, N nodes in all, in flat arrays.

    Attributes:
        markers: m.
        is_present: (m,) markers that are not known to be missing.
        present: number of these.
        rest_px: (N, 2) reference centres.
        kind: (N,) PRESENT, MISSING (known to be absent), CLOSED (a ghost that the image shows to be empty at
            rest) or OPEN (a ghost that the image does not show at rest: there may be dots).
        spacing_px: (N,) distance to the nearest neighbour, smoothed over neighbours.
        usual_px: its median.
        start: (N + 1,) where each node's neighbours begin in `near`.
        adjacent_end: (N,) where those of its inner ring end in `near`.
        near: (k,) neighbours of all nodes, of each the nearest first.
        weight: (k,) of each of them in a fit, falling with distance.
        blend: (k,) coefficients that give a marker's displacement from all its neighbours', exact for
            quadratic fields (linear ones at the rim).
        is_blended: (N,) are there such coefficients?
        opposite: (N, 4) neighbours along the two axes of the lattice: before, after, above, below; -1: none.
        slip: (s, N) the node that a node becomes when the numbers slip; -1 beyond the ghosts. Slip 0 is none.
        triangle: (t, 3) Delaunay triangles at rest, all of one orientation, slivers left out.
        bounds_px: x and y, least and largest, between which a dot's centre can be seen.
    """

    markers: int
    is_present: Mask
    present: int
    rest_px: np.ndarray
    kind: np.ndarray
    spacing_px: np.ndarray
    usual_px: float
    start: np.ndarray
    adjacent_end: np.ndarray
    near: np.ndarray
    weight: np.ndarray
    blend: np.ndarray
    is_blended: np.ndarray
    opposite: np.ndarray
    slip: np.ndarray
    triangle: np.ndarray
    bounds_px: np.ndarray

    @property
    def net(self) -> Net:
        """What the kernels take."""
        return (
            *(self.rest_px, self.kind, self.spacing_px, self.start, self.adjacent_end),
            *(self.near, self.weight, self.blend, self.is_blended, self.opposite),
        )


def mesh_of(
    rest_px: Points2,
    is_missing: Mask,
    *,
    row_column: np.ndarray | None = None,
    bounds_px: Bounds = (-np.inf, -np.inf, np.inf, np.inf),
) -> LatticeGraph:
    """Neighbourhoods of any layout, rectangle or table, from its reference centres in the image.

    Args:
        rest_px: (m, 2) centres at rest.
        is_missing: (m,) markers that are known to be absent.
        row_column: (m, 2) places on the lattice; found out when not given.
        bounds_px: least x, y and largest x, y at which a whole dot can be seen.
    """
    markers = len(rest_px)
    place, ghost_place, ghost_px = _lattice_of(rest_px, is_missing, row_column)
    points = np.concatenate([np.asarray(rest_px, dtype=np.float64), ghost_px])
    bounds = np.array(bounds_px, dtype=np.float64)
    is_shown = ((ghost_px > bounds[:2]) & (ghost_px < bounds[2:])).all(axis=1)
    kind = np.concatenate([np.where(is_missing, MISSING, PRESENT), np.where(is_shown, CLOSED, OPEN)])
    spacing, usual_px, start, adjacent_end, near = _neighbours(points, kind == PRESENT)
    weight, blend, is_blended = blends(points, kind == PRESENT, spacing, start, near)
    node_place = np.concatenate([place, ghost_place])
    return LatticeGraph(
        markers=markers,
        is_present=read_only(~is_missing),
        present=int((~is_missing).sum()),
        rest_px=read_only(points),
        kind=read_only(kind.astype(np.uint8)),
        spacing_px=read_only(spacing),
        usual_px=usual_px,
        start=read_only(start),
        adjacent_end=read_only(adjacent_end),
        near=read_only(near.astype(np.int32)),
        weight=read_only(weight.astype(np.float32)),
        blend=read_only(blend.astype(np.float32)),
        is_blended=read_only(is_blended),
        opposite=read_only(
            _moved_by(node_place, ((0, -1), (0, 1), (-1, 0), (1, 0))).T.astype(np.int32, order="C")
        ),
        slip=read_only(
            _moved_by(node_place, ((0, 0), *_SLIPS) if len(ghost_px) else ((0, 0),)).astype(np.int32)
        ),
        triangle=read_only(_triangles(points, np.flatnonzero(kind == PRESENT))),
        bounds_px=read_only(bounds),
    )


def _lattice_of(
    rest_px: Points2, is_missing: Mask, row_column: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (m, 2) of the markers, and places and rest centres (g, 2) of the ghosts; none off a lattice."""
    off = np.full((len(rest_px), 2), np.iinfo(np.int64).min // 4)
    nothing = (off, np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2)))
    place = off.copy()
    if row_column is not None:
        place[:] = row_column
    else:
        present = np.flatnonzero(~is_missing)
        lattice = find_lattice(rest_px[present])
        if lattice is None or lattice.winds or lattice.is_member.mean() < _LEAST_ON_LATTICE:
            return nothing
        members = present[lattice.is_member]
        place[members] = lattice.place[lattice.is_member]
    member = np.flatnonzero(place[:, 0] >= 0)
    if len(member) < 4 or np.ptp(place[member], axis=0).min() < 1:
        return nothing
    low = place[member].min(axis=0) - _RINGS
    shape = place[member].max(axis=0) + _RINGS + 1 - low
    position = np.full((*shape, 2), np.nan)
    position[tuple((place[member] - low).T)] = rest_px[member]
    is_marker = np.isfinite(position[..., 0])
    for _ in range(_RINGS):
        told, _ = predicted(position)
        empty = np.isnan(position[..., 0])
        position[empty] = told[empty]
    ghosts = np.argwhere(np.isfinite(position[..., 0]) & ~is_marker)
    return place, ghosts + low, position[tuple(ghosts.T)]


def _moved_by(place: np.ndarray, steps: tuple[tuple[int, int], ...]) -> np.ndarray:
    """(s, N) index of the node at each node's place plus a step, -1 where there is none."""
    known = np.flatnonzero(place[:, 0] > np.iinfo(np.int64).min // 8)
    moved = np.full((len(steps), len(place)), -1, dtype=np.int32)
    moved[[k for k, step in enumerate(steps) if step == (0, 0)]] = np.arange(len(place))
    if len(known) == 0:
        return moved
    low = place[known].min(axis=0)
    shape = place[known].max(axis=0) - low + 1
    grid = np.full(shape + 4, -1)
    grid[tuple((place[known] - low + 2).T)] = known
    for k, step in enumerate(steps):
        moved[k, known] = grid[tuple((place[known] - low + 2 + np.array(step)).T)]
    return moved


def _neighbours(
    points: Points2, is_present: Mask
) -> tuple[np.ndarray, float, np.ndarray, np.ndarray, np.ndarray]:
    """Spacing (N,), its median, and the neighbours of all nodes as `LatticeGraph` holds them."""
    present = np.flatnonzero(is_present)
    number = len(points)
    near = min(_NEAR + 1, number)
    none = np.zeros(0, dtype=np.int64)
    if len(present) < 2:
        start = np.zeros(number + 1, dtype=np.int64)
        return np.full(number, 100.0), 100.0, start, start[:-1].copy(), none
    distance, index = cKDTree(points).query(points, k=near)
    distance, index = np.atleast_2d(distance)[:, 1:], np.atleast_2d(index)[:, 1:]
    among = min(_NEAR + 1, len(present))
    own, own_index = cKDTree(points[present]).query(points[present], k=among)
    own, own_index = own[:, 1:], own_index[:, 1:]
    # The mean of the four nearest is between the two pitches of a lattice that is not square.
    reach = np.median(own[:, : min(4, among - 1)].mean(axis=1)[own_index[:, :4]], axis=1)
    nearest = np.median(own[own_index[:, :4], 0], axis=1)
    _, to_present = cKDTree(points[present]).query(points)
    spacing, wide = nearest[to_present], reach[to_present]
    within = distance <= _NEAR_REACH * wide[:, None]
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
