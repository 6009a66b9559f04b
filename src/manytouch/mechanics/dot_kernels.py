"""Where the dots of a bent sheet show in the image, and how that changes with its shape, compiled.

Derivation: docs/derivations/mechanics.md, "Dots". A place on the sheet comes as (slow, fast) of the first
of its 4 x 4 nodes and the basis functions' value, slope and curvature along both axes.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments
# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.mechanics.projection_kernels import pixel, slope

THINNEST, THICKEST = 0.5, 1.3  # bounds of the thickness ratio, far beyond any press that is meant


@njit(cache=True, fastmath=True)
@no_type_check
def surface_frame(coefficient, columns, first, table, x_is_slow, out):
    """Displacement, a1 and a2 of the middle surface at a place, into `out` (3, 3)."""
    u0 = u1 = u2 = s0 = s1 = s2 = f0 = f1 = f2 = 0.0
    for a in range(4):
        start = (first[0] + a) * columns + first[1]
        v0 = v1 = v2 = d0 = d1 = d2 = 0.0
        for b in range(4):
            n, d = table[1, 0, b], table[1, 1, b]
            c0, c1, c2 = coefficient[start + b, 0], coefficient[start + b, 1], coefficient[start + b, 2]
            v0 += n * c0
            v1 += n * c1
            v2 += n * c2
            d0 += d * c0
            d1 += d * c1
            d2 += d * c2
        n, d = table[0, 0, a], table[0, 1, a]
        u0 += n * v0
        u1 += n * v1
        u2 += n * v2
        s0 += d * v0
        s1 += d * v1
        s2 += d * v2
        f0 += n * d0
        f1 += n * d1
        f2 += n * d2
    out[0, 0], out[0, 1], out[0, 2] = u0, u1, u2
    if x_is_slow:
        out[1, 0], out[1, 1], out[1, 2] = 1.0 + s0, s1, s2
        out[2, 0], out[2, 1], out[2, 2] = f0, 1.0 + f1, f2
    else:
        out[1, 0], out[1, 1], out[1, 2] = 1.0 + f0, f1, f2
        out[2, 0], out[2, 1], out[2, 2] = s0, 1.0 + s1, s2


@njit(cache=True, fastmath=True)
@no_type_check
def thickness_ratio(coefficient, columns, first, table, frame, thickness, nu):
    """Thickness of the camera-side half of the sheet over that at rest, and if it is within its bounds."""
    trace = -1.0
    for j in range(3):
        trace += 0.5 * (frame[1, j] ** 2 + frame[2, j] ** 2)
    bend = 0.0
    for a in range(4):
        start = (first[0] + a) * columns + first[1]
        for b in range(4):
            both = table[0, 2, a] * table[1, 0, b] + table[0, 0, a] * table[1, 2, b]
            bend += both * coefficient[start + b, 2]
    ratio = 1.0 - nu / (1.0 - nu) * (trace + 0.25 * thickness * bend)
    return min(max(ratio, THINNEST), THICKEST), THINNEST < ratio < THICKEST


@njit(cache=True, fastmath=True)
@no_type_check
def _normal(frame, out):
    """Unit normal of the middle surface into `out`, and |a1 x a2|."""
    out[0] = frame[1, 1] * frame[2, 2] - frame[1, 2] * frame[2, 1]
    out[1] = frame[1, 2] * frame[2, 0] - frame[1, 0] * frame[2, 2]
    out[2] = frame[1, 0] * frame[2, 1] - frame[1, 1] * frame[2, 0]
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for j in range(3):
        out[j] /= length
    return length


@njit(cache=True, fastmath=True)
@no_type_check
def face_displacement(coefficient, columns, first, table, x_is_slow, thickness, nu, height, out):
    """Displacement (k, 3) of points that stand `height` off the camera-side face."""
    frame, normal = np.empty((3, 3)), np.empty(3)
    for k in range(len(first)):
        surface_frame(coefficient, columns, first[k], table[k], x_is_slow, frame)
        ratio, _ = thickness_ratio(coefficient, columns, first[k], table[k], frame, thickness, nu)
        _normal(frame, normal)
        lever = 0.5 * thickness * ratio + height
        for j in range(3):
            out[k, j] = frame[0, j] - lever * normal[j]
        out[k, 2] += 0.5 * thickness + height


@njit(cache=True, fastmath=True)
@no_type_check
def centroids(
    coefficient,
    columns,
    first,
    table,
    place_mm,
    x_is_slow,
    thickness,
    nu,
    height,
    camera,
    out,
):
    """Pixels (m, 2) of the centroids of the images of the dots' deformed discs.

    first, table, place_mm: at (m, k) places on the outlines.
    """
    frame, normal = np.empty((3, 3)), np.empty(3)
    count = first.shape[1]
    u, v = np.empty(count), np.empty(count)
    for i in range(len(first)):
        for k in range(count):
            surface_frame(coefficient, columns, first[i, k], table[i, k], x_is_slow, frame)
            ratio, _ = thickness_ratio(coefficient, columns, first[i, k], table[i, k], frame, thickness, nu)
            lever = 0.5 * thickness * ratio + height
            _normal(frame, normal)
            u[k], v[k] = pixel(
                camera,
                place_mm[i, k, 0] + frame[0, 0] - lever * normal[0],
                place_mm[i, k, 1] + frame[0, 1] - lever * normal[1],
                place_mm[i, k, 2] + frame[0, 2] - lever * normal[2] + 0.5 * thickness + height,
            )
        area = up = right = 0.0
        for k in range(1, count - 1):  # triangles from the first point
            au, av, bu, bv = u[k] - u[0], v[k] - v[0], u[k + 1] - u[0], v[k + 1] - v[0]
            cross = au * bv - av * bu
            area += cross
            right += cross * (au + bu)
            up += cross * (av + bv)
        out[i, 0] = u[0] + right / (3.0 * area)
        out[i, 1] = v[0] + up / (3.0 * area)


@njit(cache=True, fastmath=True)
@no_type_check
def _face_derivative(frame, normal, length, lever, thinning, nx, ny, bend, value, thickness, out):
    """Derivative (3, 3) of a point off the face with respect to the coefficients of one node."""
    for j in range(3):  # of a unit change of component j
        # d(a1 x a2) = e_j x a2 nx + a1 x e_j ny
        k, m = (j + 1) % 3, (j + 2) % 3
        d_k = -nx * frame[2, m] + ny * frame[1, m]
        d_m = nx * frame[2, k] - ny * frame[1, k]
        along = normal[k] * d_k + normal[m] * d_m
        thicker = nx * frame[1, j] + ny * frame[2, j]
        if j == 2:
            thicker += 0.25 * thickness * bend
        share = lever / length * along + thinning * thicker
        for i in range(3):
            out[i, j] = share * normal[i]
        out[j, j] += value
        out[k, j] -= lever / length * d_k
        out[m, j] -= lever / length * d_m


@njit(cache=True, fastmath=True)
@no_type_check
def face_derivatives(coefficient, columns, first, table, x_is_slow, thickness, nu, height, out):
    """Derivative (k, 3, 16, 3) of `face_displacement` with respect to the 4 x 4 nodes of each place."""
    frame, normal, block = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for k in range(len(first)):
        surface_frame(coefficient, columns, first[k], table[k], x_is_slow, frame)
        ratio, varies = thickness_ratio(coefficient, columns, first[k], table[k], frame, thickness, nu)
        thinning = 0.5 * thickness * nu / (1.0 - nu) if varies else 0.0
        length = _normal(frame, normal)
        lever = 0.5 * thickness * ratio + height
        for a in range(4):
            for b in range(4):
                value = table[k, 0, 0, a] * table[k, 1, 0, b]
                along_slow = table[k, 0, 1, a] * table[k, 1, 0, b]
                along_fast = table[k, 0, 0, a] * table[k, 1, 1, b]
                bend = table[k, 0, 2, a] * table[k, 1, 0, b] + table[k, 0, 0, a] * table[k, 1, 2, b]
                nx, ny = (along_slow, along_fast) if x_is_slow else (along_fast, along_slow)
                _face_derivative(
                    frame, normal, length, lever, thinning, nx, ny, bend, value, thickness, block
                )
                for i in range(3):
                    for j in range(3):
                        out[k, i, 4 * a + b, j] = block[i, j]


@njit(cache=True, fastmath=True)
@no_type_check
def centre_derivatives(position, camera, face, out):
    """Derivative (m, 2, 16, 3) of the centres' pixels from `position` (m, 3) and `face` (m, 3, 16, 3)."""
    camera_slope = np.empty((2, 3))
    for k in range(len(position)):
        slope(camera, position[k, 0], position[k, 1], position[k, 2], camera_slope)
        for axis in range(2):
            g0, g1, g2 = camera_slope[axis, 0], camera_slope[axis, 1], camera_slope[axis, 2]
            for n in range(16):
                for j in range(3):
                    out[k, axis, n, j] = g0 * face[k, 0, n, j] + g1 * face[k, 1, n, j] + g2 * face[k, 2, n, j]
