"""Nodal forces and element tangents of the sheet: a mixed element whose pressure is condensed.

The change of volume J - 1 of each element is projected on the linear functions of its own coordinates
(1, xi, eta, zeta), which are made orthonormal under the quadrature: j_a = sum_q w phi_a (J - 1). The
volumetric energy k/2 sum_a j_a^2 then is the exact condensation of a three-field element with linear
discontinuous pressure p = k sum_a j_a phi_a, so the tangent is symmetric and consistent, and nothing
locks near incompressibility (J. C. Simo, R. L. Taylor and K. S. Pister 1985,
doi:10.1016/0045-7825(85)90033-7). The rest is integrated at Irons' 14 points, exact to degree 5
(B. M. Irons 1971, doi:10.1002/nme.1620030213). Formulae: docs/derivations/fem.md.
"""

# ruff: noqa: PLR0912, PLR0917 - compiled functions are long and called with positional arguments

import itertools
import math
from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from jaxtyping import Float64
from numba import njit

from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import HexMesh, shape_functions
from manytouch.values.arrays import read_only


def irons_rule() -> tuple[Float64[np.ndarray, "14 3"], Float64[np.ndarray, "14"]]:
    """Points and weights on the unit cube."""
    corner = math.sqrt(19.0 / 33.0) * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    face = math.sqrt(19.0 / 30.0) * np.vstack([np.eye(3), -np.eye(3)])
    weight = np.repeat([121.0 / 361.0, 320.0 / 361.0], [8, 6]) / 8.0
    return 0.5 * (1.0 + np.vstack([corner, face])), weight


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ElasticBody:
    """What the kernels need of a mesh and its material.

    Attributes:
        mesh: the mesh.
        stretch: (3,) before clamping; see `NeoHooke.prestretch`.
        gradient_per_mm: (e, q, 20, 3) of the shape functions over stress-free coordinates.
        weight_mm3: (e, q) stress-free volume of each quadrature point.
        pressure_mode: (e, q, 4) the orthonormal linear functions, 1 / mm^1.5.
        shear_MPa, bulk_MPa: of the material.
        weight_N: (n,) of the material, shared out to the nodes (consistent, so corners can be negative).
    """

    mesh: HexMesh
    stretch: Float64[np.ndarray, "3"]
    gradient_per_mm: Float64[np.ndarray, "e q 20 3"]
    weight_mm3: Float64[np.ndarray, "e q"]
    pressure_mode: Float64[np.ndarray, "e q 4"]
    shear_MPa: float
    bulk_MPa: float
    weight_N: Float64[np.ndarray, " nodes"]

    def forces(
        self, displacement_mm: Float64[np.ndarray, "nodes 3"]
    ) -> tuple[float, Float64[np.ndarray, "nodes 3"], float]:
        """Strain energy (N mm), internal nodal forces (n, 3) in N, and the smallest J.

        Where the smallest J is not positive the forces mean nothing.
        """
        tangent = np.empty((0, 60, 60))
        force_N = np.zeros_like(displacement_mm)
        energy, smallest = self._run(displacement_mm, force_N, tangent)
        return energy, force_N, smallest

    def forces_and_tangent(
        self, displacement_mm: Float64[np.ndarray, "nodes 3"]
    ) -> tuple[Float64[np.ndarray, "nodes 3"], Float64[np.ndarray, "e 60 60"]]:
        """Internal nodal forces and their derivative by each element's nodes, N/mm, freshly allocated."""
        tangent = np.empty((len(self.mesh.element), 60, 60))
        force_N = np.zeros_like(displacement_mm)
        self._run(displacement_mm, force_N, tangent)
        return force_N, tangent

    def _run(
        self, displacement_mm: np.ndarray, force_N: np.ndarray, tangent: np.ndarray
    ) -> tuple[float, float]:
        energy, smallest = _sum_elements(
            displacement_mm.copy(),  # writable, always: the kernel is compiled once
            self.mesh.element,
            self.gradient_per_mm,
            self.weight_mm3,
            self.pressure_mode,
            self.stretch,
            self.shear_MPa,
            self.bulk_MPa,
            force_N,
            tangent,
        )
        return float(energy), float(smallest)


GRAVITY_M_S2 = 9.80665


def elastic_body(mesh: HexMesh, material: NeoHooke, *, pretension_N_per_mm: float = 0.0) -> ElasticBody:
    """Prepare a mesh for a material and a pretension."""
    point, share = irons_rule()
    value, slope = shape_functions(point)
    place_mm = mesh.node_mm[mesh.element]  # (e, 20, 3)
    jacobian = np.einsum("eni,qnj->eqij", place_mm, slope)  # dX_i / dxi_j
    volume = np.linalg.det(jacobian) * share
    if volume.min() <= 0.0:
        raise ValueError("the mesh has an element that is folded or turned inside out")
    gradient = np.einsum("qnj,eqji->eqni", slope, np.linalg.inv(jacobian))
    stretch = material.prestretch(pretension_N_per_mm, mesh.thickness_mm)
    free = volume / float(np.prod(stretch))
    linear = np.column_stack([np.ones(len(point)), 2.0 * point - 1.0])  # (q, 4)
    gram = np.einsum("eq,qa,qb->eab", free, linear, linear)
    mode = np.einsum("qb,eab->eqa", linear, np.linalg.inv(np.linalg.cholesky(gram)))
    nodal = np.zeros(len(mesh.node_mm))
    mass_N = material.density_kg_m3 * 1e-9 * GRAVITY_M_S2 * (volume @ value)  # (e, 20)
    np.add.at(nodal, mesh.element, mass_N)
    return ElasticBody(
        mesh=mesh,
        stretch=stretch,
        gradient_per_mm=read_only(np.ascontiguousarray(gradient * stretch)),
        weight_mm3=read_only(np.ascontiguousarray(free)),
        pressure_mode=read_only(np.ascontiguousarray(mode)),
        shear_MPa=material.shear_MPa,
        bulk_MPa=material.bulk_MPa,
        weight_N=read_only(nodal),
    )


