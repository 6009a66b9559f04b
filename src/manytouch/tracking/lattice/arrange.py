"""From dots on a lattice to numbered markers: a rectangle of rows and columns, or a table in a stable order.

Numbering: row 0 is the top of the image, column 0 its left, marker = row * columns + column.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.ndimage import label

from manytouch.tracking.lattice.find import Lattice, find_lattice, local_spacing
from manytouch.values.arrays import Mask, Points2, read_only

_LEAST_MEMBERS = 0.6  # share of the dots that belong to the lattice
_LEAST_FILL = 2 / 3  # share of the places of the rectangle that have dots
_LEAST_BORDER = 1 / 3  # share of the places of a border line that have whole dots
_MOST_TRIMMED = 0.06  # share of the whole dots that the removal of border lines or strays may cost
_MOST_OUTSIDE = 0.1  # share of the places of the rectangle that are empty beyond the outline of the dots
_BAND_GAP = 0.25  # gap between rings or lines of dots, in spacings
_ODD_ANGLE_RAD = 0.1  # no symmetric pattern has two rows as far from this direction
# matrices of integers with determinant 1 or -1: other axes of the same lattice
_CHANGES_OF_BASIS = (
    ((1, 0), (0, 1)),
    ((1, 0), (1, 1)),
    ((1, 0), (-1, 1)),
    ((1, 1), (0, 1)),
    ((1, -1), (0, 1)),
)
# Directions between these angles count as "x", others as "y"; 45 degrees, which is common, is well inside.
_X_FROM_RAD, _X_TO_RAD = np.deg2rad(-38.0), np.deg2rad(52.0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Arrangement:
    """Dots in the order of their markers.

    Attributes:
        dot: (m,) index of the dot of each marker, -1 where the dot is missing.
        row_column: (m, 2), or None when the layout is not a rectangle.
        centre_px: (m, 2) the dots' centres; where one is missing, interpolated by a thin-plate spline.
        pitch_px: (2,) median spacing along x (columns) and y (rows); both are the median neighbour
            distance when there are no rows.
    """

    dot: Int64[np.ndarray, " m"]
    row_column: Int64[np.ndarray, "m 2"] | None
    centre_px: Float64[np.ndarray, "m 2"]
    pitch_px: Float64[np.ndarray, "2"]


def arrange(centre_px: Points2, is_cut: Mask) -> Arrangement:
    """Number dots, which are in any order.

    A border line of the lattice is not part of the rectangle if less than a third of its places have whole
    dots; but if this would remove more than two whole dots and more than 6 % of them, only border lines
    without any whole dot are removed. The result is a table, a layout without rows and columns, if

    - there is no lattice, it is closed (`find.Lattice`), or less than 60 % of the dots are its members; the
      table then has all dots that are not cut, or all if fewer than three of them are whole;
    - the lattice fills less than two thirds of its rectangle, the rectangle is a single line, or more than a
      tenth of it is empty beyond the outline of the dots (cut corners); the table then has the members that
      are not cut, or all dots that are not cut if more than two whole ones and more than 6 % of them are no
      members: strays are fewer, and a lattice need not reach all dots of a pressed sheet.

    Args:
        centre_px: (n, 2) at least one dot.
        is_cut: (n,) dots that the image's border cuts.
    """
    lattice = find_lattice(centre_px)
    is_whole = ~is_cut
    whole = np.flatnonzero(is_whole)
    if lattice is None or lattice.is_closed or lattice.is_member.sum() < _LEAST_MEMBERS * len(centre_px):
        return _table(centre_px, None, whole if len(whole) >= 3 else np.arange(len(centre_px)))
    whole_grid = _choose_grid(lattice, centre_px, is_cut)
    grid = _trim(whole_grid, is_cut)
    fill = (grid >= 0).mean()
    if fill < _LEAST_FILL or min(grid.shape) < 2 or _count_outside(grid) > _MOST_OUTSIDE * grid.size:
        members = np.flatnonzero(lattice.is_member & is_whole)
        if len(whole) - len(members) > max(2, _MOST_TRIMMED * len(whole)):
            return _table(centre_px, None, whole)
        return _table(centre_px, whole_grid, members)
    rows, columns = np.indices(grid.shape)
    position = _fill_gaps(grid, centre_px)
    return Arrangement(
        dot=read_only(grid.ravel().astype(np.int64)),
        row_column=read_only(np.column_stack([rows.ravel(), columns.ravel()]).astype(np.int64)),
        centre_px=read_only(position.reshape(-1, 2)),
        pitch_px=read_only(np.array([_median_step(position, 1), _median_step(position, 0)])),
    )


def _choose_grid(lattice: Lattice, centre_px: Points2, is_cut: Mask) -> np.ndarray:
    """The grid over those two lattice axes whose rectangle is fullest, or the shortest when none is full.

    Of equally good ones (a hexagonal lattice has three) the direction of their rows decides.
    """
    dots = np.flatnonzero(lattice.is_member)
    best: tuple[tuple[float, float, float], np.ndarray] | None = None
    for change in _CHANGES_OF_BASIS:
        grid = _orient(lattice.place[dots] @ np.array(change), dots, centre_px)
        fill = round(float((_trim(grid, is_cut) >= 0).mean()), 2)
        position = _position(grid, centre_px)
        size = float(np.hypot(_median_step(position, 0), _median_step(position, 1)))
        coarse = -round(np.log(size) * 20.0) if np.isfinite(size) else -np.inf
        key = (fill if fill >= _LEAST_FILL else 0.0, coarse, -abs(_slope_rad(position) - _ODD_ANGLE_RAD))
        if best is None or key > best[0]:
            best = (key, grid)
    assert best is not None
    return best[1]


def _slope_rad(position: np.ndarray) -> float:
    """Direction of the rows in the image."""
    step = np.diff(position, axis=1).reshape(-1, 2)
    step = step[np.isfinite(step[:, 0])]
    return float(np.arctan2(*np.median(step, axis=0)[::-1])) if len(step) else 0.0


def _orient(place: np.ndarray, dots: np.ndarray, centre_px: Points2) -> np.ndarray:
    """Grid of dots (rows, columns) turned so that columns run right and rows run down the image."""
    design = np.column_stack([place - place.mean(axis=0), np.ones(len(place))])
    axes = np.linalg.lstsq(design, centre_px[dots], rcond=None)[0][:2]
    angle = np.arctan2(axes[:, 1], axes[:, 0])
    folded = (angle - _X_FROM_RAD) % np.pi
    is_x = folded <= _X_TO_RAD - _X_FROM_RAD
    across = int(np.argmax(is_x)) if is_x[0] != is_x[1] else int(np.argmax(np.abs(np.cos(angle))))
    sign = 1 if np.cos(angle[across] - 0.5 * (_X_FROM_RAD + _X_TO_RAD)) > 0 else -1
    column = sign * place[:, across]
    x_axis, y_axis = sign * axes[across], axes[1 - across]
    row = place[:, 1 - across] * (1 if x_axis[0] * y_axis[1] - x_axis[1] * y_axis[0] > 0 else -1)
    row, column = row - row.min(), column - column.min()
    grid = np.full((row.max() + 1, column.max() + 1), -1)
    grid[row, column] = dots
    return grid


def _trim(grid: np.ndarray, is_cut: Mask) -> np.ndarray:
    """The grid without border lines that have few whole dots, unless that would remove many dots."""
    whole = (grid >= 0) & ~is_cut[np.maximum(grid, 0)]
    top, bottom, left, right = 0, grid.shape[0], 0, grid.shape[1]
    while bottom - top > 1 and right - left > 1:
        part = whole[top:bottom, left:right]
        share = [part[0].mean(), part[-1].mean(), part[:, 0].mean(), part[:, -1].mean()]
        weakest = int(np.argmin(share))
        if share[weakest] >= _LEAST_BORDER:
            break
        top, bottom = top + (weakest == 0), bottom - (weakest == 1)
        left, right = left + (weakest == 2), right - (weakest == 3)
    lost = whole.sum() - whole[top:bottom, left:right].sum()
    if lost > max(2, _MOST_TRIMMED * whole.sum()):
        return _without_cut_borders(grid, whole)
    return grid[top:bottom, left:right]


def _without_cut_borders(grid: np.ndarray, whole: np.ndarray) -> np.ndarray:
    rows, columns = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
    return grid[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def _count_outside(grid: np.ndarray) -> int:
    """Number of empty places beyond the dots' outline: three or more in one piece that meets the border."""
    parts, _ = label(grid < 0)
    border = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    sizes = np.bincount(parts.ravel())[border[border > 0]]
    return int(sizes[sizes >= 3].sum())


