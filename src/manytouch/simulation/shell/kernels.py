"""Energy and forces of the sheet that is solved live, compiled; derivation in docs/derivations/live-sheet.md.

Nodal values stand as (5, a, b): displacement x, y, z of the middle surface, then the tilt p, q of the
fibre (p, q, 1) / sqrt(1 + p^2 + q^2), on grid lines along x (a) and y (b).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.simulation.fem.contact import distance


@njit(cache=True, nogil=True, fastmath={"contract", "arcp", "nsz", "reassoc"}, error_model="numpy")
@no_type_check
def power(base: float, exponent: float) -> float:
    """base ** exponent for bases near 1, in plain arithmetic so that loops become vector instructions.

    ln by 2 artanh((base - 1) / (base + 1)), exp by its series after halving twice: to 1e-9 for bases
    from 0.4 to 3.
    """
    y = (base - 1.0) / (base + 1.0)
    z = y * y
    tail = 1 / 15 + z * (1 / 17 + z * (1 / 19 + z * (1 / 21)))
    odd = 1.0 + z * (1 / 3 + z * (1 / 5 + z * (1 / 7 + z * (1 / 9 + z * (1 / 11 + z * (1 / 13 + z * tail))))))
    x = 0.25 * exponent * 2.0 * y * odd
    series = 1.0 + x * (
        1.0 + x / 2 * (1.0 + x / 3 * (1.0 + x / 4 * (1.0 + x / 5 * (1.0 + x / 6 * (1.0 + x / 7)))))
    )
    square = series * series
    return square * square


@njit(cache=True, nogil=True)
@no_type_check
def fibres(value: np.ndarray, stretch: np.ndarray, fibre: np.ndarray) -> None:
    """Fill fibre (3, a, b): the directors, as long as the sheet is thick for 1."""
    for i in range(value.shape[1]):
        for j in range(value.shape[2]):
            p, q = value[3, i, j], value[4, i, j]
            scale = stretch[i, j] / math.sqrt(1.0 + p * p + q * q)
            fibre[0, i, j], fibre[1, i, j], fibre[2, i, j] = p * scale, q * scale, scale


@njit(cache=True, nogil=True)
@no_type_check
def _edges(
    value: np.ndarray, fibre: np.ndarray, axis: int, spacing: float, lever: float, out: np.ndarray
) -> None:
    """Tangents (6, a, b) of the lower and the upper layer along an axis, one for each edge."""
    down, right = (1, 0) if axis == 0 else (0, 1)
    for k in range(3):
        base = 1.0 if k == axis else 0.0
        for i in range(value.shape[1] - down):
            for j in range(value.shape[2] - right):
                middle = base + (value[k, i + down, j + right] - value[k, i, j]) / spacing
                bend = lever * (fibre[k, i + down, j + right] - fibre[k, i, j]) / spacing
                out[k, i, j] = middle - bend
                out[3 + k, i, j] = middle + bend


@njit(cache=True, nogil=True, fastmath={"contract", "arcp", "nsz", "reassoc"}, error_model="numpy")
@no_type_check
def _layer(
    along_x: np.ndarray,
    along_y: np.ndarray,
    force_x: np.ndarray,
    force_y: np.ndarray,
    square: np.ndarray,
    law: np.ndarray,
    weight: float,
) -> float:
    """Energy of one layer; adds its forces on the tangents, and det C at the nodes to square.

    Each cell is integrated at its corners: there, the tangents are those of its edges.
    """
    first, second, q = law[0], law[1], law[2]
    power_of = -1.0 - q
    rows, columns = along_y.shape[1], along_x.shape[2]
    total = 0.0
    for i in range(rows - 1):
        for di in range(2):
            for dj in range(2):
                at, up = i + di, dj
                for j in range(columns - 1):
                    gx0, gx1, gx2 = along_x[0, i, j + up], along_x[1, i, j + up], along_x[2, i, j + up]
                    gy0, gy1, gy2 = along_y[0, at, j], along_y[1, at, j], along_y[2, at, j]
                    cxx = gx0 * gx0 + gx1 * gx1 + gx2 * gx2
                    cyy = gy0 * gy0 + gy1 * gy1 + gy2 * gy2
                    cxy = gx0 * gy0 + gx1 * gy1 + gx2 * gy2
                    det = max(cxx * cyy - cxy * cxy, 0.2)
                    s = power(det, power_of) * second
                    total += first * (cxx - 1.0 + cyy - 1.0) + (s * det - second) / q
                    square[at, j + up] += det
                    a, b, c = weight * (first - s * cyy), weight * (first - s * cxx), weight * s * cxy
                    force_x[0, i, j + up] += a * gx0 + c * gy0
                    force_x[1, i, j + up] += a * gx1 + c * gy1
                    force_x[2, i, j + up] += a * gx2 + c * gy2
                    force_y[0, at, j] += b * gy0 + c * gx0
                    force_y[1, at, j] += b * gy1 + c * gx1
                    force_y[2, at, j] += b * gy2 + c * gx2
    return 0.5 * weight * total


@njit(cache=True, nogil=True)
@no_type_check
def _gather(
    out: np.ndarray,
    on_fibre: np.ndarray,
    tangent: np.ndarray,
    force: np.ndarray,
    fibre: np.ndarray,
    axis: int,
    spacing: float,
    lever: float,
    shear: float,
) -> float:
    """Edge forces of an axis to the nodes, with transverse shear on the way; returns its energy."""
    down, right = (1, 0) if axis == 0 else (0, 1)
    total = 0.0
    rows, columns = fibre.shape[1], fibre.shape[2]
    for i in range(rows - down):
        for j in range(columns - right):
            end, beyond = i + down, j + right
            gamma = 0.0
            for k in range(3):
                mean = 0.5 * (fibre[k, i, j] + fibre[k, end, beyond])
                gamma += 0.5 * (tangent[k, i, j] + tangent[3 + k, i, j]) * mean
            total += 0.5 * shear * gamma * gamma
            for k in range(3):
                mean = 0.5 * (fibre[k, i, j] + fibre[k, end, beyond])
                middle = 0.5 * (tangent[k, i, j] + tangent[3 + k, i, j])
                pull = (force[k, i, j] + force[3 + k, i, j] + shear * gamma * mean) / spacing
                bend = lever * (force[3 + k, i, j] - force[k, i, j]) / spacing
                turn = 0.5 * shear * gamma * middle
                out[k, i, j] -= pull
                out[k, end, beyond] += pull
                on_fibre[k, i, j] += turn - bend
                on_fibre[k, end, beyond] += turn + bend
    return total


@njit(cache=True, nogil=True)
@no_type_check
def elastic(
    value: np.ndarray,
    stretch: np.ndarray,
    fibre: np.ndarray,
    spacing: np.ndarray,
    law: np.ndarray,
    tangents: np.ndarray,
    forces: np.ndarray,
    square: np.ndarray,
    out: np.ndarray,
    on_fibre: np.ndarray,
) -> float:
    """Elastic energy; fills its derivatives by displacement (out[:3]) and by fibre, and det C (a, b)."""
    lever, shear, area, half = law[3], law[4], law[5], law[6]
    forces[:] = 0.0
    square[:] = 0.0
    out[:] = 0.0
    on_fibre[:] = 0.0
    fibres(value, stretch, fibre)
    total = 0.0
    for axis in range(2):
        _edges(value, fibre, axis, spacing[axis], lever, tangents[axis])
    for layer in range(2):
        part = slice(3 * layer, 3 * layer + 3)
        total += _layer(
            tangents[0, part],
            tangents[1, part],
            forces[0, part],
            forces[1, part],
            square,
            law,
            0.25 * area * half,
        )
    for axis in range(2):
        total += _gather(
            out, on_fibre, tangents[axis], forces[axis], fibre, axis, spacing[axis], lever, shear * area
        )
    return total


@njit(cache=True, nogil=True)
@no_type_check
def _cells(position: float, reach: float, spacing: float, count: int) -> tuple[int, int]:
    """First and one beyond the last of the cells along an axis that a body can touch."""
    start = -0.5 * spacing * count
    first = max(int((position - reach - start) / spacing), 0)
    return first, min(int((position + reach - start) / spacing) + 1, count)


@njit(cache=True, nogil=True)
@no_type_check
def _there(place: np.ndarray, position: np.ndarray, rotation: np.ndarray, local: np.ndarray) -> float:
    """Fill local with a place in a body's frame; returns its square, or infinity where no body can be."""
    for k in range(3):
        local[k] = 0.0
        for m in range(3):
            local[k] += rotation[m, k] * (place[m] - position[m])
    if local[2] <= 0.0:
        return np.inf  # bodies stand on the origin of their frame
    return local[0] ** 2 + local[1] ** 2 + local[2] ** 2