@njit(cache=True)
@no_type_check
def _cofactor(F: np.ndarray, out: np.ndarray) -> float:
    """det F; `out` gets its derivative, the matrix of cofactors."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for column in range(3):
            p, q = (column + 1) % 3, (column + 2) % 3
            out[i, column] = F[j, p] * F[k, q] - F[j, q] * F[k, p]
    return float(F[0, 0] * out[0, 0] + F[0, 1] * out[0, 1] + F[0, 2] * out[0, 2])


@njit(cache=True)
@no_type_check
def _sum_elements(
    displacement: np.ndarray,
    element: np.ndarray,
    gradient: np.ndarray,
    weight: np.ndarray,
    mode: np.ndarray,
    stretch: np.ndarray,
    shear: float,
    bulk: float,
    force: np.ndarray,
    tangent: np.ndarray,
) -> tuple[float, float]:
    """Add every element's forces; fill its tangent where `tangent` has room for it."""
    points = gradient.shape[1]
    wants_tangent = tangent.shape[0] > 0
    F, cofactor, jacobian = np.empty((points, 3, 3)), np.empty((points, 3, 3)), np.empty(points)
    left, right = np.zeros((2 * points + 4, 60)), np.zeros((2 * points + 4, 60))
    swapped, turned = np.empty((points, 60)), np.empty((points, 60))
    plain, scaled = np.empty((3 * points, 20)), np.empty((3 * points, 20))
    energy, smallest = 0.0, np.inf
    for e in range(element.shape[0]):
        volume = np.zeros(4)
        for q in range(points):
            for i in range(3):
                for j in range(3):
                    total = stretch[i] if i == j else 0.0
                    for a in range(20):
                        total += displacement[element[e, a], i] * gradient[e, q, a, j]
                    F[q, i, j] = total
            jacobian[q] = _cofactor(F[q], cofactor[q])
            smallest = min(smallest, jacobian[q])
            for m in range(4):
                volume[m] += weight[e, q] * mode[e, q, m] * (jacobian[q] - 1.0)
        if smallest <= 0.0:
            return np.inf, smallest
        for m in range(4):
            energy += 0.5 * bulk * volume[m] * volume[m]
        right[2 * points :] = 0.0
        for q in range(points):
            w, J = weight[e, q], jacobian[q]
            pressure = 0.0
            for m in range(4):
                pressure += bulk * volume[m] * mode[e, q, m]
            invariant = 0.0
            for i in range(3):
                for j in range(3):
                    invariant += F[q, i, j] ** 2
            modulus = shear * J ** (-2.0 / 3.0)
            energy += 0.5 * w * (modulus * invariant - 3.0 * shear)
            for a in range(20):
                for i in range(3):
                    h, s = 0.0, 0.0  # F^-T grad N and F grad N
                    for j in range(3):
                        h += cofactor[q, i, j] * gradient[e, q, a, j] / J
                        s += F[q, i, j] * gradient[e, q, a, j]
                    row = 3 * a + i
                    force[element[e, a], i] += w * (modulus * (s - invariant / 3.0 * h) + pressure * J * h)
                    if wants_tangent:
                        left[q, row] = w * (
                            (2.0 / 9.0 * modulus * invariant + pressure * J) * h - 2.0 / 3.0 * modulus * s
                        )
                        right[q, row] = h
                        left[points + q, row] = -2.0 / 3.0 * w * modulus * h
                        right[points + q, row] = s
                        turned[q, row] = w * (modulus * invariant / 3.0 - pressure * J) * h
                        swapped[q, row] = h
                        plain[3 * q + i, a] = gradient[e, q, a, i]
                        scaled[3 * q + i, a] = w * modulus * gradient[e, q, a, i]
                        for m in range(4):
                            right[2 * points + m, row] += w * mode[e, q, m] * J * h
        if wants_tangent:
            left[2 * points :] = bulk * right[2 * points :]
            tangent[e] = left.T @ right
            exchange = turned.T @ swapped
            stiffness = plain.T @ scaled
            for a in range(20):
                for b in range(20):
                    for i in range(3):
                        for k in range(3):
                            tangent[e, 3 * a + i, 3 * b + k] += exchange[3 * a + k, 3 * b + i]
                        tangent[e, 3 * a + i, 3 * b + i] += stiffness[a, b]
    return energy, smallest
