"""Internal forces of the shell at all Gauss points at once, as products of small matrices.

The basis functions are products of functions along the slow and the fast axis, and so are the sums over
elements: strains at all points, and forces from all stresses, are matrix products along one axis after the
other (sum factorisation; S. A. Orszag 1980, doi:10.1016/0021-9991(80)90005-4). Symbols are as in `kernels`.
An isotropic sheet is the same with x and y exchanged, so that x is the slow axis here.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.shell.kernels import Elements, Stiffness, squared_cosine
from manytouch.mechanics.shell.material import stress

Along = Float64[np.ndarray, "_ _ _"]
Fields = Float64[np.ndarray, "fields slow fast"]

A10, A11, A20, A21, K1, L1S, A12S, K2, L2S, A22S, K3, L1F, L2F = range(13)
"""Rows of the strains. Those with S and F are parts of one sum: by higher derivatives along slow and fast."""

GROUP = 16
"""Gauss points whose stresses are computed together."""

PX, QX, PY, QY, RX, M1, LX, M2, RY, M3, LY = range(11)
"""Rows of the stresses; the order makes the factors of each basis function neighbours."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceProducts:
    """Basis functions of a patch along its axes, with their derivatives, at the Gauss points.

    Attributes:
        plane_slow, plane_fast: (2, points, nodes) of the displacements along x and y, orders 0 and 1.
        bending_slow, bending_fast: (4, points, nodes) of the bending deflection, orders 0 to 3.
        weight: (points along slow, points along fast) of the Gauss points, mm^2.
        is_x_slow: whether x is the slow axis.
    """

    plane_slow: Along
    plane_fast: Along
    bending_slow: Along
    bending_fast: Along
    weight: Float64[np.ndarray, "slow fast"]
    is_x_slow: bool

    @staticmethod
    def of(elements: Elements) -> "ForceProducts":
        """The products of the elements of a patch."""
        slow, fast = (len(table) for table in (elements.slow, elements.fast))
        weight = np.tile(elements.weight.reshape(3, 3), (slow, fast))
        tables = (
            _along(table, elements.dropped, orders)
            for orders, table in (
                (2, elements.slow),
                (2, elements.fast),
                (4, elements.bending_slow),
                (4, elements.bending_fast),
            )
        )
        plane_slow, plane_fast, bending_slow, bending_fast = tables
        return ForceProducts(
            plane_slow=plane_slow,
            plane_fast=plane_fast,
            bending_slow=bending_slow,
            bending_fast=bending_fast,
            weight=weight,
            is_x_slow=elements.is_x_slow,
        )

    def forces(self, coefficient_mm: Nodal, stiffness: Stiffness) -> Nodal:
        """Derivative (nodes, 3) of the energy over E by the coefficients, mm^2."""
        strain = self._strains(coefficient_mm)
        resultant = np.empty((11, *self.weight.shape))
        stresses(strain.reshape(len(strain), -1), self.weight.ravel(), stiffness, resultant.reshape(11, -1))
        return self._assembled(resultant)

    def _strains(self, coefficient_mm: Nodal) -> Fields:
        """(13, slow points, fast points) derivatives of displacements and of the bending deflection."""
        slow, fast = self.bending_slow.shape[2], self.bending_fast.shape[2]
        first, second = (0, 1) if self.is_x_slow else (1, 0)
        nodal = coefficient_mm.reshape(slow, fast, 3)
        p0, p1 = self.plane_fast.transpose(0, 2, 1)
        b0, b1, b2, b3 = self.bending_fast.transpose(0, 2, 1)
        s0, s1 = self.plane_slow
        _, d1, d2, d3 = self.bending_slow
        low, high = self.bending_slow[:3], self.bending_slow[1:]
        out = np.empty((13, *self.weight.shape))
        for axis, row in ((first, 0), (second, 1)):
            own = np.ascontiguousarray(nodal[:, :, axis])
            np.matmul(s1, own @ p0, out=out[A10 + row])
            np.matmul(s0, own @ p1, out=out[A20 + row])
        w = np.ascontiguousarray(nodal[:, :, 2])
        w0, w1, w2, w3 = w @ b0, w @ b1, w @ b2, w @ b3
        np.matmul(d1, w0, out=out[A12S])
        np.matmul(d2, w0, out=out[K1])
        np.matmul(d3, w0, out=out[L1S])
        np.matmul(low[0], w1, out=out[A22S])
        np.matmul(low[1], w1, out=out[K3])
        np.matmul(low[2], w1, out=out[L2S])
        np.matmul(low[0], w2, out=out[K2])
        np.matmul(high[0], w2, out=out[L1F])
        np.matmul(low[0], w3, out=out[L2F])
        return out

    def _assembled(self, resultant: Fields) -> Nodal:
        """(nodes, 3) sums over all Gauss points of the stresses times the derivatives of the functions."""
        first, second = (0, 1) if self.is_x_slow else (1, 0)
        s0, s1 = self.plane_slow.transpose(0, 2, 1)
        p0, p1 = self.plane_fast
        b0, b1, b2, b3 = self.bending_fast
        d0, d1, d2, d3 = self.bending_slow.transpose(0, 2, 1)
        out = np.empty((len(s0), p0.shape[1], 3))
        for axis, row in ((first, 0), (second, 1)):
            out[:, :, axis] = (s1 @ resultant[PX + row]) @ p0 + (s0 @ resultant[PY + row]) @ p1
        out[:, :, 2] = (
            (d1 @ resultant[RX] + d2 @ resultant[M1] + d3 @ resultant[LX]) @ b0
            + (d0 @ resultant[RY] + d1 @ resultant[M3] + d2 @ resultant[LY]) @ b1
            + (d1 @ resultant[LX] + d0 @ resultant[M2]) @ b2
            + (d0 @ resultant[LY]) @ b3
        )
        return np.asarray(out.reshape(-1, 3))


