"""Nodal forces and marker images of a patch of pressure on a pad, compiled."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.special import roots_jacobi

from manytouch.compilation import kernel, no_type_check

SHAPE = 5
"""Number of parameters of the shape of a patch, mm: centre x, y, and the triangular root xx, yx, yy of the
second moment of its pressure."""
CENTRE_X, CENTRE_Y, ROOT_XX, ROOT_YX, ROOT_YY = range(SHAPE)
"""Places of the parameters of the shape."""
DISTRIBUTION_COUNT = 3
"""Number of distributions of unit load over a patch: as its pressure; that times x and y from its centre."""


class Profile(IntEnum):
    """Profile of the pressure along the radius r of a patch with radius 1, from the middle outwards."""

    DOME = 0
    """1 - r^2: that under a ball with a contact radius of 2 to 3 thicknesses of a nearly incompressible pad.
    Under smaller ones it tends to sqrt(1 - r^2) (H. Hertz 1882), which markers hardly show."""
    FLAT = 1
    """(1 - r^2)^(-1/4): near that under a rigid flat face, which slides or sticks, with a radius of .5 to 1.5
    thicknesses. On a half-space it is (1 - r^2)^(-1/2) (J. Boussinesq 1885), on a thinner pad more even."""
    RIM = 2
    """On the rim only: that of a ring."""


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


_EXPONENT = (1.0, -0.25)
"""Exponents of 1 - r^2 in the profiles of a disc. With that of a flat face, the mean of r^4 is that under a
rigid face on the exact layer with a radius of .95 thicknesses, the middle of the range in `Profile.FLAT`."""


def _quadrature(profile: Profile, rings: int, count: int) -> Float64[np.ndarray, "q 3"]:
    """Quadrature of a pressure over a disc with unit second moments: x, y, weight."""
    if profile is Profile.RIM:
        rings, count = 1, rings * count
    place, share = roots_jacobi(rings, 0.0 if profile is Profile.RIM else _EXPONENT[profile], 0.0)
    square = 0.5 * (place + 1.0)
    share /= share.sum()
    angle = 2.0 * np.pi * np.arange(count) / count
    turned = angle[None] + (np.pi / count * (np.arange(rings) % 2))[:, None]
    points = np.stack(
        [
            np.sqrt(square)[:, None] * np.cos(turned),
            np.sqrt(square)[:, None] * np.sin(turned),
            np.repeat(share[:, None] / count, count, axis=1),
        ],
        axis=-1,
    ).reshape(-1, 3)
    points[:, :2] /= np.sqrt((points[:, 2] * points[:, 0] ** 2).sum())
    return points


def _far(points: Float64[np.ndarray, "q 3"]) -> Float64[np.ndarray, "7 3"]:
    """Points x, y, weight with the moments of others up to the fifth order, for patches far away."""
    fourth = float((points[:, 2] * (points[:, :2] ** 2).sum(axis=1) ** 2).sum())
    radius = np.sqrt(fourth / 2.0)
    share = 2.0 / radius**2
    angle = 2.0 * np.pi * np.arange(6) / 6.0
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(6, share / 6.0)], axis=-1)
    return np.vstack([[0.0, 0.0, 1.0 - share], ring])


def _quadratures(rings: int, count: int) -> Float64[np.ndarray, "3 q 3"]:
    """`_quadrature` of each profile."""
    return np.stack([_quadrature(profile, rings, count) for profile in Profile])


POINTS = _quadratures(3, 8)
"""(3, q, 3) quadratures of each profile, for Gaussians at their points, and for nodal forces of narrow
patches."""
FAR_POINTS = np.stack([_far(points) for points in POINTS])
"""(3, 7, 3) for each profile."""
DENSE_POINTS, DENSEST_POINTS = _quadratures(9, 27), _quadratures(15, 45)
"""For nodal forces of patches with roots of more than `_DENSE` and `_DENSEST` elements, on which fewer points
would be separate loads."""
_GAUSSIAN_ROOT_SHARE = np.array([0.5, 0.25, 0.17])
"""Roots of the Gaussians that make up a patch of each profile, over its own: as narrow as the distance of
their places allows."""
_LEAST_PLACED = 0.16
"""Least trace of the second moment of the places of the Gaussians over that of their patch in the gain of
`spread_of`. The narrowest patches are below it: they are one Gaussian, which cannot turn."""
_DENSE, _DENSEST = 0.75, 2.5


@kernel()
@no_type_check
def density(shape: Float64[np.ndarray, " k"], grid: PadGrid) -> int:
    """Which of the quadratures the nodal forces of a patch need: 0, 1 or 2."""
    wide_x = abs(shape[ROOT_XX]) / grid.step_x
    wide_y = np.sqrt(shape[ROOT_YX] * shape[ROOT_YX] + shape[ROOT_YY] * shape[ROOT_YY]) / grid.step_y
    wide = max(wide_x, wide_y)
    return 2 if wide > _DENSEST else 1 if wide > _DENSE else 0


@kernel()
@no_type_check
def moment_trace(shape: Float64[np.ndarray, " k"]) -> float:
    """Trace of the second moment of the pressure of a patch, mm^2."""
    xx, yx, yy = shape[ROOT_XX], shape[ROOT_YX], shape[ROOT_YY]
    return float(xx * xx + yx * yx + yy * yy)


@kernel()
@no_type_check
def radial_arms(shape: Float64[np.ndarray, " k"]) -> tuple[float, float, float]:
    """Matrix xx, yx, yy, 1/mm, by which the place from the centre gives the radial shear over the pressure.

    It is the inverse second moment of the pressure, so that the shear is along the gradient of a dome of
    pressure, across a long contact and not along it: there a pressed pad flows, and an object that sticks
    holds it. The root of its mean square, weighted with the pressure, is that of the unit load times the
    square root of 2. On a round patch the shear is the place over the root of the second moment.
    """
    xx, yx, yy = shape[ROOT_XX], shape[ROOT_YX], shape[ROOT_YY]
    scale = np.sqrt(2.0 / moment_trace(shape)) / abs(xx * yy)
    return scale * (yx * yx + yy * yy), -scale * xx * yx, scale * xx * xx


@kernel()
@no_type_check
def radial_arm_slopes(shape: Float64[np.ndarray, " k"], slope: Float64[np.ndarray, "3 3"]) -> None:
    """Derivatives of `radial_arms` (second index) by the three roots of a shape (first), into `slope`."""
    xx, yx, yy = shape[ROOT_XX], shape[ROOT_YX], shape[ROOT_YY]
    arms, per_trace = radial_arms(shape), 1.0 / moment_trace(shape)
    scale = np.sqrt(2.0 * per_trace) / abs(xx * yy)
    for k in range(3):
        slope[0, k] = -(xx * per_trace + 1.0 / xx) * arms[k]
        slope[1, k] = -yx * per_trace * arms[k]
        slope[2, k] = -(yy * per_trace + 1.0 / yy) * arms[k]
    slope[0, 1], slope[0, 2] = slope[0, 1] - scale * yx, slope[0, 2] + 2.0 * scale * xx
    slope[1, 0], slope[1, 1] = slope[1, 0] + 2.0 * scale * yx, slope[1, 1] - scale * xx
    slope[2, 0] += 2.0 * scale * yy


@kernel()
@no_type_check
def cubic(place: float, count: int, value: Float64[np.ndarray, "4"], slope: Float64[np.ndarray, "4"]) -> int:
    """The four cubic B-splines at a place in elements, and their slopes; returns the number of the first.

    Beyond the ends the splines are those of the end, with slopes of 0.
    """
    inside = min(max(place, 0.0), float(count))
    span = min(int(inside), count - 1)
    if 2 <= span <= count - 3:  # all knots around are one element apart
        t = inside - span
        r = 1.0 - t
        value[0], slope[0] = r * r * r / 6.0, -0.5 * r * r
        value[1], slope[1] = 2.0 / 3.0 + t * t * (0.5 * t - 1.0), t * (1.5 * t - 2.0)
        value[2], slope[2] = 2.0 / 3.0 + r * r * (0.5 * r - 1.0), r * (2.0 - 1.5 * r)
        value[3], slope[3] = t * t * t / 6.0, 0.5 * t * t
        return span
    value[0] = 1.0
    for degree in range(1, 4):
        saved = before = 0.0
        for k in range(degree):
            right = min(float(span + k + 1), float(count))
            left = max(float(span + 1 - degree + k), 0.0)
            part = value[k] / (right - left)
            value[k] = saved + (right - inside) * part
            saved = (inside - left) * part
            slope[k], before = 3.0 * (before - part), part
        value[degree], slope[degree] = saved, 3.0 * before
    if inside != place:
        slope[:] = 0.0
    return span


@kernel()
@no_type_check
def add_pressure(
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
        nodal: result; for each of the distributions of `DISTRIBUTION_COUNT`, on the B-splines along x and y.
    """
    along_x, along_y, unused = np.empty(4), np.empty(4), np.empty(4)
    for k in range(len(points)):
        away_x = shape[ROOT_XX] * points[k, 0]
        away_y = shape[ROOT_YX] * points[k, 0] + shape[ROOT_YY] * points[k, 1]
        place_x = (shape[CENTRE_X] + away_x - grid.corner_x) / grid.step_x
        place_y = (shape[CENTRE_Y] + away_y - grid.corner_y) / grid.step_y
        first_x = cubic(place_x, grid.count_x, along_x, unused)
        first_y = cubic(place_y, grid.count_y, along_y, unused)
        for i in range(4):
            for j in range(4):
                part = points[k, 2] * along_x[i] * along_y[j]
                nodal[0, first_x + i, first_y + j] += part
                nodal[1, first_x + i, first_y + j] += part * away_x
                nodal[2, first_x + i, first_y + j] += part * away_y


