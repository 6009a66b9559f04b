"""Nodal forces of one or two patches, a ring, a bar, or a face of pressure, compiled."""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import REORDER, inlined_kernel, kernel, no_type_check
from manytouch.geometry.spline.patch import SplinePatch

ONE = 6
"""Number of parameters of one patch: force, x, y, and the triangular root xx, yx, yy of its second moment.
Two patches have 7: force, x, y of each, and the standard deviation of both along each axis."""
RING = 4
"""Number of parameters of a thin ring: force, x, y, radius."""
BAR = 8
"""Number of parameters of a bar: force, x, y of its middle, half its length along x and y, half its width,
and the tilt and the end load of its profile. The pressure at a share s of half the length is proportional to
exp(MAX_TILT tanh(tilt) s + MAX_END tanh(end) s^2)."""
MAX_TILT, MAX_END = 1.0, 1.5
"""The pressure in the middle is at least exp(-1.5) of that at both ends: with less, a bar would describe two
balls as well as two patches do (ADR 84)."""
ELLIPTIC_FACE = 9
"""Number of parameters of an elliptic face: force, x, y, the triangular root xx, yx, yy of the second moment
that it would have under even pressure, the load of its edge, and two that are 0, by which their number
differs from that of a bar. The pressure at a share s of its radius is proportional to
exp(MAX_EDGE_LOAD tanh(load) s^2)."""
MAX_EDGE_LOAD = 3.0
_FACE_ANGLES = 12
_RING_POINTS = 24

Parameters = Float64[np.ndarray, " p"]
Forces = Float64[np.ndarray, " n"]


class Line(NamedTuple):
    """The functions of the bending deflection along an axis, elements of one length.

    Attributes:
        start: where the first element begins, mm.
        per_mm: elements per mm.
        table: (elements, 4, 4) coefficients of 1, s, s^2, s^3 of the four functions in each element, where s
            runs from 0 to 1.
    """

    start: float
    per_mm: float
    table: Float64[np.ndarray, "elements 4 4"]


class NodeGrid(NamedTuple):
    """The splines whose nodal forces are known.

    Attributes:
        x, y: functions along both axes.
        local: (nx, ny) number of each spline function's node among the n nodes, or -1.
        shear: a of the sheet, mm^2; a point force has the nodal forces B_j - a lap B_j.
    """

    x: Line
    y: Line
    local: Int64[np.ndarray, "nx ny"]
    shear: float


def node_grid(patch: SplinePatch, local: Int64[np.ndarray, "nx ny"]) -> NodeGrid:
    """The splines of a patch; `local` as in `NodeGrid`."""
    lines = []
    for axis in range(2):
        per_mm = patch.elements[axis] / patch.size_mm[axis]
        table = patch.element_polynomials(axis)
        lines.append(Line(float(patch.corner_mm[axis]), float(per_mm), table))
    return NodeGrid(lines[0], lines[1], local, float(patch.shear_mm2))


_PLACE = 2.0 * np.cos(np.pi * np.arange(1, 6) / 6.0)  # in standard deviations
_WEIGHT = np.sin(np.pi * np.arange(1, 6) / 6.0) ** 2 / 3.0


@inlined_kernel(fastmath=REORDER)
@no_type_check
def _functions(line: Line, place: float, out: Float64[np.ndarray, "2 4"]) -> int:
    """Values of the four functions at a place and their second derivatives; returns the number of the first.

    Places beyond the ends are moved to them.
    """
    last = len(line.table) - 1
    along = (place - line.start) * line.per_mm
    along = min(along, last + 1.0) if along > 0.0 else 0.0
    element = min(int(along), last)
    s, squared = along - element, line.per_mm * line.per_mm
    for i in range(4):
        c2, c3 = line.table[element, i, 2], line.table[element, i, 3]
        out[0, i] = line.table[element, i, 0] + s * (line.table[element, i, 1] + s * (c2 + s * c3))
        out[1, i] = (2.0 * c2 + 6.0 * s * c3) * squared
    return element


@inlined_kernel(fastmath=REORDER)
@no_type_check
def _add_point(
    grid: NodeGrid, force: float, x: float, y: float, work: Float64[np.ndarray, "2 2 4"], nodal: Forces
) -> None:
    """Add the nodal forces of a point force to `nodal`; those on other nodes are left out."""
    first_x, first_y = _functions(grid.x, x, work[0]), _functions(grid.y, y, work[1])
    for i in range(4):
        value, curved = force * work[0, 0, i], force * grid.shear * work[0, 1, i]
        for j in range(4):
            k = grid.local[first_x + i, first_y + j]
            if k >= 0:
                nodal[k] += (value - curved) * work[1, 0, j] - value * grid.shear * work[1, 1, j]


@kernel(fastmath=REORDER)
@no_type_check
def add_patch(grid: NodeGrid, patch: Parameters, nodal: Forces) -> None:
    """Add the nodal forces of a uniform elliptical patch to `nodal`, by 25 quadrature points.

    The density of an ellipse along an axis is a semicircle, for which these points and weights are Gauss's
    (of Chebyshev's second kind). Points with one x share their functions along x.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        patch: (6,) force, x, y and the lower triangle xx, yx, yy of a root of its second moment.
        nodal: result.
    """
    force, x, y, xx, yx, yy = patch[0], patch[1], patch[2], patch[3], patch[4], patch[5]
    at_x, at_y = np.empty((2, 4)), np.empty((2, 4))
    value, sheared = np.zeros(grid.local.shape[1]), np.zeros(grid.local.shape[1])
    for a in range(5):
        first_x = _functions(grid.x, x + _PLACE[a] * xx, at_x)
        low, high = grid.local.shape[1], 0
        for b in range(5):
            first_y = _functions(grid.y, y + _PLACE[a] * yx + _PLACE[b] * yy, at_y)
            low, high = min(low, first_y), max(high, first_y + 4)
            for j in range(4):
                value[first_y + j] += _WEIGHT[b] * at_y[0, j]
                sheared[first_y + j] += _WEIGHT[b] * (at_y[0, j] - grid.shear * at_y[1, j])
        share = force * _WEIGHT[a]
        for i in range(4):
            along, curved = share * at_x[0, i], share * grid.shear * at_x[1, i]
            for j in range(low, high):
                k = grid.local[first_x + i, j]
                if k >= 0:
                    nodal[k] += along * sheared[j] - curved * value[j]
        value[low:high] = 0.0
        sheared[low:high] = 0.0


