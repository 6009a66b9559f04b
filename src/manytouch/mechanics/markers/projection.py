"""From a point of the sheet to its pixel, and the derivative of that, compiled.

The same cameras as `manytouch.geometry.camera` (OpenCV's pinhole and fisheye), one point at a time.
"""

# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

import math
from typing import no_type_check

import numpy as np
from jaxtyping import Float64
from numba import njit

from manytouch.geometry.camera import cam_from_sheet
from manytouch.values import Camera

PARAMETERS = 22
"""fx fy cx cy, rotation (9), translation (3), distortion (5), 1 for a fisheye."""

_ON_AXIS = 1e-9
_CLOSEST_MM = 1e-3  # a point behind the camera is treated as if it were just before it


def parameters(camera: Camera) -> Float64[np.ndarray, "22"]:
    """A camera as a flat array for the kernels."""
    rotation, translation = cam_from_sheet(camera)
    distortion = np.zeros(5)
    distortion[: len(camera.distortion)] = camera.distortion
    intrinsics = [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]
    is_fisheye = [1.0 if camera.model == "fisheye" else 0.0]
    return np.concatenate([intrinsics, rotation.ravel(), translation, distortion, is_fisheye])


@njit(cache=True, nogil=True, inline="always")
@no_type_check
def _in_camera(camera, x, y, z):
    """Normalised coordinates and 1 / distance of a point of the sheet frame."""
    px = camera[4] * x + camera[5] * y + camera[6] * z + camera[13]
    py = camera[7] * x + camera[8] * y + camera[9] * z + camera[14]
    pz = camera[10] * x + camera[11] * y + camera[12] * z + camera[15]
    inverse = 1.0 / max(pz, _CLOSEST_MM)
    return px * inverse, py * inverse, inverse


@njit(cache=True, nogil=True)
@no_type_check
def pixel(camera, x, y, z):
    """Pixel (u, v) of a point of the sheet frame."""
    a, b, _ = _in_camera(camera, x, y, z)
    k1, k2, p1, p2, k3 = camera[16], camera[17], camera[18], camera[19], camera[20]
    r2 = a * a + b * b
    if camera[21] != 0.0:
        r = math.sqrt(r2)
        factor = 1.0
        if r > _ON_AXIS:
            angle = math.atan(r)
            t = angle * angle
            factor = angle * (1.0 + t * (k1 + t * (k2 + t * (p1 + t * p2)))) / r
        return camera[0] * factor * a + camera[2], camera[1] * factor * b + camera[3]
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a)
    v = b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b
    return camera[0] * u + camera[2], camera[1] * v + camera[3]


@njit(cache=True, nogil=True)
@no_type_check
def slope(camera, x, y, z, out):
    """Derivative (2, 3) of the pixel with respect to the point, into `out`."""
    a, b, inverse = _in_camera(camera, x, y, z)
    k1, k2, p1, p2, k3 = camera[16], camera[17], camera[18], camera[19], camera[20]
    r2 = a * a + b * b
    if camera[21] != 0.0:
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
        along_a = (camera[4 + j] - a * camera[10 + j]) * inverse
        along_b = (camera[7 + j] - b * camera[10 + j]) * inverse
        out[0, j] = camera[0] * (ua * along_a + ub * along_b)
        out[1, j] = camera[1] * (va * along_a + vb * along_b)