@kernel()
@no_type_check
def spread_of(
    shape: Float64[np.ndarray, " k"], profile: int, least_mm: float, most_mm: float
) -> tuple[float, float, float, float, float]:
    """Root of the Gaussians that make up a patch, the triangular root xx, yx, yy of their places, and a gain.

    A Gaussian has the turning shear of its place, and none that grows across it, so that the Gaussians lack a
    part of the torque. The gain of the turn makes up for it.
    """
    a, b, c = shape[ROOT_XX], shape[ROOT_YX], shape[ROOT_YY]
    xx, yx, yy = a * a, a * b, b * b + c * c
    least = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) * (xx - yy) + yx * yx)
    blob = min(_GAUSSIAN_ROOT_SHARE[profile] * np.sqrt(abs(a * c)), 0.9 * np.sqrt(max(least, 0.0)))
    blob = min(max(blob, least_mm), most_mm)
    root_xx = np.sqrt(max(1e-4 * (xx + yy), xx - blob * blob))
    root_yx = yx / root_xx
    root_yy = np.sqrt(max(1e-4 * (xx + yy), yy - blob * blob - root_yx * root_yx))
    placed = root_xx * root_xx + root_yx * root_yx + root_yy * root_yy
    return blob, root_xx, root_yx, root_yy, (xx + yy) / max(placed, _LEAST_PLACED * (xx + yy))