def _position(grid: np.ndarray, centre_px: Points2) -> np.ndarray:
    position = centre_px[np.maximum(grid, 0)]
    position[grid < 0] = np.nan
    return np.asarray(position)


def _median_step(position: np.ndarray, axis: int) -> float:
    step = np.linalg.norm(np.diff(position, axis=axis), axis=-1)
    known = step[np.isfinite(step)]
    return float(np.median(known)) if len(known) else float("nan")


def _fill_gaps(grid: np.ndarray, centre_px: Points2) -> np.ndarray:
    """(rows, columns, 2) px of a grid; empty places are interpolated by a thin-plate spline."""
    position = _position(grid, centre_px)
    empty = grid < 0
    if empty.any():
        from scipy.interpolate import RBFInterpolator

        place = np.argwhere(~empty).astype(np.float64)
        near = min(30, len(place))
        spline = RBFInterpolator(
            place, position[~empty], neighbors=near, kernel="thin_plate_spline", degree=1
        )
        position[empty] = spline(np.argwhere(empty).astype(np.float64))
    return position


def _table(centre_px: Points2, grid: np.ndarray | None, dots: np.ndarray) -> Arrangement:
    """Dots that form no rectangle, in an order that noise does not change."""
    if grid is not None:
        numbered = grid[grid >= 0]
        order = numbered[np.isin(numbered, dots)]
    else:
        order = dots[_order_without_lattice(centre_px[dots])]
    points = centre_px[order]
    spacing = float(np.median(local_spacing(points))) if len(points) > 1 else 1.0
    return Arrangement(
        dot=read_only(order.astype(np.int64)),
        row_column=None,
        centre_px=read_only(points.copy()),
        pitch_px=read_only(np.array([spacing, spacing])),
    )