def _along(table: Float64[np.ndarray, "elements 3 4 4"], dropped: int, orders: int) -> Along:
    """Functions of all kept nodes along an axis at all its Gauss points."""
    elements, points = table.shape[:2]
    whole = np.zeros((orders, elements, points, elements + 3))
    for function in range(4):
        number = np.arange(elements)
        whole[:, number, :, number + function] = table[:, :, :orders, function].transpose(0, 2, 1)
    kept = slice(dropped, elements + 3 - dropped)
    return np.ascontiguousarray(whole.reshape(orders, elements * points, -1)[:, :, kept])


@kernel(fastmath=True)
@no_type_check
def stresses(
    strain: Float64[np.ndarray, "13 n"],
    weight: Float64[np.ndarray, " n"],
    stiffness: Stiffness,
    resultant: Float64[np.ndarray, "11 n"],
) -> None:
    """Stresses at n Gauss points, times their weights, from strains; rows are named above.

    Points are copied in groups: LLVM forms vectors only where all distances in memory are constants.
    """
    inside, out = np.ones((13 + 1) * GROUP), np.empty(11 * GROUP)
    for start in range(0, len(weight), GROUP):
        count = min(GROUP, len(weight) - start)
        for row in range(13):
            for n in range(count):
                inside[row * GROUP + n] = strain[row, start + n]
        for n in range(count):
            inside[13 * GROUP + n] = weight[start + n]
        stresses_of_group(inside, stiffness, out)
        for row in range(11):
            for n in range(count):
                resultant[row, start + n] = out[row * GROUP + n]


@kernel(fastmath=True)
@no_type_check
def stresses_of_group(
    strain: Float64[np.ndarray, " k"], stiffness: Stiffness, resultant: Float64[np.ndarray, " j"]
) -> None:
    """Stresses of GROUP points from their strains and weights, rows one after the other."""
    t, mu, bulk, tension, lever, shear, shear_stiffness = stiffness
    for n in range(GROUP):
        a10, a11 = 1.0 + strain[A10 * GROUP + n], strain[A11 * GROUP + n]
        a20, a21 = strain[A20 * GROUP + n], 1.0 + strain[A21 * GROUP + n]
        l1 = strain[L1S * GROUP + n] + strain[L1F * GROUP + n]
        l2 = strain[L2S * GROUP + n] + strain[L2F * GROUP + n]
        b1, b2 = strain[A12S * GROUP + n], strain[A22S * GROUP + n]
        a12, a22 = b1 - shear * l1, b2 - shear * l2
        k1, k2, k3 = strain[K1 * GROUP + n], strain[K2 * GROUP + n], 2.0 * strain[K3 * GROUP + n]
        weight = strain[13 * GROUP + n]
        e1 = 0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0)
        e2 = 0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0)
        e3 = a10 * a20 + a11 * a21 + a12 * a22
        c, g = squared_cosine(b1, b2), squared_cosine(a12, a22)
        z, half = lever * c, 0.5 * t * weight
        p1, p2, p3 = stress(e1 + z * k1, e2 + z * k2, e3 + z * k3, mu, bulk)
        q1, q2, q3 = stress(e1 - z * k1, e2 - z * k2, e3 - z * k3, mu, bulk)
        pull = weight * tension
        s1, s2, s3 = half * (p1 + q1) + pull, half * (p2 + q2) + pull, half * (p3 + q3)
        m1, m2, m3 = half * lever * (p1 - q1), half * lever * (p2 - q2), half * lever * (p3 - q3)
        h1, h2 = weight * shear_stiffness * g * l1, weight * shear_stiffness * g * l2
        turn, shift = -2.0 * c * c * (m1 * k1 + m2 * k2 + m3 * k3), -g * (h1 * l1 + h2 * l2)
        rx, ry = s1 * a12 + s3 * a22 + shift * a12, s3 * a12 + s2 * a22 + shift * a22
        resultant[PX * GROUP + n], resultant[QX * GROUP + n] = s1 * a10 + s3 * a20, s1 * a11 + s3 * a21
        resultant[PY * GROUP + n], resultant[QY * GROUP + n] = s3 * a10 + s2 * a20, s3 * a11 + s2 * a21
        resultant[RX * GROUP + n], resultant[RY * GROUP + n] = rx + turn * b1, ry + turn * b2
        resultant[M1 * GROUP + n], resultant[M2 * GROUP + n] = c * m1, c * m2
        resultant[M3 * GROUP + n] = 2.0 * c * m3
        resultant[LX * GROUP + n] = h1 - shear * rx
        resultant[LY * GROUP + n] = h2 - shear * ry
