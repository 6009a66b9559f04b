"""Nodal forces and element tangents of the sheet: a mixed element whose pressure is condensed.

The change of volume J - 1 of each element is projected on the linear functions of its own coordinates
(1, xi, eta, zeta), which are made orthonormal under the quadrature: j_a = sum_q w phi_a (J - 1). The
volumetric energy k/2 sum_a j_a^2 then is the exact condensation of a three-field element with linear
discontinuous pressure p = k sum_a j_a phi_a, so the tangent is symmetric and consistent, and nothing
locks near incompressibility (J. C. Simo, R. L. Taylor and K. S. Pister 1985,
doi:10.1016/0045-7825(85)90033-7). The rest is integrated at Irons' 14 points, exact to degree 5
(B. M. Irons 1971, doi:10.1002/nme.1620030213). Formulae: docs/derivations/fem.md.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import HexMesh, shape_functions
from manytouch.values.arrays import read_only

GRAVITY_M_S2 = 9.80665


class ElementArrays(NamedTuple):
    """A mesh and its material, as the kernels read them; see `ElasticBody` for the shapes.

    Attributes:
        node: (e, 20) nodes of each element.
        gradient_per_mm: (e, q, 20, 3) of the shape functions over stress-free coordinates.
        point_volume_mm3: (e, q) stress-free volume of each quadrature point.
        pressure_mode: (e, q, 4) the orthonormal linear functions, 1 / mm^1.5.
        stretch: (3,) before clamping.
        shear_MPa, bulk_MPa: of the material.
        stiffening: (2,) see `NeoHooke.stiffening`.
    """

    node: np.ndarray
    gradient_per_mm: np.ndarray
    point_volume_mm3: np.ndarray
    pressure_mode: np.ndarray
    stretch: np.ndarray
    shear_MPa: float
    bulk_MPa: float
    stiffening: np.ndarray


def irons_rule() -> tuple[Float64[np.ndarray, "14 3"], Float64[np.ndarray, "14"]]:
    """Irons' 14 quadrature points (14, 3) and their weights (14,) on the unit cube."""
    corner = math.sqrt(19.0 / 33.0) * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    face = math.sqrt(19.0 / 30.0) * np.vstack([np.eye(3), -np.eye(3)])
    weight = np.repeat([121.0 / 361.0, 320.0 / 361.0], [8, 6]) / 8.0
    return 0.5 * (1.0 + np.vstack([corner, face])), weight


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ElasticBody:
    """A mesh of one material, prepared for the kernels.

    Attributes:
        mesh: the mesh.
        stretch: (3,) before clamping; see `NeoHooke.prestretch`.
        gradient_per_mm: (e, q, 20, 3) of the shape functions over stress-free coordinates.
        point_volume_mm3: (e, q) stress-free volume of each quadrature point.
        pressure_mode: (e, q, 4) the orthonormal linear functions, 1 / mm^1.5.
        shear_MPa, bulk_MPa: of the material.
        stiffening: (2,) see `NeoHooke.stiffening`.
        weight_N: (n,) of the material, shared out to the nodes consistently, so that corners can be negative.
    """

    mesh: HexMesh
    stretch: Float64[np.ndarray, "3"]
    gradient_per_mm: Float64[np.ndarray, "e q 20 3"]
    point_volume_mm3: Float64[np.ndarray, "e q"]
    pressure_mode: Float64[np.ndarray, "e q 4"]
    shear_MPa: float
    bulk_MPa: float
    stiffening: Float64[np.ndarray, "2"]
    weight_N: Float64[np.ndarray, " nodes"]

    def forces(
        self, displacement_mm: Float64[np.ndarray, "nodes 3"]
    ) -> tuple[float, Float64[np.ndarray, "nodes 3"], float]:
        """Strain energy (N mm), internal nodal forces (n, 3) in N, and the smallest J.

        J is the volume over that without stress. Where the smallest is not positive the forces are not valid.
        """
        tangent = np.empty((0, 60, 60))
        force_N = np.zeros_like(displacement_mm)
        energy, smallest = self._sum(displacement_mm, force_N, tangent)
        return energy, force_N, smallest

    def forces_and_tangent(
        self, displacement_mm: Float64[np.ndarray, "nodes 3"]
    ) -> tuple[Float64[np.ndarray, "nodes 3"], Float64[np.ndarray, "e 60 60"]]:
        """Internal nodal forces, N, and the derivatives (e, 60, 60) of those of each element, N/mm.

        These are by the displacements of its nodes, and only valid where the smallest J is positive.
        """
        tangent = np.empty((len(self.mesh.element), 60, 60))
        force_N = np.zeros_like(displacement_mm)
        self._sum(displacement_mm, force_N, tangent)
        return force_N, tangent

    def _sum(
        self, displacement_mm: np.ndarray, force_N: np.ndarray, tangent: np.ndarray
    ) -> tuple[float, float]:
        elements = ElementArrays(
            node=self.mesh.element,
            gradient_per_mm=self.gradient_per_mm,
            point_volume_mm3=self.point_volume_mm3,
            pressure_mode=self.pressure_mode,
            stretch=self.stretch,
            shear_MPa=self.shear_MPa,
            bulk_MPa=self.bulk_MPa,
            stiffening=self.stiffening,
        )
        # a copy is writable, so the kernel is compiled for one type only
        energy, smallest = sum_elements(displacement_mm.copy(), elements, force_N, tangent)
        return float(energy), float(smallest)


