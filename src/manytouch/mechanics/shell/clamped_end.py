"""The clamped outline of a thick sheet: its effective conditions, and the energy that belongs to them.

Where the side face of a slab is held, its strain across the slab is that of the clamp, and not that of
bending. This disturbance decays within half a thickness; beyond it, the slab bends as if at the outline

    b_n = e0 b_nn + e1 b_nnn,      w = -e1 b_nn + e2 b_nnn,

b being the bending deflection, w = b - a b_nn that of the camera-side face, and the derivatives along the
inward normal (R. D. Gregory and F. Y. M. Wan 1984, doi:10.1007/BF00041081, for the conditions of a plate that
a decaying state implies). The constants over powers of the thickness were computed by plane-strain finite
elements of a slab that is bent by a couple and by a force at its other end
(`benchmarks/clamped_end.py`). That the same e1 is in both is reciprocity. They are polynomials of Poisson's
ratio, exact to 0.0001.

Bending moment and shear force at the outline do work on this slope and deflection. The energy

    D / 2 * integral over the outline of  e0 b_nn^2 + 2 e1 b_nn b_nnn - e2 b_nnn^2

makes them balance, so that the shell with it has the shape of the slab.
"""

import numpy as np
from jaxtyping import Float64
from scipy.sparse import coo_array, csr_array, kron

from manytouch.geometry.spline.patch import SplinePatch

_E0 = (-2.67594, 2.26697, -0.98341, 0.06744, -0.00702, 0.0)
_E1 = (-0.78343, 0.45424, -0.27634, -0.07053, -0.09346, 0.0)
_E2 = (0.12049, -0.11382, 0.04707, -0.00472, 0.00187, 0.00312)
_GAUSS_POINTS = 4


def clamped_end(thickness_mm: float, poisson: float) -> tuple[float, float, float]:
    """The constants e0 (mm), e1 (mm^2) and e2 (mm^3) of the clamped outline of a slab."""
    e0, e1, e2 = (float(np.polyval(each, poisson)) for each in (_E0, _E1, _E2))
    return e0 * thickness_mm, e1 * thickness_mm**2, e2 * thickness_mm**3


def end_stiffness(patch: SplinePatch, rigidity_mm3: float) -> csr_array:
    """(nodes, nodes) second derivative of that energy over E by the bending deflections, mm.

    Args:
        patch: with its `clamped_end`.
        rigidity_mm3: D over E.
    """
    count = patch.node_count
    total = csr_array((count, count))
    if patch.boundary != "clamped" or not any(patch.clamped_end):
        return total
    e0, e1, e2 = patch.clamped_end
    energy = rigidity_mm3 * np.array([[e0, e1], [e1, -e2]])
    for across in (0, 1):
        by_node = patch.end_curvatures(across)
        block, nodes = by_node.T @ energy @ by_node, _node_count(patch, across)
        ends = np.zeros((nodes, nodes))
        ends[1:3, 1:3] += block
        ends[-3:-1, -3:-1] += block[::-1, ::-1]
        factors = [csr_array(ends), csr_array(_mass(patch, 1 - across))]
        total = total + kron(*(factors if patch.axes[0] == across else factors[::-1]), format="csr")
    matrix = coo_array(total)
    kept = patch.is_free[matrix.row, 2] & patch.is_free[matrix.col, 2] & (matrix.data != 0.0)
    return csr_array((matrix.data[kept], (matrix.row[kept], matrix.col[kept])), shape=(count, count))


def _node_count(patch: SplinePatch, axis: int) -> int:
    return patch.shape[patch.axes.index(axis)]


def _mass(patch: SplinePatch, axis: int) -> Float64[np.ndarray, "n n"]:
    """Integrals along an axis of the products of two functions of the bending deflection."""
    point, weight = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    elements = patch.elements[axis]
    step_mm = patch.size_mm[axis] / elements
    place_mm = ((np.arange(elements)[:, None] + 0.5 * (point + 1.0)) * step_mm).ravel()
    first, _, table = patch.functions(axis, place_mm)
    value = np.zeros((len(place_mm), _node_count(patch, axis) + 2 * patch.dropped))
    value[np.arange(len(place_mm))[:, None], first[:, None] + np.arange(4)] = table[:, 0]
    kept = value[:, patch.dropped : -patch.dropped]
    return np.asarray(kept.T @ (np.tile(0.5 * step_mm * weight, elements)[:, None] * kept))
