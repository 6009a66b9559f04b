"""The response of an unbounded layer to a force on one node of a spline, by Galerkin's method."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex128, Float64

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.pad.axes import DEGREE_Z, depth_axis, lame_constants, polynomials, spline_axis

_COUPLED_NODES = 3  # along an axis on each side of a node: those whose cubic splines share elements with its


class _Integrals(NamedTuple):
    """Integrals along one axis: of values, of slopes, of slopes with values, and of values with slopes.

    Their axes are waves along x and along y, and both polynomials through the thickness.
    """

    value: np.ndarray
    slope: np.ndarray
    mixed: np.ndarray
    turned: np.ndarray


def layer_node_response(
    step_mm: tuple[float, float],
    counts: tuple[int, int],
    thickness_mm: float,
    poisson: float,
    depth_mm: float = 0.0,
) -> Float64[np.ndarray, "a b 3 3"]:
    """Spline coefficients of the displacement of a layer at a depth, per force over E on a node of its face.

    The layer has no sides: its uniform splines, and the force, are periodic. Each pair of wave numbers has
    equations of its own.

    Args:
        step_mm: size of an element along x and y.
        counts: nodes of a period along x and y, at least 7.
        thickness_mm, poisson: as in `pad_response`.
        depth_mm: below the contact face.

    Returns:
        (a, b, 3, 3) for each node of a period along x and y, the loaded one first: components of the
        displacement by components of the force, 1/mm.

    Raises:
        ZeroDivisionError: a Poisson's ratio of 1/2.
    """
    lam, mu = lame_constants(poisson)
    through = depth_axis(thickness_mm)
    integrals = (
        _waves(step_mm[0], counts[0], 0),
        _waves(step_mm[1], counts[1], 1),
        _Integrals(through.value, through.slope, through.mixed, through.mixed.T),
    )
    matrix = np.zeros((*counts, DEGREE_Z, 3, DEGREE_Z, 3), dtype=np.complex128)
    for row in range(3):
        for column in range(3):
            total = lam * _product(integrals, row, column) + mu * _product(integrals, column, row)
            if row == column:
                total = total + mu * sum(_product(integrals, along, along) for along in range(3))
            matrix[:, :, :, row, :, column] = total
    unknowns = 3 * DEGREE_Z
    load = np.eye(unknowns)[:, :3]  # of the first polynomial
    answer = np.linalg.solve(matrix.reshape(*counts, unknowns, unknowns), load)
    value = polynomials(np.array([1.0 - depth_mm / thickness_mm]))[0][0]
    wave = np.einsum("p,xypij->xyij", value, answer.reshape(*counts, DEGREE_Z, 3, 3))
    return np.ascontiguousarray(np.fft.ifft2(wave, axes=(0, 1)).real)


def _waves(step_mm: float, count: int, axis: int) -> _Integrals:
    """Integrals of periodic uniform splines along x (0) or y (1) for each wave."""
    few = SplinePatch(size_mm=(13.0 * step_mm, 13.0 * step_mm), elements=(13, 13), boundary="soft")
    uniform, middle = spline_axis(few, 0), few.shape[0] // 2
    shape = [1, 1, 1, 1]
    shape[axis] = count

    def wave(matrix: np.ndarray) -> np.ndarray:
        row = np.zeros(count)
        coupled = np.arange(-_COUPLED_NODES, _COUPLED_NODES + 1)
        row[coupled] = matrix[middle, middle + coupled]
        return (count * np.fft.ifft(row)).reshape(shape)

    mixed = wave(uniform.mixed)
    return _Integrals(wave(uniform.value), wave(uniform.slope), mixed, mixed.conj())


def _product(
    integrals: Sequence[_Integrals], along_row: int, along_column: int
) -> Complex128[np.ndarray, "a b d d"]:
    """Integral of a derivative along one axis times a derivative along another, per wave."""
    total = np.ones((1, 1, 1, 1), dtype=np.complex128)
    for axis, along in enumerate(integrals):
        if along_row == axis:
            total = total * (along.slope if along_column == axis else along.mixed)
        else:
            total = total * (along.turned if along_column == axis else along.value)
    return total