def elastic_body(mesh: HexMesh, material: NeoHooke, *, pretension_N_per_mm: float = 0.0) -> ElasticBody:
    """Prepare a mesh for a material and a pretension in N/mm.

    Raises:
        ValueError: an element has no positive volume, or no stretch gives the pretension.
    """
    point, share = irons_rule()
    value, slope = shape_functions(point)
    place_mm = mesh.node_mm[mesh.element]  # (e, 20, 3)
    jacobian_mm = np.einsum("eni,qnj->eqij", place_mm, slope)  # (e, q, 3, 3) dX_i / dxi_j
    volume_mm3 = np.linalg.det(jacobian_mm) * share  # (e, q) of the mounted sheet, at each point
    if volume_mm3.min() <= 0.0:
        raise ValueError("the mesh has an element that is folded or turned inside out")
    gradient = np.einsum("qnj,eqji->eqni", slope, np.linalg.inv(jacobian_mm))
    stretch = material.prestretch(pretension_N_per_mm, mesh.thickness_mm)
    free_mm3 = volume_mm3 / float(np.prod(stretch))  # (e, q) before clamping
    linear = np.column_stack([np.ones(len(point)), 2.0 * point - 1.0])  # (q, 4)
    gram = np.einsum("eq,qa,qb->eab", free_mm3, linear, linear)
    mode = np.einsum("qb,eab->eqa", linear, np.linalg.inv(np.linalg.cholesky(gram)))
    weight_N = np.zeros(len(mesh.node_mm))
    share_N = material.density_kg_m3 * 1e-9 * GRAVITY_M_S2 * (volume_mm3 @ value)  # (e, 20)
    np.add.at(weight_N, mesh.element, share_N)
    return ElasticBody(
        mesh=mesh,
        stretch=stretch,
        gradient_per_mm=read_only(np.ascontiguousarray(gradient * stretch)),
        point_volume_mm3=read_only(np.ascontiguousarray(free_mm3)),
        pressure_mode=read_only(np.ascontiguousarray(mode)),
        shear_MPa=material.shear_MPa,
        bulk_MPa=material.bulk_MPa,
        stiffening=read_only(np.array(material.stiffening)),
        weight_N=read_only(weight_N),
    )


