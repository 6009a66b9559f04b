"""Nodal forces of a dome of pressure on a pad, compiled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check

SHAPE = 5
"""Parameters of the shape of a patch: centre x, y and the triangular root xx, yx, yy of its second moment."""
SPREADS = 3
"""Loads of a patch: even over its pressure, and proportional to x and to y from its centre."""


class PadGrid(NamedTuple):
    """The B-splines of a pad along x and y, on open uniform knots.

    Attributes:
        corner_x, corner_y: of the outline, mm.
        step_x, step_y: size of an element, mm.
        count_x, count_y: number of elements.
    """

    corner_x: float
    corner_y: float
    step_x: float
    step_y: float
    count_x: int
    count_y: int


class LayerTable(NamedTuple):
    """Displacements around Gaussian tractions on an unbounded layer (`mechanics.pad.layer.radial_table`).

    Attributes:
        value: (g, n, 5) for each root of the Gaussian and distance.
        step: of the distances, mm.
        root: (g,) roots of the second moments, mm, growing by a constant factor.
    """

    value: Float64[np.ndarray, "g n 5"]
    step: float
    root: Float64[np.ndarray, " g"]


class Markers(NamedTuple):
    """The markers of a pad.

    Attributes:
        place: (m, 2) at rest, mm.
        slope: (m, 2, 3) derivative of their images by their positions, px/mm.
    """

    place: Float64[np.ndarray, "m 2"]
    slope: Float64[np.ndarray, "m 2 3"]


def _dome() -> Float64[np.ndarray, "24 3"]:
    """Quadrature of the pressure 1 - r^2 over a disc with unit second moments: x, y, weight."""
    place, weight = np.polynomial.legendre.leggauss(3)
    square = 0.5 * (place + 1.0)
    share = weight * (1.0 - square)
    share /= share.sum()
    angle = 2.0 * np.pi * np.arange(8) / 8.0
    radius = np.sqrt(6.0 * square)  # the second moment of a dome of radius a is a^2 / 6
    turned = angle[None] + np.array([0.0, np.pi / 8.0, 0.0])[:, None]
    points = np.stack(
        [
            radius[:, None] * np.cos(turned),
            radius[:, None] * np.sin(turned),
            np.repeat(share[:, None] / 8.0, 8, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    points[:, :2] /= np.sqrt((points[:, 2] * points[:, 0] ** 2).sum())
    return np.ascontiguousarray(points)


DOME = _dome()


@kernel()
@no_type_check
def _cubic(place: float, count: int, value: Float64[np.ndarray, "4"]) -> int:
    """The four cubic B-splines at a place in elements, into `value`; returns the number of the first."""
    place = min(max(place, 0.0), float(count))
    span = min(int(place), count - 1)
    value[0] = 1.0
    for degree in range(1, 4):
        saved = 0.0
        for k in range(degree):
            right = min(float(span + k + 1), float(count))
            left = max(float(span + 1 - degree + k), 0.0)
            part = value[k] / (right - left)
            value[k] = saved + (right - place) * part
            saved = (place - left) * part
        value[degree] = saved
    return span


@kernel()
@no_type_check
def add_dome(
    shape: Float64[np.ndarray, "5"],
    grid: PadGrid,
    points: Float64[np.ndarray, "q 3"],
    nodal: Float64[np.ndarray, "3 nx ny"],
) -> None:
    """Add the nodal forces of a patch with unit force to `nodal`; points beyond the outline are moved to it.

    Args:
        shape: (5,) parameters.
        grid: of the pad.
        points: (q, 3) quadrature with unit second moments: x, y, weight.
        nodal: result; for each of the loads `SPREADS`, on the B-splines along x and y.
    """
    along_x, along_y = np.empty(4), np.empty(4)
    for k in range(len(points)):
        away_x = shape[2] * points[k, 0]
        away_y = shape[3] * points[k, 0] + shape[4] * points[k, 1]
        first_x = _cubic((shape[0] + away_x - grid.corner_x) / grid.step_x, grid.count_x, along_x)
        first_y = _cubic((shape[1] + away_y - grid.corner_y) / grid.step_y, grid.count_y, along_y)
        for i in range(4):
            for j in range(4):
                part = points[k, 2] * along_x[i] * along_y[j]
                nodal[0, first_x + i, first_y + j] += part
                nodal[1, first_x + i, first_y + j] += part * away_x
                nodal[2, first_x + i, first_y + j] += part * away_y


@kernel()
@no_type_check
def _spread_points(
    shape: Float64[np.ndarray, "5"], least_mm: float, most_mm: float, points: Float64[np.ndarray, "q 3"]
) -> tuple[float, Float64[np.ndarray, "q 3"]]:
    """Root of the Gaussians that make up a patch, and their places from its centre with their weights."""
    xx, yx, yy = shape[2] * shape[2], shape[2] * shape[3], shape[3] * shape[3] + shape[4] * shape[4]
    least = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) * (xx - yy) + yx * yx)
    blob = min(0.65 * np.sqrt(abs(shape[2] * shape[4])), 0.9 * np.sqrt(max(least, 0.0)))
    blob = min(max(blob, least_mm), most_mm)
    root_xx = np.sqrt(max(1e-4 * (xx + yy), xx - blob * blob))
    root_yx = yx / root_xx
    root_yy = np.sqrt(max(1e-4 * (xx + yy), yy - blob * blob - root_yx * root_yx))
    away = points.copy()
    for k in range(len(points)):
        away[k, 0] = root_xx * points[k, 0]
        away[k, 1] = root_yx * points[k, 0] + root_yy * points[k, 1]
    return blob, away


@kernel()
@no_type_check
def _add_shear(
    field: Float64[np.ndarray, "5"],
    direction: tuple[float, float],
    load: tuple[float, float],
    total: Float64[np.ndarray, "3"],
) -> None:
    """Add the displacement by a shear traction `load` (x, y), in a direction (x, y) from it, to `total`."""
    c, s = direction
    double_c, double_s = c * c - s * s, 2.0 * s * c
    total[0] += load[0] * (field[2] + field[3] * double_c) + load[1] * field[3] * double_s
    total[1] += load[0] * field[3] * double_s + load[1] * (field[2] - field[3] * double_c)
    total[2] += field[4] * (load[0] * c + load[1] * s)


@kernel()
@no_type_check
def _field_at(table: LayerTable, place: float, distance: float, field: Float64[np.ndarray, "5"]) -> bool:
    """Interpolate the table at a place among its roots and at a distance, into `field`; False beyond it."""
    first = int(distance / table.step)
    if first >= table.value.shape[1] - 1:
        return False
    low = min(int(place), len(table.root) - 2)
    above, share = place - low, distance / table.step - first
    for j in range(5):
        near = (1.0 - above) * table.value[low, first, j] + above * table.value[low + 1, first, j]
        far = (1.0 - above) * table.value[low, first + 1, j] + above * table.value[low + 1, first + 1, j]
        field[j] = (1.0 - share) * near + share * far
    return True


@kernel()
@no_type_check
def add_layer_images(
    shape: Float64[np.ndarray, "5"],
    table: LayerTable,
    points: Float64[np.ndarray, "q 3"],
    markers: Markers,
    image: Float64[np.ndarray, "5 r"],
) -> None:
    """Add the marker images of a patch on an unbounded layer, by Gaussians at the points of a quadrature.

    Args:
        shape: (5,) parameters.
        table: of the layer.
        points: (q, 3) quadrature with unit second moments: x, y, weight.
        markers: the markers.
        image: result, for a normal force along -z, shear along x and y, and for shear of y and x from the
            centre (a turn) and of x and y from it (a growth), all in proportion to the pressure.
    """
    blob, away = _spread_points(shape, table.root[0], table.root[-1], points)
    place = np.log(blob / table.root[0]) / np.log(table.root[1] / table.root[0])
    field = np.empty(5)
    for m in range(len(markers.place)):
        total = np.zeros((5, 3))
        for k in range(len(points)):
            dx = markers.place[m, 0] - shape[0] - away[k, 0]
            dy = markers.place[m, 1] - shape[1] - away[k, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            if not _field_at(table, place, distance, field):
                continue
            field *= away[k, 2]
            direction = (dx / max(distance, 1e-12), dy / max(distance, 1e-12))
            total[0, 0] -= field[0] * direction[0]
            total[0, 1] -= field[0] * direction[1]
            total[0, 2] -= field[1]
            _add_shear(field, direction, (1.0, 0.0), total[1])
            _add_shear(field, direction, (0.0, 1.0), total[2])
            _add_shear(field, direction, (-away[k, 1], away[k, 0]), total[3])
            _add_shear(field, direction, (away[k, 0], away[k, 1]), total[4])
        for load in range(5):
            for axis in range(2):
                for j in range(3):
                    image[load, 2 * m + axis] += markers.slope[m, axis, j] * total[load, j]
