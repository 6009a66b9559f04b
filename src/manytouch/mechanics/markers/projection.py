"""From a point of the sheet to its pixel, and the derivative of that, compiled.

The same cameras as `manytouch.geometry.camera` (OpenCV's pinhole and fisheye), one point at a time.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Camera

_ON_AXIS = 1e-9  # tangent of the angle below which a ray counts as the optical axis
_MIN_DISTANCE_MM = 1e-3  # a point behind the camera is projected as if it were this far in front of it


class CameraModel(NamedTuple):
    """A camera as kernels need it.

    Attributes:
        fx, fy, cx, cy: focal lengths and principal point, px.
        rotation: (3, 3) from the sheet frame to the camera frame.
        translation: (3,) mm.
        distortion: (5,) k1, k2, p1, p2, k3; of a fisheye k1 to k4.
        is_fisheye: which of OpenCV's models.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    rotation: Float64[np.ndarray, "3 3"]
    translation: Float64[np.ndarray, "3"]
    distortion: Float64[np.ndarray, "5"]
    is_fisheye: bool


def camera_model(camera: Camera) -> CameraModel:
    """A camera for the kernels."""
    rotation, translation = cam_from_sheet(camera)
    distortion = np.zeros(5)
    distortion[: len(camera.distortion)] = camera.distortion
    return CameraModel(
        fx=float(camera.fx_px),
        fy=float(camera.fy_px),
        cx=float(camera.cx_px),
        cy=float(camera.cy_px),
        rotation=np.array(rotation, dtype=np.float64),
        translation=np.array(translation, dtype=np.float64).ravel(),
        distortion=distortion,
        is_fisheye=camera.model == "fisheye",
    )


@kernel(inline="always")
@no_type_check
def _in_camera(camera: CameraModel, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Normalised coordinates and 1 / distance of a point of the sheet frame."""
    r, t = camera.rotation, camera.translation
    px = r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + t[0]
    py = r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + t[1]
    pz = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + t[2]
    inverse = 1.0 / max(pz, _MIN_DISTANCE_MM)
    return px * inverse, py * inverse, inverse


@kernel(inline="always")
@no_type_check
def _distorted(  # noqa: PLR0917
    k1: float, k2: float, p1: float, p2: float, k3: float, a: float, b: float
) -> tuple[float, float]:
    """Normalised coordinates after the distortion of a lens that is no fisheye."""
    r2 = a * a + b * b
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
        b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
    )


@kernel()
@no_type_check
def pixel(camera: CameraModel, x: float, y: float, z: float) -> tuple[float, float]:
    """Pixel (u, v) of a point of the sheet frame (mm)."""
    a, b, _ = _in_camera(camera, x, y, z)
    d = camera.distortion
    k1, k2, p1, p2, k3 = d[0], d[1], d[2], d[3], d[4]
    if camera.is_fisheye:
        r = math.sqrt(a * a + b * b)
        factor = 1.0
        if r > _ON_AXIS:
            angle = math.atan(r)
            t = angle * angle
            factor = angle * (1.0 + t * (k1 + t * (k2 + t * (p1 + t * p2)))) / r
        return camera.fx * factor * a + camera.cx, camera.fy * factor * b + camera.cy
    u, v = _distorted(k1, k2, p1, p2, k3, a, b)
    return camera.fx * u + camera.cx, camera.fy * v + camera.cy


@kernel(fastmath=True)
@no_type_check
def pixels(
    points: int,
    camera: CameraModel,
    place: Float64[np.ndarray, " n"],
    u: Float64[np.ndarray, " k"],
    v: Float64[np.ndarray, " k"],
) -> None:
    """`pixel` of several points of the sheet frame (x of all, then y, then z), into `u` and `v`."""
    if camera.is_fisheye:
        for n in range(points):
            u[n], v[n] = pixel(camera, place[n], place[points + n], place[2 * points + n])
        return
    r, t, d = camera.rotation, camera.translation, camera.distortion
    r00, r01, r02, t0 = r[0, 0], r[0, 1], r[0, 2], t[0]
    r10, r11, r12, t1 = r[1, 0], r[1, 1], r[1, 2], t[1]
    r20, r21, r22, t2 = r[2, 0], r[2, 1], r[2, 2], t[2]
    k1, k2, p1, p2, k3 = d[0], d[1], d[2], d[3], d[4]
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    for n in range(points):  # without branches and array elements of the camera, for SIMD
        x, y, z = place[n], place[points + n], place[2 * points + n]
        inverse = 1.0 / max(r20 * x + r21 * y + r22 * z + t2, _MIN_DISTANCE_MM)
        a = (r00 * x + r01 * y + r02 * z + t0) * inverse
        b = (r10 * x + r11 * y + r12 * z + t1) * inverse
        p, q = _distorted(k1, k2, p1, p2, k3, a, b)
        u[n], v[n] = fx * p + cx, fy * q + cy


@kernel()
@no_type_check
def pixel_derivative(
    camera: CameraModel, x: float, y: float, z: float, out: Float64[np.ndarray, "2 3"]
) -> None:
    """Derivative of the pixel by the point (px/mm), into `out`."""
    a, b, inverse = _in_camera(camera, x, y, z)
    d = camera.distortion
    k1, k2, p1, p2, k3 = d[0], d[1], d[2], d[3], d[4]
    r2 = a * a + b * b
    if camera.is_fisheye:
        r = math.sqrt(r2)
        factor, growth = 1.0, 0.0  # growth = (d factor / d r) / r
        if r > _ON_AXIS:
            angle = math.atan(r)
            t = angle * angle
            bent = angle * (1.0 + t * (k1 + t * (k2 + t * (p1 + t * p2))))
            steep = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * p1 + t * 9.0 * p2)))
            factor = bent / r
            growth = (steep / (1.0 + r2) - factor) / r2
        ua, ub = factor + growth * a * a, growth * a * b
        va, vb = ub, factor + growth * b * b
    else:
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        growth = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
        ua = radial + growth * a * a + 2.0 * p1 * b + 6.0 * p2 * a
        ub = growth * a * b + 2.0 * p1 * a + 2.0 * p2 * b
        va = growth * a * b + 2.0 * p1 * a + 2.0 * p2 * b
        vb = radial + growth * b * b + 6.0 * p1 * b + 2.0 * p2 * a
    for j in range(3):
        along_a = (camera.rotation[0, j] - a * camera.rotation[2, j]) * inverse
        along_b = (camera.rotation[1, j] - b * camera.rotation[2, j]) * inverse
        out[0, j] = camera.fx * (ua * along_a + ub * along_b)
        out[1, j] = camera.fy * (va * along_a + vb * along_b)