class _Workspace(NamedTuple):
    """Values at the q quadrature points of one element, and the factors of its tangent.

    Attributes:
        F, cofactor: (q, 3, 3) deformation gradient and its matrix of cofactors, without unit.
        volume_ratio: (q,) J = det F, the volume over that without stress.
        volume_mode: (4,) change of volume J - 1, projected on the pressure modes, mm^1.5.
        left, right: (2 q + 4, 60) factors of the symmetric products, (3 q + 4, 60) of a stiffening material.
        turned, swapped: (q, 60) factors of the product whose components are exchanged.
        plain, scaled: (3 q, 20) factors of the product that is the same for all components.
    """

    F: np.ndarray
    cofactor: np.ndarray
    volume_ratio: np.ndarray
    volume_mode: np.ndarray
    left: np.ndarray
    right: np.ndarray
    turned: np.ndarray
    swapped: np.ndarray
    plain: np.ndarray
    scaled: np.ndarray


@kernel(forceinline=True)
@no_type_check
def _cofactor(F: np.ndarray, out: np.ndarray) -> float:
    """det F; `out` gets its derivative, the matrix of cofactors."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for column in range(3):
            p, q = (column + 1) % 3, (column + 2) % 3
            out[i, column] = F[j, p] * F[k, q] - F[j, q] * F[k, p]
    return float(F[0, 0] * out[0, 0] + F[0, 1] * out[0, 1] + F[0, 2] * out[0, 2])


@kernel(forceinline=True)
@no_type_check
def _deform(e: int, displacement: np.ndarray, elements: ElementArrays, work: _Workspace) -> float:
    """Fill F, its cofactors, J and the modes of J - 1 of one element; its smallest J."""
    smallest = np.inf
    work.volume_mode[:] = 0.0
    for q in range(work.volume_ratio.shape[0]):
        for i in range(3):
            for j in range(3):
                total = elements.stretch[i] if i == j else 0.0
                for a in range(20):
                    total += displacement[elements.node[e, a], i] * elements.gradient_per_mm[e, q, a, j]
                work.F[q, i, j] = total
        work.volume_ratio[q] = _cofactor(work.F[q], work.cofactor[q])
        smallest = min(smallest, work.volume_ratio[q])
        for m in range(4):
            change = work.volume_ratio[q] - 1.0
            work.volume_mode[m] += elements.point_volume_mm3[e, q] * elements.pressure_mode[e, q, m] * change
    return smallest


@kernel(forceinline=True)
@no_type_check
def _add_point(
    e: int, q: int, elements: ElementArrays, work: _Workspace, force: np.ndarray, has_tangent: bool
) -> float:
    """Add the nodal forces of one point, fill its factors of the tangent; its isochoric energy."""
    points = work.volume_ratio.shape[0]
    w, J = elements.point_volume_mm3[e, q], work.volume_ratio[q]
    pressure = 0.0
    for m in range(4):
        pressure += elements.bulk_MPa * work.volume_mode[m] * elements.pressure_mode[e, q, m]
    invariant = 0.0
    for i in range(3):
        for j in range(3):
            invariant += work.F[q, i, j] ** 2
    second, third = elements.stiffening[0], elements.stiffening[1]
    isochoric = J ** (-2.0 / 3.0)
    excess = isochoric * invariant - 3.0
    modulus = elements.shear_MPa * isochoric * (1.0 + excess * (2.0 * second + 3.0 * third * excess))
    rise = 2.0 * elements.shear_MPa * isochoric**2 * (2.0 * second + 6.0 * third * excess)
    for a in range(20):
        for i in range(3):
            h, s = 0.0, 0.0  # F^-T grad N and F grad N
            for j in range(3):
                h += work.cofactor[q, i, j] * elements.gradient_per_mm[e, q, a, j] / J
                s += work.F[q, i, j] * elements.gradient_per_mm[e, q, a, j]
            row = 3 * a + i
            node = elements.node[e, a]
            force[node, i] += w * (modulus * (s - invariant / 3.0 * h) + pressure * J * h)
            if has_tangent:
                work.left[q, row] = w * (
                    (2.0 / 9.0 * modulus * invariant + pressure * J) * h - 2.0 / 3.0 * modulus * s
                )
                work.right[q, row] = h
                work.left[points + q, row] = -2.0 / 3.0 * w * modulus * h
                work.right[points + q, row] = s
                work.turned[q, row] = w * (modulus * invariant / 3.0 - pressure * J) * h
                work.swapped[q, row] = h
                work.plain[3 * q + i, a] = elements.gradient_per_mm[e, q, a, i]
                work.scaled[3 * q + i, a] = w * modulus * elements.gradient_per_mm[e, q, a, i]
                for m in range(4):
                    work.right[2 * points + m, row] += w * elements.pressure_mode[e, q, m] * J * h
                if work.left.shape[0] > 2 * points + 4:
                    change = s - invariant / 3.0 * h
                    work.left[2 * points + 4 + q, row] = w * rise * change
                    work.right[2 * points + 4 + q, row] = change
    return float(0.5 * w * elements.shear_MPa * excess * (1.0 + excess * (second + third * excess)))


@kernel()
@no_type_check
def _multiply_factors(work: _Workspace, bulk_MPa: float, tangent: np.ndarray) -> None:
    """Fill the tangent (60, 60) of one element from its factors."""
    points = work.volume_ratio.shape[0]
    work.left[2 * points : 2 * points + 4] = bulk_MPa * work.right[2 * points : 2 * points + 4]
    tangent[:] = work.left.T @ work.right
    exchange = work.turned.T @ work.swapped
    stiffness = work.plain.T @ work.scaled
    for a in range(20):
        for b in range(20):
            for i in range(3):
                for k in range(3):
                    tangent[3 * a + i, 3 * b + k] += exchange[3 * a + k, 3 * b + i]
                tangent[3 * a + i, 3 * b + i] += stiffness[a, b]


@kernel()
@no_type_check
def sum_elements(
    displacement: np.ndarray, elements: ElementArrays, force: np.ndarray, tangent: np.ndarray
) -> tuple[float, float]:
    """Add every element's nodal forces to `force` (n, 3), in N.

    Args:
        displacement: (n, 3) of the nodes, mm.
        elements: mesh and material.
        force: (n, 3), added to.
        tangent: (e, 60, 60), filled, N/mm; or (0, 60, 60), then no tangent is computed.

    Returns:
        Strain energy in N mm and the smallest J; energy is infinite where that is not positive.
    """
    points = elements.point_volume_mm3.shape[1]
    is_stiffening = elements.stiffening[0] != 0.0 or elements.stiffening[1] != 0.0
    factors = (3 if is_stiffening else 2) * points + 4
    work = _Workspace(
        np.empty((points, 3, 3)),
        np.empty((points, 3, 3)),
        np.empty(points),
        np.empty(4),
        np.zeros((factors, 60)),
        np.zeros((factors, 60)),
        np.empty((points, 60)),
        np.empty((points, 60)),
        np.empty((3 * points, 20)),
        np.empty((3 * points, 20)),
    )
    has_tangent = tangent.shape[0] > 0
    energy, smallest = 0.0, np.inf
    for e in range(elements.node.shape[0]):
        smallest = min(smallest, _deform(e, displacement, elements, work))
        if smallest <= 0.0:
            return np.inf, smallest
        for m in range(4):
            energy += 0.5 * elements.bulk_MPa * work.volume_mode[m] * work.volume_mode[m]
        work.right[2 * points :] = 0.0
        for q in range(points):
            energy += _add_point(e, q, elements, work, force, has_tangent)
        if has_tangent:
            _multiply_factors(work, elements.bulk_MPa, tangent[e])
    return energy, smallest