def _bands(value: np.ndarray, gap: float) -> np.ndarray:
    """Number of the band of each value; bands are separated by gaps wider than `gap`."""
    order = np.argsort(value, kind="stable")
    band = np.concatenate([[0], np.cumsum(np.diff(value[order]) > gap)])
    result = np.empty(len(value), dtype=np.int64)
    result[order] = band
    return result


def _has_few_bands(band: np.ndarray) -> bool:
    """Whether there are two or more bands, of four or more dots on average, and none has most of the dots."""
    number = int(band.max()) + 1
    return bool(number >= 2 and 4 * number <= len(band) and np.bincount(band).max() <= 0.6 * len(band))


def _order_without_lattice(points: Points2) -> np.ndarray:
    """By rings and angle where gaps separate rings, else by lines across the image, else roughly by rows."""
    if len(points) < 2:
        return np.arange(len(points))
    spacing = float(np.median(local_spacing(points)))
    away = points - _circle_centre(points)
    rings = _bands(np.linalg.norm(away, axis=1), _BAND_GAP * spacing)
    if _has_few_bands(rings):
        return np.lexsort((_angle_from_widest_gap(np.arctan2(away[:, 1], away[:, 0])), rings))
    lines = _bands(points[:, 1], _BAND_GAP * spacing)
    if _has_few_bands(lines):
        return np.lexsort((points[:, 0], lines))
    return np.lexsort((points[:, 0], np.round(points[:, 1] / spacing)))


def _circle_centre(points: Points2) -> np.ndarray:
    """Centre of the circle through the outermost dots (I. Kasa, doi:10.1109/TIM.1976.6312298)."""
    middle = points.mean(axis=0)
    away = points - middle
    reach = np.linalg.norm(away, axis=1)
    outer = away[reach > 0.9 * reach.max()]
    if len(outer) < 3:
        return np.asarray(middle)
    design = np.column_stack([outer, np.ones(len(outer))])
    solution, _, rank, _ = np.linalg.lstsq(design, (outer**2).sum(axis=1), rcond=None)
    return np.asarray(middle + 0.5 * solution[:2] if rank == 3 else middle)


def _angle_from_widest_gap(angle: np.ndarray) -> np.ndarray:
    """Angles counted from the middle of the widest gap nearest to the left of the image."""
    sorted_angle = np.sort(angle)
    gap = np.diff(np.concatenate([sorted_angle, [sorted_angle[0] + 2 * np.pi]]))
    wide = gap > 0.5 * gap.max()
    middle = sorted_angle + 0.5 * gap
    toward_left = np.where(wide, np.abs(np.angle(np.exp(1j * (middle - np.pi)))), np.inf)
    start = middle[np.argmin(toward_left)]
    return np.asarray((angle - start) % (2 * np.pi))