@kernel(fastmath=REORDER)
@no_type_check
def add_ring(grid: NodeGrid, ring: Parameters, nodal: Forces) -> None:
    """Add the nodal forces of a thin ring with even pressure to `nodal`, by points on the circle.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        ring: (4,) force, x, y, radius.
        nodal: result.
    """
    work = np.empty((2, 2, 4))
    for point in range(_RING_POINTS):
        angle = 2.0 * np.pi * point / _RING_POINTS
        x, y = ring[1] + ring[3] * np.cos(angle), ring[2] + ring[3] * np.sin(angle)
        _add_point(grid, ring[0] / _RING_POINTS, x, y, work, nodal)


ALONG, _ALONG_WEIGHT = np.polynomial.legendre.leggauss(7)
_ACROSS, _ACROSS_WEIGHT = np.polynomial.legendre.leggauss(3)


@kernel()
@no_type_check
def bar_profile(bar: Parameters) -> Float64[np.ndarray, "7"]:
    """Shares of the force of a bar at `ALONG` of half its length."""
    tilt, end = MAX_TILT * np.tanh(bar[6]), MAX_END * np.tanh(bar[7])
    weight = _ALONG_WEIGHT * np.exp(tilt * ALONG + end * ALONG**2)
    return np.asarray(weight / weight.sum())


@kernel(fastmath=REORDER)
@no_type_check
def add_bar(grid: NodeGrid, bar: Parameters, nodal: Forces) -> None:
    """Add the nodal forces of a bar to `nodal`, by 7 x 3 Gauss points.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        bar: (8,) see `BAR`.
        nodal: result.
    """
    length = max(np.hypot(bar[3], bar[4]), 1e-9)
    across_x, across_y = -bar[5] * bar[4] / length, bar[5] * bar[3] / length
    weight, work = bar_profile(bar), np.empty((2, 2, 4))
    for a in range(len(ALONG)):
        for b in range(len(_ACROSS)):
            share = bar[0] * weight[a] * 0.5 * _ACROSS_WEIGHT[b]
            x = bar[1] + ALONG[a] * bar[3] + _ACROSS[b] * across_x
            y = bar[2] + ALONG[a] * bar[4] + _ACROSS[b] * across_y
            _add_point(grid, share, x, y, work, nodal)


_SQUARE, _SQUARE_WEIGHT = np.polynomial.legendre.leggauss(4)
_SQUARE = 0.5 * (_SQUARE + 1.0)  # squared shares of the radius, in which the area of an ellipse is even
_RADIUS = np.sqrt(_SQUARE)


def elliptic_radii() -> Float64[np.ndarray, "4"]:
    """Shares of the radius of an elliptic face at which its pressure acts."""
    return _RADIUS


@kernel()
@no_type_check
def elliptic_profile(face: Parameters) -> Float64[np.ndarray, "4"]:
    """Shares of the force of an elliptic face at `elliptic_radii`."""
    weight = _SQUARE_WEIGHT * np.exp(MAX_EDGE_LOAD * np.tanh(face[6]) * _SQUARE)
    return np.asarray(weight / weight.sum())


@kernel(fastmath=REORDER)
@no_type_check
def add_elliptic_face(grid: NodeGrid, face: Parameters, nodal: Forces) -> None:
    """Add the nodal forces of an elliptic face to `nodal`, by 4 x 12 points.

    Args:
        grid: of the nodes; forces on other nodes are left out.
        face: (9,) see `ELLIPTIC_FACE`.
        nodal: result.
    """
    weight, work = elliptic_profile(face), np.empty((2, 2, 4))
    for a in range(len(weight)):
        share = face[0] * weight[a] / _FACE_ANGLES
        for b in range(_FACE_ANGLES):
            angle = 2.0 * np.pi * (b + 0.5 * (a % 2)) / _FACE_ANGLES
            u, v = 2.0 * _RADIUS[a] * np.cos(angle), 2.0 * _RADIUS[a] * np.sin(angle)
            x, y = face[1] + face[3] * u, face[2] + face[4] * u + face[5] * v
            _add_point(grid, share, x, y, work, nodal)


@kernel()
@no_type_check
def add_patches(theta: Parameters, grid: NodeGrid, nodal: Forces) -> None:
    """Add the nodal forces of a patch (6,), two (7,), a ring (4,), a bar (8,) or a face (9,) to `nodal`."""
    if len(theta) == ONE:
        add_patch(grid, theta, nodal)
    elif len(theta) == RING:
        add_ring(grid, theta, nodal)
    elif len(theta) == BAR:
        add_bar(grid, theta, nodal)
    elif len(theta) == ELLIPTIC_FACE:
        add_elliptic_face(grid, theta, nodal)
    else:
        patch = np.zeros(ONE)
        patch[3] = patch[5] = theta[6]
        for k in (0, 3):
            if theta[k] != 0.0:
                patch[:3] = theta[k : k + 3]
                add_patch(grid, patch, nodal)
