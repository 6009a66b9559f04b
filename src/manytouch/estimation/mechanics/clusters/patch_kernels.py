"""Fits one or two patches, a ring, or a bar of pressure to nodal forces, compiled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import kernel, no_type_check

ONE = 6
"""Number of parameters of one patch: force, x, y, and the triangular root xx, yx, yy of its second moment.
Two patches have 7: force, x, y of each, and the standard deviation of both along each axis."""
RING = 4
"""Number of parameters of a thin ring: force, x, y, radius."""
BAR = 8
"""Number of parameters of a bar: force, x, y of its middle, half its length along x and y, half its width,
and the tilt and the end load of its profile. The pressure at a share s of half the length is proportional to
exp(T tanh(tilt) s + E tanh(end) s^2)."""
MAX_TILT, MAX_END = 1.0, 1.5
"""T and E. The pressure in the middle is at least exp(-1.5) of that at both ends: with less, a bar would
describe two balls as well as two patches do (ADR 84)."""
RIM = 9
"""Number of parameters of an elliptic face: force, x, y, the triangular root xx, yx, yy of the second moment
that it would have under even pressure, the load of its rim, and two that are 0. The pressure at a share s of
its radius is proportional to exp(R tanh(load) s^2)."""
MAX_RIM = 3.0
"""R."""
_RIM_ANGLES = 12
_RING_POINTS = 24

Knots = Float64[np.ndarray, " knots"]
Parameters = Float64[np.ndarray, " p"]


class NodeGrid(NamedTuple):
    """The splines whose nodal forces are known.

    Attributes:
        knot_x, knot_y: knots along x and y.
        local: (nx, ny) number of each spline function's node among the n nodes, or -1.
        shear: a of the sheet, mm^2; a point force has the nodal forces B_j - a lap B_j.
        share_x, share_y: (2, 2) of the outer two functions along x and y in the next two
            (`SplinePatch.end_shares`).
    """

    knot_x: Knots
    knot_y: Knots
    local: Int64[np.ndarray, "nx ny"]
    shear: float
    share_x: Float64[np.ndarray, "2 2"]
    share_y: Float64[np.ndarray, "2 2"]


class Whitened(NamedTuple):
    """The likelihood of n nodal forces.

    Attributes:
        white: (q, n) combinations, each divided by its standard deviation.
        aim: (q,) their most likely values.
    """

    white: Float64[np.ndarray, "q n"]
    aim: Float64[np.ndarray, " q"]


_PLACE = 2.0 * np.cos(np.pi * np.arange(1, 6) / 6.0)  # in standard deviations
_WEIGHT = np.sin(np.pi * np.arange(1, 6) / 6.0) ** 2 / 3.0


@kernel()
@no_type_check
def _basis(
    knot: Knots, place: float, value: Float64[np.ndarray, "4"], curvature: Float64[np.ndarray, "4"]
) -> int:
    """The four cubic B-splines at a place (Cox-de Boor), into `value`, and their second derivatives, into
    `curvature`; returns the number of the first."""
    place = min(max(place, knot[3]), knot[-4])
    span = 3
    while span < len(knot) - 5 and place >= knot[span + 1]:
        span += 1
    value[0] = 1.0
    for degree in range(1, 4):
        if degree == 2:  # value has the two linear functions
            first = 2.0 * value[0] / (knot[span + 1] - knot[span - 1])
            second = 2.0 * value[1] / (knot[span + 2] - knot[span])
            # derivatives of the three quadratic functions, over the lengths of their supports
            low = -first / (knot[span + 1] - knot[span - 2])
            middle = (first - second) / (knot[span + 2] - knot[span - 1])
            high = second / (knot[span + 3] - knot[span])
            curvature[0], curvature[1] = -3.0 * low, 3.0 * (low - middle)
            curvature[2], curvature[3] = 3.0 * (middle - high), 3.0 * high
        saved = 0.0
        for k in range(degree):
            right, left = knot[span + k + 1], knot[span + 1 - degree + k]
            part = value[k] / (right - left)
            value[k] = saved + (right - place) * part
            saved = (place - left) * part
        value[degree] = saved
    return span - 3


@kernel()
@no_type_check
def _move_inside(
    first: int,
    count: int,
    share: Float64[np.ndarray, "2 2"],
    value: Float64[np.ndarray, "4"],
    curvature: Float64[np.ndarray, "4"],
) -> None:
    """Add the shares of the outer functions, of `count` along an axis, to the functions inside."""
    if 1 < first < count - 5:
        return
    for side in range(2):
        for i in range(2):
            outer = (count - 1 - i if side else i) - first
            if 0 <= outer < 4:
                for j in range(2):
                    inner = (count - 3 - j if side else 2 + j) - first
                    if 0 <= inner < 4:
                        value[inner] += share[i, j] * value[outer]
                        curvature[inner] += share[i, j] * curvature[outer]


@kernel()
@no_type_check
def add_point(grid: NodeGrid, force: float, x: float, y: float, nodal: Float64[np.ndarray, " n"]) -> None:
    """Add the nodal forces of a point force to `nodal`; those on other nodes are left out."""
    along_x, along_y, curved_x, curved_y = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    first_x = _basis(grid.knot_x, x, along_x, curved_x)
    first_y = _basis(grid.knot_y, y, along_y, curved_y)
    _move_inside(first_x, grid.local.shape[0], grid.share_x, along_x, curved_x)
    _move_inside(first_y, grid.local.shape[1], grid.share_y, along_y, curved_y)
    for i in range(4):
        for j in range(4):
            k = grid.local[first_x + i, first_y + j]
            if k >= 0:
                laplacian = curved_x[i] * along_y[j] + along_x[i] * curved_y[j]
                nodal[k] += force * (along_x[i] * along_y[j] - grid.shear * laplacian)


@kernel()
@no_type_check
def add_patch(grid: NodeGrid, patch: Parameters, nodal: Float64[np.ndarray, " n"]) -> None:
    """Add the nodal forces of a uniform elliptical patch to `nodal`, by 25 quadrature points.

    The density of an ellipse along an axis is a semicircle, for which these points and weights are Gauss's
    (of Chebyshev's second kind).

    Args:
        grid: of the nodes; forces on other nodes are left out.
        patch: (6,) force, x, y and the lower triangle xx, yx, yy of a root of its second moment.
        nodal: result.
    """
    force, x, y, xx, yx, yy = patch[0], patch[1], patch[2], patch[3], patch[4], patch[5]
    for a in range(5):
        for b in range(5):
            share = force * _WEIGHT[a] * _WEIGHT[b]
            at_y = y + _PLACE[a] * yx + _PLACE[b] * yy
            add_point(grid, share, x + _PLACE[a] * xx, at_y, nodal)


@kernel()
@no_type_check
def add_ring(grid: NodeGrid, ring: Parameters, nodal: Float64[np.ndarray, " n"]) -> None:
    """Add the nodal forces of a thin ring with even pressure to `nodal`, by points on the circle.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        ring: (4,) force, x, y, radius.
        nodal: result.
    """
    for point in range(_RING_POINTS):
        angle = 2.0 * np.pi * point / _RING_POINTS
        x, y = ring[1] + ring[3] * np.cos(angle), ring[2] + ring[3] * np.sin(angle)
        add_point(grid, ring[0] / _RING_POINTS, x, y, nodal)


ALONG, _ALONG_WEIGHT = np.polynomial.legendre.leggauss(7)
_ACROSS, _ACROSS_WEIGHT = np.polynomial.legendre.leggauss(3)


@kernel()
@no_type_check
def bar_profile(bar: Parameters) -> Float64[np.ndarray, "7"]:
    """Shares of the force of a bar at `ALONG` of half its length."""
    tilt, end = MAX_TILT * np.tanh(bar[6]), MAX_END * np.tanh(bar[7])
    weight = _ALONG_WEIGHT * np.exp(tilt * ALONG + end * ALONG**2)
    return np.asarray(weight / weight.sum())


@kernel()
@no_type_check
def add_bar(grid: NodeGrid, bar: Parameters, nodal: Float64[np.ndarray, " n"]) -> None:
    """Add the nodal forces of a bar to `nodal`, by 7 x 3 Gauss points.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        bar: (8,) see `BAR`.
        nodal: result.
    """
    length = max(np.hypot(bar[3], bar[4]), 1e-9)
    across_x, across_y = -bar[5] * bar[4] / length, bar[5] * bar[3] / length
    weight = bar_profile(bar)
    for a in range(len(ALONG)):
        for b in range(len(_ACROSS)):
            share = bar[0] * weight[a] * 0.5 * _ACROSS_WEIGHT[b]
            x = bar[1] + ALONG[a] * bar[3] + _ACROSS[b] * across_x
            y = bar[2] + ALONG[a] * bar[4] + _ACROSS[b] * across_y
            add_point(grid, share, x, y, nodal)


_SQUARE, _SQUARE_WEIGHT = np.polynomial.legendre.leggauss(4)
_SQUARE = 0.5 * (_SQUARE + 1.0)  # squared shares of the radius, in which the area of an ellipse is even
_RADIUS = np.sqrt(_SQUARE)


def rim_radii() -> Float64[np.ndarray, "4"]:
    """Shares of the radius of an elliptic face at which its pressure acts."""
    return _RADIUS


@kernel()
@no_type_check
def rim_profile(face: Parameters) -> Float64[np.ndarray, "4"]:
    """Shares of the force of an elliptic face at `rim_radii`."""
    weight = _SQUARE_WEIGHT * np.exp(MAX_RIM * np.tanh(face[6]) * _SQUARE)
    return np.asarray(weight / weight.sum())


@kernel()
@no_type_check
def add_rim(grid: NodeGrid, face: Parameters, nodal: Float64[np.ndarray, " n"]) -> None:
    """Add the nodal forces of an elliptic face to `nodal`, by 4 x 12 points.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        face: (9,) see `RIM`.
        nodal: result.
    """
    weight = rim_profile(face)
    for a in range(len(weight)):
        share = face[0] * weight[a] / _RIM_ANGLES
        for b in range(_RIM_ANGLES):
            angle = 2.0 * np.pi * (b + 0.5 * (a % 2)) / _RIM_ANGLES
            u, v = 2.0 * _RADIUS[a] * np.cos(angle), 2.0 * _RADIUS[a] * np.sin(angle)
            add_point(grid, share, face[1] + face[3] * u, face[2] + face[4] * u + face[5] * v, nodal)


@kernel()
@no_type_check
def add_patches(theta: Parameters, grid: NodeGrid, nodal: Float64[np.ndarray, " n"]) -> None:
    """Add the nodal forces of a patch (6,), two (7,), a ring (4,), a bar (8,) or a face (9,) to `nodal`."""
    if len(theta) == ONE:
        add_patch(grid, theta, nodal)
    elif len(theta) == RING:
        add_ring(grid, theta, nodal)
    elif len(theta) == BAR:
        add_bar(grid, theta, nodal)
    elif len(theta) == RIM:
        add_rim(grid, theta, nodal)
    else:
        patch = np.zeros(ONE)
        patch[3] = patch[5] = theta[6]
        for k in (0, 3):
            if theta[k] != 0.0:
                patch[:3] = theta[k : k + 3]
                add_patch(grid, patch, nodal)


@kernel()
@no_type_check
def _residual(
    theta: Parameters, grid: NodeGrid, likelihood: Whitened, result: Float64[np.ndarray, " q"]
) -> float:
    """Whitened residual of what `theta` describes, into `result`; returns its square."""
    white, aim = likelihood.white, likelihood.aim
    nodal = np.zeros(white.shape[1])
    add_patches(theta, grid, nodal)
    total = 0.0
    for q in range(len(aim)):
        left = aim[q]
        for k in range(len(nodal)):
            left -= white[q, k] * nodal[k]
        result[q] = left
        total += left * left
    return total


@kernel()
@no_type_check
def fit_patches(
    theta: Parameters, step: Parameters, grid: NodeGrid, likelihood: Whitened, max_steps: int
) -> tuple[float, Float64[np.ndarray, "p p"]]:
    """Fits one or two patches, a ring, or a bar by Levenberg-Marquardt.

    Args:
        theta: (6,), (7,), (4,), (8,) or (9,) parameters of one or two patches, a ring, a bar or an elliptic
            face; initial values, replaced by the result.
        step: (p,) of finite differences; parameters with 0 are fixed.
        grid: of the nodes.
        likelihood: of the nodal forces.
        max_steps: of the iteration.

    Returns:
        Least misfit, and its curvature (p, p), the inverse covariance of the parameters.
    """
    count, rows = len(theta), len(likelihood.aim)
    now, tried, slope = np.empty(rows), np.empty(rows), np.zeros((rows, count))
    misfit, damping = _residual(theta, grid, likelihood, now), 1e-3
    gram = np.zeros((count, count))
    for _ in range(max_steps):
        for p in range(count):
            if step[p] != 0.0:
                moved = theta.copy()
                moved[p] += step[p]
                _residual(moved, grid, likelihood, tried)
                slope[:, p] = (now - tried) / step[p]
        gram, pull = slope.T @ slope, slope.T @ now
        before = misfit
        for _ in range(6):
            damped = gram.copy()
            for p in range(count):
                damped[p, p] += damping * gram[p, p] + 1e-9
            moved = theta + np.linalg.solve(damped, pull)
            found = _residual(moved, grid, likelihood, tried)
            if found < misfit:
                theta[:], now[:], misfit = moved, tried, found
                damping = max(0.1 * damping, 1e-9)
                break
            damping = max(10.0 * damping, 1e-6)
        if before - misfit <= 1e-4 * before + 0.01:
            break
    return misfit, gram
