"""Displacements of points of the sheet, and derivatives of these and of their images, compiled.

Derivation: docs/derivations/mechanics.md, "Markers".
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import kernel, no_type_check
from manytouch.mechanics.markers.projection import CameraModel, pixel_derivative

MIN_THICKNESS_RATIO, MAX_THICKNESS_RATIO = 0.5, 1.3
"""Bounds of the thickness over that at rest, far beyond any press."""

Vector3 = Float64[np.ndarray, "3"]
Matrix3 = Float64[np.ndarray, "3 3"]


class SplineField(NamedTuple):
    """The displacement of the sheet: along x and y that of its middle, along z its bending deflection b.

    Attributes:
        coefficient: (nodes, 3) mm.
        columns: number of nodes along the fast axis.
        is_x_slow: whether x is the slow axis.
    """

    coefficient: Float64[np.ndarray, "nodes 3"]
    columns: int
    is_x_slow: bool


class Places(NamedTuple):
    """Places on the sheet, as `SplinePatch.window` gives them.

    Attributes:
        first: (..., 2) slow and fast index of the first of 4 x 4 nodes.
        plane: (..., 2, 4, 4) value and three derivatives of 4 basis functions along both axes, of the
            displacements along x and y.
        bending: (..., 2, 4, 4) the same of the bending deflection.
    """

    first: Int64[np.ndarray, "... 2"]
    plane: Float64[np.ndarray, "... 2 4 4"]
    bending: Float64[np.ndarray, "... 2 4 4"]


class Layer(NamedTuple):
    """A surface parallel to the middle surface, and what its points depend on.

    Attributes:
        thickness: of the sheet, mm.
        poisson: Poisson's ratio.
        pretension: membrane force per length at rest over Young's modulus, mm.
        height: distance of the points from the camera-side face, towards the camera, mm.
        shear: `Shell.shear_mm2`, a in the deflection w = b - a lap b.
        tilt: fibres are normal to b - tilt lap b, mm^2.
    """

    thickness: float
    poisson: float
    pretension: float
    height: float
    shear: float
    tilt: float


class Levers(NamedTuple):
    """Distances of a layer from the middle surface along the fibres, and their derivatives.

    Attributes:
        across: that its distance across the sheet is made of, mm.
        in_plane: that its displacement in the plane is made of, with that of the middle surface by the
            pressure on the other face, mm.
        across_thinning, in_plane_thinning: their derivatives by the trace of the strain, with the opposite
            sign; 0 where the thickness has reached a bound.
    """

    across: float
    in_plane: float
    across_thinning: float
    in_plane_thinning: float


class Frames(NamedTuple):
    """Work space for one place.

    Attributes:
        frame: displacement, a1 and a2 of the surface that fibres are normal to, as rows.
        normal: unit vector along the fibres.
    """

    frame: Matrix3
    normal: Vector3


@kernel(fastmath=True)
@no_type_check
def surface_frame(
    spline: SplineField,
    first: Int64[np.ndarray, "2"],
    plane: Float64[np.ndarray, "2 4 4"],
    bending: Float64[np.ndarray, "2 4 4"],
    shear: float,
    out: Matrix3,
) -> None:
    """Displacement, and a1 and a2 with the slopes of the bending deflection, at a place, into `out`."""
    u0 = u1 = w0 = s0 = s1 = s2 = f0 = f1 = f2 = laplacian = 0.0
    for a in range(4):
        start = (first[0] + a) * spline.columns + first[1]
        v0 = v1 = d0 = d1 = b0 = b1 = b2 = 0.0
        for b in range(4):
            c0, c1, c2 = (
                spline.coefficient[start + b, 0],
                spline.coefficient[start + b, 1],
                spline.coefficient[start + b, 2],
            )
            n, d = plane[1, 0, b], plane[1, 1, b]
            v0 += n * c0
            v1 += n * c1
            d0 += d * c0
            d1 += d * c1
            b0 += bending[1, 0, b] * c2
            b1 += bending[1, 1, b] * c2
            b2 += bending[1, 2, b] * c2
        n, d = plane[0, 0, a], plane[0, 1, a]
        u0 += n * v0
        u1 += n * v1
        s0 += d * v0
        s1 += d * v1
        f0 += n * d0
        f1 += n * d1
        w0 += bending[0, 0, a] * b0
        s2 += bending[0, 1, a] * b0
        f2 += bending[0, 0, a] * b1
        laplacian += bending[0, 2, a] * b0 + bending[0, 0, a] * b2
    out[0, 0], out[0, 1], out[0, 2] = u0, u1, w0 - shear * laplacian
    if spline.is_x_slow:
        out[1, 0], out[1, 1], out[1, 2] = 1.0 + s0, s1, s2
        out[2, 0], out[2, 1], out[2, 2] = f0, 1.0 + f1, f2
    else:
        out[1, 0], out[1, 1], out[1, 2] = 1.0 + f0, f1, f2
        out[2, 0], out[2, 1], out[2, 2] = s0, 1.0 + s1, s2


@kernel(fastmath=True)
@no_type_check
def tilt_at(
    spline: SplineField, first: Int64[np.ndarray, "2"], bending: Float64[np.ndarray, "2 4 4"], tilt: float
) -> tuple[float, float]:
    """Slopes along x and y on which fibres stand, minus those of b: -tilt grad lap b."""
    along_slow = along_fast = 0.0
    for a in range(4):
        start = (first[0] + a) * spline.columns + first[1]
        s0, s1, s2, s3 = bending[0, 0, a], bending[0, 1, a], bending[0, 2, a], bending[0, 3, a]
        for b in range(4):
            c = spline.coefficient[start + b, 2]
            along_slow += c * (s3 * bending[1, 0, b] + s1 * bending[1, 2, b])
            along_fast += c * (s2 * bending[1, 1, b] + s0 * bending[1, 3, b])
    if spline.is_x_slow:
        return -tilt * along_slow, -tilt * along_fast
    return -tilt * along_fast, -tilt * along_slow


@kernel(fastmath=True)
@no_type_check
def strain_trace(frame: Matrix3) -> float:
    """Trace of the strain with a1 and a2 in these rows."""
    trace = -1.0
    for j in range(3):
        trace += 0.5 * (frame[1, j] ** 2 + frame[2, j] ** 2)
    return trace


@kernel(fastmath=True)
@no_type_check
def levers(trace: float, layer: Layer) -> Levers:
    """Levers of a layer where the strain of the middle surface has this trace."""
    nu, half = layer.poisson, 0.5 * layer.thickness
    thinning = nu / (1.0 - nu)
    ratio = 1.0 - thinning * trace
    bounded = min(max(ratio, MIN_THICKNESS_RATIO), MAX_THICKNESS_RATIO)
    by_trace = half * thinning if ratio == bounded else 0.0
    # membrane forces on a curved sheet need a pressure, by which the middle surface moves in its plane
    share = 0.5 * (1.0 + nu)
    squeezed = share * (half * (1.0 - bounded) + nu * layer.pretension)
    across = half * bounded + layer.height
    return Levers(across, across + squeezed, by_trace, (1.0 - share) * by_trace)


@kernel(fastmath=True)
@no_type_check
def _normal(frame: Matrix3, out: Vector3) -> float:
    """Unit vector along a1 x a2 into `out`; returns |a1 x a2|."""
    out[0] = frame[1, 1] * frame[2, 2] - frame[1, 2] * frame[2, 1]
    out[1] = frame[1, 2] * frame[2, 0] - frame[1, 0] * frame[2, 2]
    out[2] = frame[1, 0] * frame[2, 1] - frame[1, 1] * frame[2, 0]
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for j in range(3):
        out[j] /= length
    return length


@kernel(fastmath=True)
@no_type_check
def _displace(
    spline: SplineField,
    first: Int64[np.ndarray, "2"],
    plane: Float64[np.ndarray, "2 4 4"],
    bending: Float64[np.ndarray, "2 4 4"],
    tilt: tuple[float, float],
    layer: Layer,
    frames: Frames,
    out: Vector3,
) -> None:
    """Displacement (3,) of one point of the layer, into `out`."""
    frame, normal = frames.frame, frames.normal
    surface_frame(spline, first, plane, bending, layer.shear, frame)
    frame[1, 2] += tilt[0]
    frame[2, 2] += tilt[1]
    lever = levers(strain_trace(frame), layer)
    _normal(frame, normal)
    out[0] = frame[0, 0] - lever.in_plane * normal[0]
    out[1] = frame[0, 1] - lever.in_plane * normal[1]
    out[2] = frame[0, 2] - lever.across * normal[2] + 0.5 * layer.thickness + layer.height


@kernel(fastmath=True)
@no_type_check
def face_displacement(
    spline: SplineField, places: Places, layer: Layer, out: Float64[np.ndarray, "k 3"]
) -> None:
    """Displacement (mm) of points of the layer, into `out`."""
    frames = Frames(np.empty((3, 3)), np.empty(3))
    for k in range(len(out)):
        first, plane, bending = places.first[k], places.plane[k], places.bending[k]
        tilt = tilt_at(spline, first, bending, layer.tilt)
        _displace(spline, first, plane, bending, tilt, layer, frames, out[k])


@kernel(fastmath=True)
@no_type_check
def _point_derivative(
    frames: Frames,
    lever: Levers,
    shares: Vector3,
    slopes: tuple[float, float, float, float],
    values: tuple[float, float],
    out: Matrix3,
) -> None:
    """Derivative (3, 3) of a point of a layer by the coefficients of one node, into `out`.

    Args:
        frames: at the place.
        lever: of the layer at the place.
        shares: its levers for displacements along x, y and z, over |a1 x a2|.
        slopes: along x and y of the node's function of the displacements in the plane, and of that of the
            surface that fibres are normal to.
        values: of the node's function of the displacements in the plane, and of the deflection.
        out: row i is the component of the point, column j that of the coefficient.
    """
    frame, normal = frames.frame, frames.normal
    for j in range(3):  # of a unit change of component j
        # d(a1 x a2) = e_j x a2 dx + a1 x e_j dy
        k, m = (j + 1) % 3, (j + 2) % 3
        dx, dy = (slopes[2], slopes[3]) if j == 2 else (slopes[0], slopes[1])
        d_k = -dx * frame[2, m] + dy * frame[1, m]
        d_m = dx * frame[2, k] - dy * frame[1, k]
        along = normal[k] * d_k + normal[m] * d_m
        strain = dx * frame[1, j] + dy * frame[2, j]
        in_plane = shares[0] * along + lever.in_plane_thinning * strain
        out[0, j], out[1, j] = in_plane * normal[0], in_plane * normal[1]
        out[2, j] = (shares[2] * along + lever.across_thinning * strain) * normal[2]
        out[j, j] += values[1] if j == 2 else values[0]
        out[k, j] -= shares[k] * d_k
        out[m, j] -= shares[m] * d_m


@kernel(fastmath=True)
@no_type_check
def face_derivatives(
    spline: SplineField, places: Places, layer: Layer, out: Float64[np.ndarray, "k 3 16 3"]
) -> None:
    """Derivative of `face_displacement` by the coefficients of the 4 x 4 nodes of each place, into `out`."""
    frames, block = Frames(np.empty((3, 3)), np.empty(3)), np.empty((3, 3))
    frame, shear, shares = frames.frame, layer.shear, np.empty(3)
    for k in range(len(out)):
        slow, fast = places.plane[k, 0], places.plane[k, 1]
        bend_slow, bend_fast = places.bending[k, 0], places.bending[k, 1]
        surface_frame(spline, places.first[k], places.plane[k], places.bending[k], shear, frame)
        tilt_x, tilt_y = tilt_at(spline, places.first[k], places.bending[k], layer.tilt)
        frame[1, 2] += tilt_x
        frame[2, 2] += tilt_y
        lever = levers(strain_trace(frame), layer)
        length = _normal(frame, frames.normal)
        shares[0] = shares[1] = lever.in_plane / length
        shares[2] = lever.across / length
        for a in range(4):
            b0, b1, b2, b3 = bend_slow[0, a], bend_slow[1, a], bend_slow[2, a], bend_slow[3, a]
            for b in range(4):
                c0, c1, c2, c3 = bend_fast[0, b], bend_fast[1, b], bend_fast[2, b], bend_fast[3, b]
                values = (slow[0, a] * fast[0, b], b0 * c0 - shear * (b2 * c0 + b0 * c2))
                ds, df = slow[1, a] * fast[0, b], slow[0, a] * fast[1, b]
                ts = b1 * c0 - layer.tilt * (b3 * c0 + b1 * c2)
                tf = b0 * c1 - layer.tilt * (b2 * c1 + b0 * c3)
                slopes = (ds, df, ts, tf) if spline.is_x_slow else (df, ds, tf, ts)
                _point_derivative(frames, lever, shares, slopes, values, block)
                for i in range(3):
                    for j in range(3):
                        out[k, i, 4 * a + b, j] = block[i, j]


@kernel(fastmath=True)
@no_type_check
def centre_derivatives(
    position: Float64[np.ndarray, "m 3"],
    camera: CameraModel,
    face: Float64[np.ndarray, "m 3 16 3"],
    out: Float64[np.ndarray, "m 2 16 3"],
) -> None:
    """Derivative of the pixels of points by the coefficients, into `out`.

    Args:
        position: of the points in the sheet frame, mm.
        camera: in front of the sheet.
        face: derivatives of the positions, from `face_derivatives`.
        out: result, px/mm.
    """
    gradient = np.empty((2, 3))
    for k in range(len(position)):
        pixel_derivative(camera, position[k, 0], position[k, 1], position[k, 2], gradient)
        for axis in range(2):
            g0, g1, g2 = gradient[axis, 0], gradient[axis, 1], gradient[axis, 2]
            for n in range(16):
                for j in range(3):
                    out[k, axis, n, j] = g0 * face[k, 0, n, j] + g1 * face[k, 1, n, j] + g2 * face[k, 2, n, j]


@kernel()
@no_type_check
def add_pulls(
    derivative: Float64[np.ndarray, "m 2 4 12"],
    residual: Float64[np.ndarray, "k m 2"],
    information: Float64[np.ndarray, "m 2 2"],
    first: Int64[np.ndarray, "m 2"],
    columns: int,
    gradients: Float64[np.ndarray, "k nodes 3"],
) -> None:
    """Add J^T W r to the gradient of each of k residuals.

    Args:
        derivative: of the marker images by the coefficients of 4 rows of 4 nodes, px/mm.
        residual: (k, m, 2) r; ignored along an axis without information.
        information: (m, 2, 2) W, per px^2.
        first: (m, 2) slow and fast index of the first node of each marker.
        columns: number of nodes along the fast axis.
        gradients: (k, nodes, 3) result.
    """
    total = np.empty(gradients[0].size)
    for k in range(len(residual)):
        total[:] = 0.0
        for i in range(len(derivative)):
            w00, w11 = information[i, 0, 0], information[i, 1, 1]
            x = residual[k, i, 0] if w00 != 0.0 else 0.0
            y = residual[k, i, 1] if w11 != 0.0 else 0.0
            pull_x = w00 * x + information[i, 0, 1] * y
            pull_y = information[i, 1, 0] * x + w11 * y
            for a in range(4):
                begin = 3 * ((first[i, 0] + a) * columns + first[i, 1])
                for p in range(12):
                    total[begin + p] += pull_x * derivative[i, 0, a, p] + pull_y * derivative[i, 1, a, p]
        flat = gradients[k].reshape(-1)
        for p in range(len(total)):
            flat[p] += total[p]