@njit(cache=True, nogil=True)
@no_type_check
def touch(
    value: np.ndarray,
    fibre: np.ndarray,
    spacing: np.ndarray,
    half: float,
    stiffness: float,
    kind: np.ndarray,
    numbers: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    reach: np.ndarray,
    out: np.ndarray,
    on_fibre: np.ndarray,
    covered: np.ndarray,
    told: np.ndarray,
) -> float:
    """Energy of the contact; adds its derivatives to out and on_fibre.

    The touched face is half a fibre above the middle surface; it is looked at in four points of each cell.
    Fills told (bodies, 7): force on the sheet (3), its torque about z, its z part times undeformed x and y,
    area; and which body covers each point (a', b'), -1 for none.
    """
    cells = value.shape[1] - 1, value.shape[2] - 1
    weight = 0.25 * spacing[0] * spacing[1]
    normal, curvature = np.empty(3), np.empty((3, 3))
    here, local, push, shape = np.empty(3), np.empty(3), np.empty(3), np.empty(4)
    told[:] = 0.0
    covered[:] = -1
    total = 0.0
    for body in range(kind.shape[0]):
        first_i, last_i = _cells(position[body, 0], reach[body], spacing[0], cells[0])
        first_j, last_j = _cells(position[body, 1], reach[body], spacing[1], cells[1])
        for place in range(4 * max(last_i - first_i, 0) * max(last_j - first_j, 0)):
            cell, part = place // 4, place % 4
            i, j = first_i + cell // (last_j - first_j), first_j + cell % (last_j - first_j)
            s, r = 0.25 + 0.5 * (part // 2), 0.25 + 0.5 * (part % 2)
            shape[0], shape[1], shape[2], shape[3] = (1 - s) * (1 - r), (1 - s) * r, s * (1 - r), s * r
            here[0], here[1], here[2] = (
                (i + s - 0.5 * cells[0]) * spacing[0],
                (j + r - 0.5 * cells[1]) * spacing[1],
                0.0,
            )
            rest_x, rest_y = here[0], here[1]
            for node in range(4):
                at_i, at_j = i + node // 2, j + node % 2
                for k in range(3):
                    here[k] += shape[node] * (value[k, at_i, at_j] + half * fibre[k, at_i, at_j])
            if _there(here, position[body], rotation[body], local) > reach[body] ** 2:
                continue
            depth = distance.signed_distance(kind[body], numbers[body], local, normal, curvature)
            if depth >= 0.0:
                continue
            covered[2 * i + part // 2, 2 * j + part % 2] = body
            total += 0.5 * stiffness * weight * depth * depth
            for k in range(3):
                push[k] = 0.0
                for m in range(3):
                    push[k] -= rotation[body, k, m] * normal[m] * stiffness * weight * depth
                told[body, k] += push[k]
                for node in range(4):
                    at_i, at_j = i + node // 2, j + node % 2
                    out[k, at_i, at_j] -= shape[node] * push[k]
                    on_fibre[k, at_i, at_j] -= shape[node] * half * push[k]
            told[body, 3] += here[0] * push[1] - here[1] * push[0]
            told[body, 4] += rest_x * push[2]
            told[body, 5] += rest_y * push[2]
            told[body, 6] += weight
    return total


@njit(cache=True, nogil=True)
@no_type_check
def close(value: np.ndarray, stretch: np.ndarray, out: np.ndarray, on_fibre: np.ndarray) -> None:
    """Derivatives by the fibre become derivatives by its tilt; nothing acts on the clamped outline."""
    rows, columns = value.shape[1], value.shape[2]
    for i in range(rows):
        for j in range(columns):
            if i in {0, rows - 1} or j in {0, columns - 1}:
                out[:, i, j] = 0.0
                continue
            p, q = value[3, i, j], value[4, i, j]
            size = 1.0 + p * p + q * q
            scale = stretch[i, j] / math.sqrt(size)
            along = (p * on_fibre[0, i, j] + q * on_fibre[1, i, j] + on_fibre[2, i, j]) / size
            out[3, i, j] = scale * (on_fibre[0, i, j] - p * along)
            out[4, i, j] = scale * (on_fibre[1, i, j] - q * along)