@kernel()
@no_type_check
def _spread_points(
    shape: Float64[np.ndarray, "5"], profile: int, least_mm: float, most_mm: float
) -> tuple[float, Float64[np.ndarray, "q 3"], float]:
    """Root of the Gaussians of a patch, their places from its centre with their weights, and their gain."""
    blob, root_xx, root_yx, root_yy, gain = spread_of(shape, profile, least_mm, most_mm)
    points = POINTS[profile]
    away = points.copy()
    for k in range(len(points)):
        away[k, 0] = root_xx * points[k, 0]
        away[k, 1] = root_yx * points[k, 0] + root_yy * points[k, 1]
    return blob, away, gain


@kernel()
@no_type_check
def add_layer_images(
    shape: Float64[np.ndarray, "5"],
    profile: int,
    table: LayerTable,
    markers: Markers,
    image: Float64[np.ndarray, "5 r"],
) -> None:
    """Add the marker images of a patch on an unbounded layer, by Gaussians at the points of its quadrature.

    Args:
        shape: (5,) parameters.
        profile: of its pressure.
        table: of the layer.
        markers: the markers.
        image: result, for a normal force along -z, shear along x and y, for shear of y and x from the centre
            (a turn), and for radial shear (`radial_arms`), all in proportion to the pressure.
    """
    blob, away, gain = _spread_points(shape, profile, table.root[0], table.root[-1])
    place = np.log(blob / table.root[0]) / np.log(table.root[1] / table.root[0])
    low = min(int(place), len(table.root) - 2)
    above = place - low
    count = table.value.shape[1]
    along = np.empty((count, 5))
    for n in range(count):
        for j in range(5):
            along[n, j] = (1.0 - above) * table.value[low, n, j] + above * table.value[low + 1, n, j]
    per_step = 1.0 / table.step
    total = np.empty((5, 3))
    arm_xx, arm_yx, arm_yy = radial_arms(shape)
    for m in range(len(markers.place)):
        out_x = out_y = up = 0.0
        xx = xy = yy = xz = yz = 0.0
        x_xx = x_xy = x_yy = x_xz = x_yz = 0.0
        y_xx = y_xy = y_yy = y_xz = y_yz = 0.0
        for k in range(len(away)):
            dx = markers.place[m, 0] - shape[CENTRE_X] - away[k, 0]
            dy = markers.place[m, 1] - shape[CENTRE_Y] - away[k, 1]
            distance = np.sqrt(dx * dx + dy * dy)
            first = int(distance * per_step)
            if first >= count - 1:
                continue
            share = distance * per_step - first
            near, far = away[k, 2] * (1.0 - share), away[k, 2] * share
            c, s = dx / max(distance, 1e-12), dy / max(distance, 1e-12)
            press_out = near * along[first, 0] + far * along[first + 1, 0]
            out_x += press_out * c
            out_y += press_out * s
            up += near * along[first, 1] + far * along[first + 1, 1]
            even = near * along[first, 2] + far * along[first + 1, 2]
            turned = near * along[first, 3] + far * along[first + 1, 3]
            shear_up = near * along[first, 4] + far * along[first + 1, 4]
            double_c = (c * c - s * s) * turned
            by_xx, by_xy, by_yy = even + double_c, 2.0 * s * c * turned, even - double_c
            by_xz, by_yz = shear_up * c, shear_up * s
            ax, ay = away[k, 0], away[k, 1]
            xx, xy, yy, xz, yz = xx + by_xx, xy + by_xy, yy + by_yy, xz + by_xz, yz + by_yz
            x_xx, x_xy, x_yy = x_xx + ax * by_xx, x_xy + ax * by_xy, x_yy + ax * by_yy
            y_xx, y_xy, y_yy = y_xx + ay * by_xx, y_xy + ay * by_xy, y_yy + ay * by_yy
            x_xz, x_yz = x_xz + ax * by_xz, x_yz + ax * by_yz
            y_xz, y_yz = y_xz + ay * by_xz, y_yz + ay * by_yz
        total[0, 0], total[0, 1], total[0, 2] = -out_x, -out_y, -up
        total[1, 0], total[1, 1], total[1, 2] = xx, xy, xz
        total[2, 0], total[2, 1], total[2, 2] = xy, yy, yz
        total[3, 0], total[3, 1], total[3, 2] = x_xy - y_xx, x_yy - y_xy, x_yz - y_xz
        total[4, 0] = arm_xx * x_xx + arm_yx * (y_xx + x_xy) + arm_yy * y_xy
        total[4, 1] = arm_xx * x_xy + arm_yx * (y_xy + x_yy) + arm_yy * y_yy
        total[4, 2] = arm_xx * x_xz + arm_yx * (y_xz + x_yz) + arm_yy * y_yz
        total[3] *= gain
        for load in range(5):
            for axis in range(2):
                for j in range(3):
                    image[load, 2 * m + axis] += markers.slope[m, axis, j] * total[load, j]
