"""Images of round markers: the points of an outline are computed together, in SIMD registers, compiled.

The basis functions of these points are given at all nodes that matter to any of them, so that they have their
coefficients in common. Loops over the points have a variable number of them, and arrays are flat with
constant distances: LLVM forms vectors only then. Derivation: docs/derivations/mechanics.md, "Markers".
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import kernel, no_type_check
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.kernels import (
    Layer,
    Places,
    SplineField,
    levers,
    tilt_at,
)
from manytouch.mechanics.markers.projection import CameraModel, pixels
from manytouch.values.arrays import Mask

POINTS = 8
"""Points of an outline. The polygon with this radius has the second moments of the unit disc (1.0231)."""

ORDERS = 5
"""Functions of a node along an axis: value and derivative of the displacements along x and y; value and two
derivatives of the bending deflection."""

_NODE = ORDERS * POINTS
_U, _V, _W, _SU, _SV, _SB, _FU, _FV, _FB = (row * POINTS for row in range(9))
_FIELDS = 9 * POINTS
_SUMS = 7 * POINTS

Flat = Float64[np.ndarray, " n"]


class DiscPlaces(NamedTuple):
    """The outlines of m discs.

    Attributes:
        centre: of the discs.
        first: (m, 2) slow and fast index of the first node that matters to an outline.
        nodes: (m, 2) number of nodes along both axes that matter to it, at least 4.
        slow: (m, w) for each of these nodes along the slow axis, ORDERS functions at each of the POINTS.
        fast: (m, w) the same along the fast axis.
        rest_mm: (m, 3 POINTS) x of all points of the outline at rest, then y, then z; sheet frame.
        points: POINTS as a variable.
    """

    centre: Places
    first: Int64[np.ndarray, "m 2"]
    nodes: Int64[np.ndarray, "m 2"]
    slow: Float64[np.ndarray, "m w"]
    fast: Float64[np.ndarray, "m w"]
    rest_mm: Float64[np.ndarray, "m k"]
    points: int

    def of(self, chosen: Mask) -> "DiscPlaces":
        """The places of some of the discs."""
        return DiscPlaces(
            Places(*(part[chosen] for part in self.centre)),
            self.first[chosen],
            self.nodes[chosen],
            self.slow[chosen],
            self.fast[chosen],
            self.rest_mm[chosen],
            self.points,
        )


def disc_places(
    patch: SplinePatch, rest_mm: Float64[np.ndarray, "m 3"], radius_mm: Float64[np.ndarray, " m"]
) -> DiscPlaces:
    """Discs with these centres in the sheet frame."""
    angle = 2.0 * np.pi / POINTS * np.arange(POINTS)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(POINTS)])
    outline_mm = rest_mm[:, None] + radius_mm[:, None, None] * circle
    count = len(rest_mm)
    around = patch.window(outline_mm[..., :2].reshape(-1, 2))
    first = around.first.reshape(count, POINTS, 2)
    begin, end = first.min(axis=1), first.max(axis=1) + 4
    functions = np.concatenate([around.plane[:, :, :2], around.bending[:, :, :3]], axis=2)
    functions = functions.reshape(count, POINTS, 2, ORDERS, 4)
    disc, point = np.arange(count)[:, None], np.arange(POINTS)
    tables = []
    for axis in range(2):
        widest = int((end - begin)[:, axis].max(initial=4))
        table = np.zeros((count, widest, ORDERS, POINTS))
        for near in range(4):
            node = first[:, :, axis] - begin[:, axis, None] + near
            table[disc, node, :, point] = functions[:, :, axis, :, near]
        tables.append(table.reshape(count, -1))
    centre = patch.window(np.ascontiguousarray(rest_mm[:, :2]))
    return DiscPlaces(
        centre=Places(centre.first, centre.plane, centre.bending),
        first=begin,
        nodes=end - begin,
        slow=tables[0],
        fast=tables[1],
        rest_mm=np.ascontiguousarray(outline_mm.transpose(0, 2, 1)).reshape(count, -1),
        points=POINTS,
    )


@kernel(fastmath=True)
@no_type_check
def centroids(
    spline: SplineField, discs: DiscPlaces, layer: Layer, camera: CameraModel, out: Float64[np.ndarray, "m 2"]
) -> None:
    """Pixels of the centroids of the images of m deformed discs, into `out`.

    The outline of an image is a trigonometric polynomial through the images of its points, so that its area
    and its moments are sums over these points (L. N. Trefethen 2000, doi:10.1137/1.9780898719598, chapter 3).
    Fibres of a disc have the tilt of its centre, because third derivatives of the spline are discontinuous
    between elements.

    Args:
        spline: displacement of the sheet.
        discs: their places.
        layer: the discs are on it.
        camera: in front of the sheet.
        out: result.
    """
    points = discs.points
    sums, fields, place = np.empty(_SUMS), np.empty(_FIELDS), np.empty(3 * POINTS)
    u, v = np.empty(2 * POINTS), np.empty(2 * POINTS)
    for i in range(len(out)):
        tilt = tilt_at(spline, discs.centre.first[i], discs.centre.bending[i], layer.tilt)
        fields_of_disc(
            spline,
            (points, discs.nodes[i, 0], discs.nodes[i, 1], discs.first[i, 0], discs.first[i, 1]),
            discs.slow[i],
            discs.fast[i],
            layer.shear,
            sums,
            fields,
        )
        move(points, spline.is_x_slow, fields, tilt, layer, discs.rest_mm[i], place)
        pixels(points, camera, place, u, v)
        out[i, 0], out[i, 1] = centroid(points, u, v)


@kernel(fastmath=True)
@no_type_check
def fields_of_disc(
    spline: SplineField,
    window: tuple[int, int, int, int, int],
    slow: Flat,
    fast: Flat,
    shear: float,
    sums: Flat,
    fields: Flat,
) -> None:
    """Displacements and derivatives at the points of an outline, into `fields`.

    Args:
        spline: displacement of the sheet.
        window: points; nodes along both axes; index of the first of them along both.
        slow: functions along the slow axis.
        fast: functions along the fast axis.
        shear: a in the deflection w = b - a lap b.
        sums: work space, what a row of nodes adds up to.
        fields: (9 POINTS,) of u, v, w; of the derivatives of u, v, b along the slow axis; along the fast one.
    """
    points, rows, columns, first_row, first_column = window
    fields[:] = 0.0
    for a in range(rows):
        start = (first_row + a) * spline.columns + first_column
        sums[:] = 0.0
        for b in range(columns):
            node = start + b
            c0, c1, c2 = (
                spline.coefficient[node, 0],
                spline.coefficient[node, 1],
                spline.coefficient[node, 2],
            )
            at = b * _NODE
            for n in range(points):
                value, slope = fast[at + n], fast[at + POINTS + n]
                sums[n] += value * c0
                sums[POINTS + n] += value * c1
                sums[2 * POINTS + n] += slope * c0
                sums[3 * POINTS + n] += slope * c1
                sums[4 * POINTS + n] += fast[at + 2 * POINTS + n] * c2
                sums[5 * POINTS + n] += fast[at + 3 * POINTS + n] * c2
                sums[6 * POINTS + n] += fast[at + 4 * POINTS + n] * c2
        at = a * _NODE
        for n in range(points):
            value, slope = slow[at + n], slow[at + POINTS + n]
            b0, b1, b2 = slow[at + 2 * POINTS + n], slow[at + 3 * POINTS + n], slow[at + 4 * POINTS + n]
            bent, bent_slope = sums[4 * POINTS + n], sums[5 * POINTS + n]
            fields[_U + n] += value * sums[n]
            fields[_V + n] += value * sums[POINTS + n]
            fields[_W + n] += b0 * bent - shear * (b2 * bent + b0 * sums[6 * POINTS + n])
            fields[_SU + n] += slope * sums[n]
            fields[_SV + n] += slope * sums[POINTS + n]
            fields[_SB + n] += b1 * bent
            fields[_FU + n] += value * sums[2 * POINTS + n]
            fields[_FV + n] += value * sums[3 * POINTS + n]
            fields[_FB + n] += b0 * bent_slope


@kernel(fastmath=True)
@no_type_check
def move(
    points: int,
    is_x_slow: bool,
    fields: Flat,
    tilt: tuple[float, float],
    layer: Layer,
    rest_mm: Flat,
    place: Flat,
) -> None:
    """Places of the points of an outline in the sheet frame (mm), into `place`."""
    x, y = (_SU, _FU) if is_x_slow else (_FU, _SU)
    top, tilt_x, tilt_y = 0.5 * layer.thickness + layer.height, tilt[0], tilt[1]
    for n in range(points):
        x0, x1, x2 = 1.0 + fields[x + n], fields[x + POINTS + n], fields[x + 2 * POINTS + n] + tilt_x
        y0, y1, y2 = fields[y + n], 1.0 + fields[y + POINTS + n], fields[y + 2 * POINTS + n] + tilt_y
        trace = 0.5 * (x0 * x0 + x1 * x1 + x2 * x2 + y0 * y0 + y1 * y1 + y2 * y2) - 1.0
        lever = levers(trace, layer)
        n0, n1, n2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
        length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        in_plane, across = lever.in_plane / length, lever.across / length
        place[n] = rest_mm[n] + fields[_U + n] - in_plane * n0
        place[POINTS + n] = rest_mm[POINTS + n] + fields[_V + n] - in_plane * n1
        place[2 * POINTS + n] = rest_mm[2 * POINTS + n] + fields[_W + n] - across * n2 + top


@kernel(fastmath=True)
@no_type_check
def centroid(points: int, u: Flat, v: Flat) -> tuple[float, float]:
    """Centroid of the curve through points, which are given twice, one time after the other."""
    for n in range(points):
        u[points + n], v[points + n] = u[n], v[n]
    area = up = right = 0.0
    first_u, first_v = u[0], v[0]
    # weights of the derivative of a trigonometric polynomial through 8 points
    w1, w2, w3 = (
        0.5 / math.tan(math.pi / POINTS),
        -0.5 / math.tan(2.0 * math.pi / POINTS),
        0.5 / math.tan(3.0 * math.pi / POINTS),
    )
    for n in range(points):
        du = w1 * (u[n + 1] - u[n + 7]) + w2 * (u[n + 2] - u[n + 6]) + w3 * (u[n + 3] - u[n + 5])
        dv = w1 * (v[n + 1] - v[n + 7]) + w2 * (v[n + 2] - v[n + 6]) + w3 * (v[n + 3] - v[n + 5])
        x, y = u[n] - first_u, v[n] - first_v
        area += x * dv - y * du
        right += x * x * dv
        up -= y * y * du
    return first_u + right / area, first_v + up / area
