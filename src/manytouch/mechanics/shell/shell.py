"""The sheet as a shell on a spline patch: its energy, internal forces and tangent, divided by E."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Float64
from scipy.sparse import coo_array, csr_array

from manytouch.geometry.spline.patch import Nodal, SplinePatch
from manytouch.mechanics.shell import kernels as shell_kernels
from manytouch.mechanics.shell import tangent_assembly, tangent_kernels
from manytouch.mechanics.shell.clamped_end import clamped_end, end_stiffness
from manytouch.mechanics.shell.force_products import ForceProducts
from manytouch.mechanics.shell.stretched import StretchedModuli, stretched_moduli
from manytouch.values.arrays import read_only, read_only_view

SUPPORT_PER_MM = 1e-3
"""Stiffness of the springs along a soft boundary, over E and area: a displacement of 1 mm gives 0.001 E."""

SHEAR_FACTOR = 1.0 / 5.0
"""a / t^2 of the camera-side face of a slab of thickness t under a load on its other face; see `Shell`."""

FIBRE_FACTOR = 1.0 / 6.0
"""Fibres are normal to b - FIBRE_FACTOR a lap b, b being the bending deflection; of the same slab."""

GAUSS_POINTS = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Shell:
    """A sheet with finite membrane strain (neo-Hooke, plane stress) and bending with shear.

    Vectors are in the sheet frame, whose z points away from the camera; a press has w < 0 and forces f_z < 0.
    All energies and forces are divided by E: mm^3 and mm^2.

    The deflection w is that of the camera-side face. The third component of the coefficients is the bending
    deflection b, with w = b - a lap b and a = t^2 / 5: for waves of wave number k, the stiffness of the face
    is D k^4 / (1 + a k^2) + N k^2, that of an exact slab to 1 % up to k t = 1 for any Poisson's ratio.
    Derivation: docs/derivations/mechanics.md.

    Attributes:
        patch: the rectangle that is modelled; its `shear_mm2` and `clamped_end` are replaced by those of this
            sheet.
        thickness_mm: of the sheet, mounted.
        poisson: 0 to less than 0.5.
        pretension_over_E_mm: membrane force per length at rest, over E.
        bending_factor: on t^3 / (12 (1 - poisson^2)); 1 is a thin plate of this thickness.
        shear_factor: a over t^2; 0 is a thin plate. Of any other than the slab's the outline is clamped
            without slope.
        support_per_mm: of the springs that hold a soft boundary, per E and area; has no effect on a
            clamped patch.
    """

    patch: SplinePatch
    thickness_mm: float
    poisson: float = 0.45
    pretension_over_E_mm: float = 0.0
    bending_factor: float = 1.0
    shear_factor: float = SHEAR_FACTOR
    support_per_mm: float = SUPPORT_PER_MM

    def __post_init__(self) -> None:
        if not 0.0 <= self.poisson < 0.5:
            raise ValueError(f"Poisson's ratio must be at least 0 and below 0.5, not {self.poisson}")
        if not self.thickness_mm > 0.0:
            raise ValueError(f"the thickness of a sheet must be positive, not {self.thickness_mm} mm")
        shear_mm2 = self.shear_factor * self.thickness_mm**2
        is_slab = self.shear_factor == SHEAR_FACTOR
        end = clamped_end(self.thickness_mm, self.poisson) if is_slab else (0.0, 0.0, 0.0)
        if (self.patch.shear_mm2, self.patch.clamped_end) != (shear_mm2, end):
            object.__setattr__(self, "patch", replace(self.patch, shear_mm2=shear_mm2, clamped_end=end))

    @property
    def shear_mm2(self) -> float:
        """a in the deflection w = b - a lap b."""
        return self.patch.shear_mm2

    @property
    def tilt_mm2(self) -> float:
        """Fibres across the sheet are normal to b - tilt_mm2 lap b."""
        return FIBRE_FACTOR * self.shear_mm2

    @property
    def curvature_stretch_mm2(self) -> float:
        """Q: curvatures k of the strain stretch the sheet by Q k^2 / 2, on which membrane forces work.

        They work on the deflection of each layer of the slab, which is larger than that of its camera-side
        face, and on the curvature of its fibres (docs/derivations/mechanics.md, "Tension"). It is t^2 / 12
        times (1 + nu) / (1 - nu) for a slab, and 0 for a thin plate.
        """
        nu = self.poisson
        return self.shear_mm2 / (12.0 * SHEAR_FACTOR) * (1.0 + nu) / (1.0 - nu)

    @cached_property
    def stretched(self) -> StretchedModuli:
        """Moduli of the mounted sheet, which its pretension has changed."""
        return stretched_moduli(float(self.poisson), float(self.pretension_over_E_mm / self.thickness_mm))

    @property
    def rigidity_mm3(self) -> float:
        """Bending stiffness D over E."""
        moduli = self.stretched
        plate_mm3 = moduli.young * self.thickness_mm**3 / (12.0 * (1.0 - moduli.poisson**2))
        return self.bending_factor * plate_mm3

    def energy(self, coefficient_mm: Nodal) -> float:
        """Energy over E (mm^3), 0 at rest."""
        springs = 0.5 * float((self._spring_mm[:, None] * coefficient_mm**2).sum())
        elastic = float(shell_kernels.energy(read_only_view(coefficient_mm), self._elements, self._stiffness))
        b = coefficient_mm[:, 2]
        ends = 0.5 * float(b @ (self._end_stiffness @ b))
        return elastic + springs + ends - float((self._rest_force * coefficient_mm).sum())

    def forces(self, coefficient_mm: Nodal) -> Nodal:
        """External forces over E (mm^2) in equilibrium with this shape: dW/dc, 0 for fixed unknowns."""
        force = self._products.forces(coefficient_mm, self._stiffness)
        self._add_boundary_forces(coefficient_mm, force)
        force[~self.patch.is_free] = 0.0
        return force

    def forces_and_tangent(self, coefficient_mm: Nodal, force: Nodal, tangent: np.ndarray) -> None:
        """Nodal forces into `force`, and their derivative over E (mm) into `tangent` (nodes, 3, 3, 7, 8).

        tangent[p, i, j, a, b] = d force[p, i] / d coefficient[q, j], where node q lies a - 3 further
        along the slow and b - 3 further along the fast axis.
        """
        force[:] = self.forces(coefficient_mm)
        self.tangent_at(coefficient_mm, tangent)

    def tangent_at(self, coefficient_mm: Nodal, tangent: np.ndarray) -> None:
        """The tangent of `forces_and_tangent` alone."""
        tangent_assembly.assemble(read_only_view(coefficient_mm), self._elements, self._stiffness, tangent)
        middle = tangent_kernels.REACH
        for i in range(3):
            tangent[:, i, i, middle, middle] += self._spring_mm
        node, slow, fast, stiffness = self._end_stencil
        tangent[node, 2, 2, slow, fast] += stiffness
        tangent_kernels.fix(self.patch.is_free, self.patch.shape, tangent)

    def empty_tangent(self, precision: type[np.floating] = np.float64) -> Float[np.ndarray, "nodes 3 3 7 8"]:
        """Memory for a tangent, whose precision is that of all matrix operations on it."""
        return np.zeros((self.patch.node_count, 3, 3, tangent_kernels.ROW, tangent_kernels.STRIP), precision)

    def products(
        self, tangent: np.ndarray, nodal: Float64[np.ndarray, "k nodes 3"]
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """Tangent times k vectors."""
        result = np.empty_like(nodal)
        tangent_kernels.products(tangent, self.patch.shape, np.ascontiguousarray(nodal), result)
        return result

    def _add_boundary_forces(self, coefficient_mm: Nodal, force: Nodal) -> None:
        force += self._spring_mm[:, None] * coefficient_mm - self._rest_force
        force[:, 2] += self._end_stiffness @ coefficient_mm[:, 2]

    @cached_property
    def _end_stiffness(self) -> csr_array:
        return end_stiffness(self.patch, self.rigidity_mm3)

    @cached_property
    def _end_stencil(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Node, places along slow and fast of the other node, and entry, as in `forces_and_tangent`."""
        matrix, fast, middle = coo_array(self._end_stiffness), self.patch.shape[1], tangent_kernels.REACH
        row, column = matrix.row, matrix.col
        along_slow, along_fast = column // fast - row // fast, column % fast - row % fast
        return row, along_slow + middle, along_fast + middle, matrix.data

    @cached_property
    def _spring_mm(self) -> Float64[np.ndarray, " nodes"]:
        return np.where(self.patch.is_soft_edge, self.support_per_mm * self.patch.area_mm2, 0.0)

    @cached_property
    def _rest_force(self) -> Nodal:
        """Forces of the sheet beyond a free outline, which balance the pretension at rest."""
        at_rest_mm = np.zeros((self.patch.node_count, 3))
        return read_only(self._products.forces(at_rest_mm, self._stiffness))

    @cached_property
    def _products(self) -> ForceProducts:
        return ForceProducts.of(self._elements)

    @cached_property
    def _elements(self) -> shell_kernels.Elements:
        node, weight = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        patch = self.patch
        plane: list[np.ndarray] = []
        bending: list[np.ndarray] = []
        lengths = []
        for axis in patch.axes:
            length, elements = patch.size_mm[axis], patch.elements[axis]
            step = length / elements
            place = (np.arange(elements)[:, None] + 0.5 * (node + 1.0)) * step
            _, *tables = patch.functions(axis, place.ravel())
            for table, kind in zip(tables, (plane, bending), strict=True):
                kind.append(np.ascontiguousarray(table.reshape(elements, GAUSS_POINTS, 4, 4)))
            lengths.append(0.5 * step * weight)
        return shell_kernels.Elements(
            slow=plane[0],
            fast=plane[1],
            bending_slow=bending[0],
            bending_fast=bending[1],
            weight=np.outer(lengths[0], lengths[1]).ravel(),
            shape=patch.shape,
            dropped=patch.dropped,
            is_x_slow=patch.is_x_slow,
        )

    @cached_property
    def _stiffness(self) -> shell_kernels.Stiffness:
        t, young, nu = float(self.thickness_mm), self.stretched.young, self.stretched.poisson
        return shell_kernels.Stiffness(
            thickness=t,
            mu=0.5 * young / (1.0 + nu),
            bulk=young / (3.0 * (1.0 - 2.0 * nu)),
            tension=float(self.pretension_over_E_mm),
            lever=t * float(np.sqrt(self.bending_factor / 12.0)),
            stretch=self.curvature_stretch_mm2,
            shear=float(self.shear_mm2),
            shear_stiffness=self.rigidity_mm3 * float(self.shear_mm2),
        )
