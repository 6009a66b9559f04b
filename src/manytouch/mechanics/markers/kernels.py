"""Where the dots of a bent sheet show in the image, and how that changes with its shape, compiled.

Derivation: docs/derivations/mechanics.md, "Dots". A place on the sheet comes as (slow, fast) of the first
of its 4 x 4 nodes and the basis functions' value and three derivatives along both axes. `sheet`: thickness t,
nu, height of the points off the face, and `shear_mm2` of the shell.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments
# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.mechanics.markers.projection import pixel, slope

THINNEST, THICKEST = 0.5, 1.3  # bounds of the thickness ratio, far beyond any press that is meant


@njit(cache=True, nogil=True, fastmath=True)
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


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _tilt(coefficient, columns, first, table, x_is_slow, shear):
    """shear grad lap w along x and y: what the slopes that fibres stand on have more than those of w."""
    along_slow = along_fast = 0.0
    for a in range(4):
        start = (first[0] + a) * columns + first[1]
        s0, s1, s2, s3 = table[0, 0, a], table[0, 1, a], table[0, 2, a], table[0, 3, a]
        for b in range(4):
            w = coefficient[start + b, 2]
            along_slow += w * (s3 * table[1, 0, b] + s1 * table[1, 2, b])
            along_fast += w * (s2 * table[1, 1, b] + s0 * table[1, 3, b])
    if x_is_slow:
        return shear * along_slow, shear * along_fast
    return shear * along_fast, shear * along_slow


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _lever(frame, thickness, nu, height):
    """Distance from the middle surface, whether it varies with the shape; before the frame is tilted."""
    trace = -1.0
    for j in range(3):
        trace += 0.5 * (frame[1, j] ** 2 + frame[2, j] ** 2)
    ratio = 1.0 - nu / (1.0 - nu) * trace
    return 0.5 * thickness * min(max(ratio, THINNEST), THICKEST) + height, THINNEST < ratio < THICKEST


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _normal(frame, out):
    """Unit vector along a1 x a2 into `out`, and |a1 x a2|."""
    out[0] = frame[1, 1] * frame[2, 2] - frame[1, 2] * frame[2, 1]
    out[1] = frame[1, 2] * frame[2, 0] - frame[1, 0] * frame[2, 2]
    out[2] = frame[1, 0] * frame[2, 1] - frame[1, 1] * frame[2, 0]
    length = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for j in range(3):
        out[j] /= length
    return length


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _displaced(coefficient, columns, first, table, tilt_x, tilt_y, x_is_slow, sheet, frame, normal, out):
    """Displacement (3,) of one point that stands off the camera-side face."""
    thickness, nu, height, _ = sheet
    surface_frame(coefficient, columns, first, table, x_is_slow, frame)
    lever, _ = _lever(frame, thickness, nu, height)
    frame[1, 2] += tilt_x
    frame[2, 2] += tilt_y
    _normal(frame, normal)
    for j in range(3):
        out[j] = frame[0, j] - lever * normal[j]
    out[2] += 0.5 * thickness + height


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def face_displacement(coefficient, columns, first, table, x_is_slow, sheet, out):
    """Displacement (k, 3) of points that stand off the camera-side face."""
    frame, normal = np.empty((3, 3)), np.empty(3)
    for k in range(len(first)):
        dx, dy = _tilt(coefficient, columns, first[k], table[k], x_is_slow, sheet[3])
        _displaced(coefficient, columns, first[k], table[k], dx, dy, x_is_slow, sheet, frame, normal, out[k])


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def centroids(
    coefficient, columns, first, table, edge_first, edge_table, edge_mm, x_is_slow, sheet, camera, out
):
    """Pixels (m, 2) of the centroids of the images of the dots' deformed discs.

    first, table: at the centres; edge_first, edge_table, edge_mm: at (m, k) places on the outlines. The
    fibres of a dot have the tilt of that at its centre: third derivatives jump between elements.
    """
    frame, normal, moved = np.empty((3, 3)), np.empty(3), np.empty(3)
    count = edge_first.shape[1]
    u, v = np.empty(count), np.empty(count)
    for i in range(len(edge_first)):
        dx, dy = _tilt(coefficient, columns, first[i], table[i], x_is_slow, sheet[3])
        for k in range(count):
            _displaced(
                coefficient, columns, edge_first[i, k], edge_table[i, k], dx, dy, x_is_slow, sheet,
                frame, normal, moved,
            )  # fmt: skip
            u[k], v[k] = pixel(
                camera,
                edge_mm[i, k, 0] + moved[0],
                edge_mm[i, k, 1] + moved[1],
                edge_mm[i, k, 2] + moved[2],
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


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def _turning(frame, tilted, normal, share, thinning, nx, ny, tx, ty, value, out):
    """Derivative (3, 3) of a point off the face with respect to the coefficients of one node.

    frame: a1 and a2 of the middle surface; tilted: those that the normal belongs to. share: lever over
    |a1 x a2|. nx, ny: slopes of the node's function; tx, ty: those of w on which fibres stand.
    """
    for j in range(3):  # of a unit change of component j
        # d(a1 x a2) = e_j x a2 dx + a1 x e_j dy
        k, m = (j + 1) % 3, (j + 2) % 3
        dx, dy = (tx, ty) if j == 2 else (nx, ny)
        d_k = -dx * tilted[2, m] + dy * tilted[1, m]
        d_m = dx * tilted[2, k] - dy * tilted[1, k]
        along = share * (normal[k] * d_k + normal[m] * d_m)
        along += thinning * (nx * frame[1, j] + ny * frame[2, j])
        for i in range(3):
            out[i, j] = along * normal[i]
        out[j, j] += value
        out[k, j] -= share * d_k
        out[m, j] -= share * d_m


@njit(cache=True, nogil=True, fastmath=True)
@no_type_check
def face_derivatives(coefficient, columns, first, table, x_is_slow, sheet, out):
    """Derivative (k, 3, 16, 3) of `face_displacement` with respect to the 4 x 4 nodes of each place."""
    thickness, nu, height, shear = sheet
    frame, tilted, normal, block = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for k in range(len(first)):
        slow, fast = table[k, 0], table[k, 1]
        surface_frame(coefficient, columns, first[k], table[k], x_is_slow, frame)
        lever, varies = _lever(frame, thickness, nu, height)
        thinning = 0.5 * thickness * nu / (1.0 - nu) if varies else 0.0
        tilted[:] = frame
        dx, dy = _tilt(coefficient, columns, first[k], table[k], x_is_slow, shear)
        tilted[1, 2] += dx
        tilted[2, 2] += dy
        share = lever / _normal(tilted, normal)
        for a in range(4):
            for b in range(4):
                value = slow[0, a] * fast[0, b]
                ds, df = slow[1, a] * fast[0, b], slow[0, a] * fast[1, b]
                ts = ds + shear * (slow[3, a] * fast[0, b] + slow[1, a] * fast[2, b])
                tf = df + shear * (slow[2, a] * fast[1, b] + slow[0, a] * fast[3, b])
                if x_is_slow:
                    _turning(frame, tilted, normal, share, thinning, ds, df, ts, tf, value, block)
                else:
                    _turning(frame, tilted, normal, share, thinning, df, ds, tf, ts, value, block)
                for i in range(3):
                    for j in range(3):
                        out[k, i, 4 * a + b, j] = block[i, j]


@njit(cache=True, nogil=True, fastmath=True)
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
