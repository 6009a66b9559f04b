"""Finds the lattice among unordered dots: the integer row and column of each dot.

It grows from a seed by local prediction. Nothing global is assumed, so rotation, perspective, lens
distortion, oblique axes and uneven rows make no difference; missing dots are bypassed, and false dots fit no
prediction.
Chessboard detectors work in the same way (A. Geiger et al.,
"Automatic camera and range sensor calibration using a single shot", doi:10.1109/ICRA.2012.6224570).
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label
from scipy.spatial import cKDTree

from manytouch.values.arrays import Mask, Points2, read_only

LEAST_DOTS = 4
_NEIGHBOURS = 12
_SEEDS = 12
_GATE = 0.42
_MARGIN = 3
_WINDING_COSINE = 0.35


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lattice:
    """Integer places of dots.

    Attributes:
        place: (n, 2) row and column of each dot, counted from an arbitrary dot; 0 where not a member.
        is_member: (n,) dots that belong to the lattice.
        is_closed: the lattice meets itself or turns by more than about 70 degrees, as spokes and rings do, so
            its places are not rows and columns of a plane.
    """

    place: np.ndarray
    is_member: Mask
    is_closed: bool


def find_lattice(centre_px: Points2) -> Lattice | None:
    """The largest consistent lattice among dots, or None when there is none.

    Args:
        centre_px: (n, 2) centres in any order; the result does not depend on the order.
    """
    if len(centre_px) < LEAST_DOTS:
        return None
    order = np.lexsort((centre_px[:, 1], centre_px[:, 0]))
    points = centre_px[order]
    tree = cKDTree(points)
    spacing = _local_pitch(points, tree)
    best: Lattice | None = None
    most = LEAST_DOTS - 1
    for seed, basis in _seeds(points, tree, spacing):
        grid = _drop_outliers(_grow_from(points, tree, spacing, seed, basis), points, spacing)
        members = int((grid >= 0).sum())
        if members > most:
            most = members
            best = _lattice(grid, points, tree, spacing, order)
        if most > 0.85 * len(points):
            break
    return best


def local_spacing(points: Points2, tree: cKDTree | None = None) -> np.ndarray:
    """(n,) usual distance to the nearest dot around each dot, px."""
    tree = cKDTree(points) if tree is None else tree
    near = min(9, len(points))
    distance, index = tree.query(points, k=near)
    nearest = np.asarray(distance[:, 1])
    return np.asarray(np.median(nearest[index], axis=1))


def _local_pitch(points: Points2, tree: cKDTree) -> np.ndarray:
    """(n,) usual mean distance to the four nearest dots around each dot, so between the two pitches, px."""
    near = min(9, len(points))
    distance, index = tree.query(points, k=near)
    return np.asarray(np.median(distance[:, 1:5].mean(axis=1)[index], axis=1))


def _seeds(points: Points2, tree: cKDTree, spacing: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Dots with two nearly symmetric pairs of neighbours, the most symmetric first, with the (2, 2) basis."""
    near = min(_NEIGHBOURS + 1, len(points))
    distance, index = tree.query(points, k=near)
    vector = points[index[:, 1:]] - points[:, None]
    length = distance[:, 1:]
    asymmetry = np.linalg.norm(vector[:, :, None] + vector[:, None, :], axis=-1)
    mean = 0.5 * (length[:, :, None] + length[:, None, :])
    first, second = np.triu_indices(near - 1, 1)
    half = 0.5 * (vector[:, first] - vector[:, second])
    size = np.linalg.norm(half, axis=2)
    skew = asymmetry[:, first, second] / np.maximum(size, 1e-9)
    is_pair = asymmetry[:, first, second] < 0.4 * mean[:, first, second]
    seed, seed_skew, basis = _bases(half, size, skew, is_pair)
    found = list(zip(seed_skew.tolist(), seed.tolist(), basis, strict=True))
    found.sort(key=lambda item: (round(item[0], 6), item[1]))
    centre = np.median(points, axis=0)
    reach = np.linalg.norm(points - centre, axis=1)
    head = found[: max(_SEEDS, len(found) // 3)]
    head.sort(key=lambda item: (reach[item[1]], item[1]))
    middle = [(dot, basis) for _, dot, basis in head[: _SEEDS // 2]]
    rest = [(dot, basis) for _, dot, basis in found[: _SEEDS - len(middle)]]
    return middle + rest or _corner_seeds(vector, spacing)


def _bases(
    half: np.ndarray, size: np.ndarray, skew: np.ndarray, is_chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The two shortest directions of each dot that are not along each other.

    Args:
        half: (n, k, 2) directions of the dots, px.
        size: (n, k) their lengths.
        skew: (n, k) how far from symmetric they are.
        is_chosen: (n, k) the directions among which two are chosen.

    Returns:
        (s,) the dots that have two; (s,) sum of the skews of the two; (s, 2, 2) the two.
    """
    if half.shape[1] == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 2, 2))
    dot = np.arange(len(half))
    order = np.argsort(np.where(is_chosen, size, np.inf), axis=1, kind="stable")
    first = order[:, 0]
    x, y = np.take_along_axis(half, order[:, :, None], axis=1).transpose(2, 0, 1)
    cross = half[dot, first, 0][:, None] * y - half[dot, first, 1][:, None] * x
    length = np.take_along_axis(size, order, axis=1)
    apart = np.abs(cross) > 0.4 * size[dot, first][:, None] * length
    apart &= np.take_along_axis(is_chosen, order, axis=1)
    seed = np.flatnonzero(apart.any(axis=1))
    first, second = first[seed], order[seed, np.argmax(apart[seed], axis=1)]
    return seed, skew[seed, first] + skew[seed, second], half[seed[:, None], np.column_stack([first, second])]


def _corner_seeds(vector: np.ndarray, spacing: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Seeds of a pattern too small to have a dot between others: its corners (2 x n dots)."""
    size = np.linalg.norm(vector, axis=2)
    seed, _, basis = _bases(vector, size, np.zeros_like(size), np.ones_like(size, dtype=np.bool_))
    is_near = size[seed].min(axis=1, initial=np.inf) < 1.5 * spacing[seed]
    return list(zip(seed[is_near].tolist(), basis[is_near], strict=True))[:_SEEDS]


def _grow_from(
    points: Points2, tree: cKDTree, spacing: np.ndarray, seed: int, basis: np.ndarray
) -> np.ndarray:
    """(rows, columns) index of the dot at each place, -1 where there is none, grown from one dot."""
    grid = np.full((2 * _MARGIN + 3,) * 2, -1)
    middle = _MARGIN + 1
    grid[middle, middle] = seed
    for row, column in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        step = column * basis[0] + row * basis[1]
        distance, index = tree.query(points[seed] + step)
        if distance < _GATE * np.linalg.norm(step) and index != seed:
            grid[middle + row, middle + column] = index
    support = 2
    for _ in range(4 * len(points)):
        added = _add_predicted(grid, points, tree, spacing, support)
        if added:
            support = 2
            grid = _pad(grid)
        elif support > 1:
            support -= 1
        else:
            break
    return grid


def _pad(grid: np.ndarray) -> np.ndarray:
    """The same grid with a margin of empty places on every side."""
    filled = grid >= 0
    rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
    core = grid[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.pad(core, _MARGIN, constant_values=-1)


def predict_positions(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the places of a grid predicted from their neighbours, and from how many of them.

    Args:
        position: (rows, columns, 2) px, NaN where empty.

    Returns:
        (rows, columns, 2) median of the straight continuations along rows and columns and of the
        parallelograms with the neighbours; (rows, columns) number of these.
    """
    padded = np.pad(position, ((2, 2), (2, 2), (0, 0)), constant_values=np.nan)
    rows, columns = position.shape[:2]

    def at(row: int, column: int) -> np.ndarray:
        return padded[2 + row : 2 + row + rows, 2 + column : 2 + column + columns]

    predictions = [2 * at(r, c) - at(2 * r, 2 * c) for r, c in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    predictions += [at(r, 0) + at(0, c) - at(r, c) for r in (-1, 1) for c in (-1, 1)]
    stack = np.stack(predictions)
    support = np.isfinite(stack[..., 0]).sum(axis=0)
    # The empty places are NaN, which are sorted to the end; without any value the median is one of them.
    stack.sort(axis=0)
    row, column = np.indices(support.shape)
    low, high = np.maximum(support - 1, 0) // 2, support // 2
    return (stack[low, row, column] + stack[high, row, column]) / 2.0, support


def _positions(grid: np.ndarray, points: Points2) -> np.ndarray:
    """(rows, columns, 2) px of the dots of a grid, NaN where empty."""
    position = points[np.maximum(grid, 0)]
    position[grid < 0] = np.nan
    return np.asarray(position)


def _add_predicted(
    grid: np.ndarray, points: Points2, tree: cKDTree, spacing: np.ndarray, support: int
) -> bool:
    """Fills, in place, empty places whose prediction has a dot of its own; returns whether any was filled."""
    guess, votes = predict_positions(_positions(grid, points))
    rows, columns = np.nonzero((grid < 0) & (votes >= support))
    if len(rows) == 0:
        return False
    distance, index = tree.query(guess[rows, columns], k=2)
    nearest = index[:, 0]
    is_taken = np.zeros(len(points), dtype=bool)
    is_taken[grid[grid >= 0]] = True
    good = (
        (distance[:, 0] < _GATE * spacing[nearest])
        & (distance[:, 0] < 0.6 * distance[:, 1])
        & ~is_taken[nearest]
    )
    rows, columns, nearest, distance = rows[good], columns[good], nearest[good], distance[good, 0]
    order = np.lexsort((columns, rows, distance))
    _, first = np.unique(nearest[order], return_index=True)
    chosen = order[first]
    grid[rows[chosen], columns[chosen]] = nearest[chosen]
    return len(chosen) > 0


def _drop_outliers(grid: np.ndarray, points: Points2, spacing: np.ndarray) -> np.ndarray:
    """The largest connected part of the grid, without dots that are far from their prediction."""
    guess, votes = predict_positions(_positions(grid, points))
    error = np.linalg.norm(_positions(grid, points) - guess, axis=-1)
    relative = error / spacing[np.maximum(grid, 0)]
    is_checked = (grid >= 0) & (votes >= 3)
    typical = float(np.median(relative[is_checked])) if is_checked.any() else 0.0
    # At corners and ends most predictions are straight continuations, which uneven lines mislead.
    allowed = np.where(votes >= 5, np.clip(6.0 * typical, 0.3, 0.45), 0.45)
    wrong = is_checked & (relative > allowed)
    grid = np.where(wrong, -1, grid)
    parts, number = label(grid >= 0)
    if number == 0:
        return grid
    sizes = np.bincount(parts.ravel())[1:]
    return np.where(parts == 1 + np.argmax(sizes), grid, -1)


def _lattice(
    grid: np.ndarray, points: Points2, tree: cKDTree, spacing: np.ndarray, order: np.ndarray
) -> Lattice:
    rows, columns = np.nonzero(grid >= 0)
    dots = order[grid[rows, columns]]
    place = np.zeros((len(points), 2), dtype=np.int64)
    place[dots] = np.column_stack([rows, columns])
    is_member = np.zeros(len(points), dtype=bool)
    is_member[dots] = True
    return Lattice(
        place=read_only(place),
        is_member=read_only(is_member),
        is_closed=_is_closed(grid, points, tree, spacing),
    )


def _is_closed(grid: np.ndarray, points: Points2, tree: cKDTree, spacing: np.ndarray) -> bool:
    """Whether the lattice meets itself, or turns by more than about 70 degrees from its mean direction."""
    position = _positions(grid, points)
    for axis in (0, 1):
        step = np.diff(position, axis=axis).reshape(-1, 2)
        step = step[np.isfinite(step[:, 0])]
        if len(step) == 0:
            continue
        unit = step / np.linalg.norm(step, axis=1, keepdims=True)
        mean = unit.mean(axis=0)
        size = np.linalg.norm(mean)
        if size < _WINDING_COSINE or np.mean(unit @ mean / size < _WINDING_COSINE) > 0.05:
            return True
    guess, votes = predict_positions(position)
    ahead = (grid < 0) & (votes >= 2)
    distance, index = tree.query(guess[ahead])
    taken = np.isin(index, grid[grid >= 0])
    meets = (distance < 0.3 * spacing[index]) & taken
    return bool(meets.sum() > 0.5 * min((grid >= 0).any(axis=0).sum(), (grid >= 0).any(axis=1).sum()))
