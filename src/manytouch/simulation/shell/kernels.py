"""Energy and forces of the sheet that is solved live, compiled; derivation in docs/derivations/live-sheet.md.

Nodal values are (5, a, b): displacement x, y, z of the middle surface, then the tilt p, q of the
fibre (p, q, 1) / sqrt(1 + p^2 + q^2), on grid lines along x (a) and y (b).
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import NamedTuple

import numpy as np

from manytouch.compilation import REORDER, kernel, no_type_check


class ShellLaw(NamedTuple):
    """Material and thickness of the sheet; see `energy.shell_law`.

    Attributes:
        first_MPa, second_MPa: factors of tr C - 2 and of (det C^-q - 1) / q, twice the energy density.
        exponent: q = nu / (1 - nu).
        lever_mm: from the middle surface to either layer.
        shear_N_per_mm: transverse shear stiffness.
        cell_mm2: area of a cell of the grid.
        half_mm: half of the thickness.
    """

    first_MPa: float
    second_MPa: float
    exponent: float
    lever_mm: float
    shear_N_per_mm: float
    cell_mm2: float
    half_mm: float


class ElasticBuffers(NamedTuple):
    """Arrays that `elastic` fills, kept between calls.

    Attributes:
        fibre: (3, a, b) directors, as long as the sheet is thick for 1.
        by_fibre: (3, a, b) derivatives of the energy by them.
        tangent, force: (2, 6, a, b) of the edges along each axis, lower layer, then upper layer.
        determinant: (a, b) sum of det C over the corners of the cells around a node, in both layers.
    """

    fibre: np.ndarray
    by_fibre: np.ndarray
    tangent: np.ndarray
    force: np.ndarray
    determinant: np.ndarray


class _Edges(NamedTuple):
    """Edges along one axis: axis, length, lever of the layers, transverse shear stiffness of an edge."""

    axis: int
    spacing_mm: float
    lever_mm: float
    shear_N_mm: float


@kernel(fastmath=REORDER)
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


@kernel()
@no_type_check
def fibres(value: np.ndarray, stretch: np.ndarray, fibre: np.ndarray) -> None:
    """Fill fibre (3, a, b): the directors, as long as the sheet is thick for 1."""
    for i in range(value.shape[1]):
        for j in range(value.shape[2]):
            p, q = value[3, i, j], value[4, i, j]
            scale = stretch[i, j] / math.sqrt(1.0 + p * p + q * q)
            fibre[0, i, j], fibre[1, i, j], fibre[2, i, j] = p * scale, q * scale, scale


@kernel()
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


@kernel(fastmath=REORDER)
@no_type_check
def _layer(
    along_x: np.ndarray,
    along_y: np.ndarray,
    force_x: np.ndarray,
    force_y: np.ndarray,
    determinant: np.ndarray,
    law: ShellLaw,
    weight: float,
) -> float:
    """Energy of one layer; adds its forces on the tangents, and det C at the nodes to determinant.

    Each cell is integrated at its corners: there, the tangents are those of its edges.
    """
    first, second, q = law.first_MPa, law.second_MPa, law.exponent
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
                    determinant[at, j + up] += det
                    a, b, c = weight * (first - s * cyy), weight * (first - s * cxx), weight * s * cxy
                    force_x[0, i, j + up] += a * gx0 + c * gy0
                    force_x[1, i, j + up] += a * gx1 + c * gy1
                    force_x[2, i, j + up] += a * gx2 + c * gy2
                    force_y[0, at, j] += b * gy0 + c * gx0
                    force_y[1, at, j] += b * gy1 + c * gx1
                    force_y[2, at, j] += b * gy2 + c * gx2
    return 0.5 * weight * total


@kernel()
@no_type_check
def _gather(
    edges: _Edges,
    tangent: np.ndarray,
    force: np.ndarray,
    fibre: np.ndarray,
    out: np.ndarray,
    by_fibre: np.ndarray,
) -> float:
    """Edge forces of an axis to the nodes, with transverse shear on the way; returns its energy."""
    down, right = (1, 0) if edges.axis == 0 else (0, 1)
    spacing, lever, shear = edges.spacing_mm, edges.lever_mm, edges.shear_N_mm
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
                by_fibre[k, i, j] += turn - bend
                by_fibre[k, end, beyond] += turn + bend
    return total


@kernel()
@no_type_check
def elastic(
    value: np.ndarray,
    stretch: np.ndarray,
    spacing: np.ndarray,
    law: ShellLaw,
    buffers: ElasticBuffers,
    out: np.ndarray,
) -> float:
    """Elastic energy in N mm.

    Args:
        value: (5, a, b) displacements in mm and tilts.
        stretch: (a, b) thickness over that at rest.
        spacing: (2,) of the grid, mm.
        law: of the sheet.
        buffers: filled, derivatives by the fibres among them.
        out: (5, a, b); the first three are filled with the derivatives by displacement, the others with 0.
    """
    tangent, force = buffers.tangent, buffers.force
    force[:] = 0.0
    buffers.determinant[:] = 0.0
    out[:] = 0.0
    buffers.by_fibre[:] = 0.0
    fibres(value, stretch, buffers.fibre)
    total = 0.0
    for axis in range(2):
        _edges(value, buffers.fibre, axis, spacing[axis], law.lever_mm, tangent[axis])
    for layer in range(2):
        part = slice(3 * layer, 3 * layer + 3)
        total += _layer(
            tangent[0, part],
            tangent[1, part],
            force[0, part],
            force[1, part],
            buffers.determinant,
            law,
            0.25 * law.cell_mm2 * law.half_mm,
        )
    for axis in range(2):
        edges = _Edges(axis, spacing[axis], law.lever_mm, law.shear_N_per_mm * law.cell_mm2)
        total += _gather(edges, tangent[axis], force[axis], buffers.fibre, out, buffers.by_fibre)
    return total


@kernel()
@no_type_check
def finish_slope(value: np.ndarray, stretch: np.ndarray, out: np.ndarray, by_fibre: np.ndarray) -> None:
    """Fill the derivatives by the tilts (out[3:]) from those by the fibres; all are 0 on the outline."""
    out[:, 0] = 0.0
    out[:, -1] = 0.0
    out[:, :, 0] = 0.0
    out[:, :, -1] = 0.0
    for i in range(1, value.shape[1] - 1):
        for j in range(1, value.shape[2] - 1):
            p, q = value[3, i, j], value[4, i, j]
            size = 1.0 + p * p + q * q
            scale = stretch[i, j] / math.sqrt(size)
            along = (p * by_fibre[0, i, j] + q * by_fibre[1, i, j] + by_fibre[2, i, j]) / size
            out[3, i, j] = scale * (by_fibre[0, i, j] - p * along)
            out[4, i, j] = scale * (by_fibre[1, i, j] - q * along)
