"""Energy of the live sheet with the bodies that press it, and its derivatives, on a grid."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

import numpy as np
from jaxtyping import Float64
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.indenters import (
    ConvexBody,
    Fingertip,
    Indenter,
    LyingCylinder,
    Ring,
    RoundPunch,
    Sphere,
    SquarePunch,
    pack,
)
from manytouch.simulation.shell import body_kernels, kernels
from manytouch.simulation.shell.preconditioner import Preconditioner
from manytouch.values import Sheet
from manytouch.values.arrays import read_only

BED_STIFFNESS_RATIO = 1.5
"""Stiffness of the touched face per area, over young_MPa / thickness_mm."""
CONVEX_REACH_MM = 30.0
"""Reach of a convex body, whose corners are not stored; larger ones are cut off there."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PosedIndenter:
    """An indenter with its present pose.

    Attributes:
        indenter: its shape.
        position_mm: (3,) of its frame's origin, which is its lowest point, in the sheet frame.
        rotation_vector: (3,) of its frame (Rodrigues, rad), sheet_from_indenter.
    """

    indenter: Indenter
    position_mm: Float64[np.ndarray, "3"]
    rotation_vector: Float64[np.ndarray, "3"]


class ContactBodies:
    """Bodies as arrays of the kernels, and what they do to the sheet."""

    def __init__(self, bodies: Sequence[PosedIndenter], shell: "ShellEnergy") -> None:
        """Args: bodies; shell: that they press."""
        kind, numbers = pack(tuple(body.indenter for body in bodies))
        places = np.array([body.position_mm for body in bodies]).reshape(-1, 3)
        turns = [Rotation.from_rotvec(body.rotation_vector.copy()).as_matrix() for body in bodies]
        self.arrays = body_kernels.BodyArrays(
            kind=kind,
            numbers=numbers,
            position_mm=places - [0.0, 0.0, shell.half_mm],
            rotation=np.array(turns).reshape(-1, 3, 3),
            reach_mm=np.array([_reach_mm(body.indenter) for body in bodies], dtype=np.float64),
        )
        points = tuple(2 * (count - 1) for count in shell.shape)
        self.loads = body_kernels.BodyLoads(
            resultant=np.zeros((len(places), 7)),
            body_at=np.full(points, -1, dtype=np.int64),
            normal_N=np.zeros(points),
        )


class ShellEnergy:
    """The sheet on its grid, as a function of its unknowns: displacements and tilts (5, a, b)."""

    def __init__(self, sheet: Sheet, spacing_mm: float) -> None:
        """Args: sheet: its material must be known; spacing_mm: of the grid, about.

        Raises:
            ValueError: the sheet has no Young's modulus or Poisson's ratio.
        """
        if sheet.young_MPa is None or sheet.poisson is None:
            raise ValueError("the sheet has no young_MPa or no poisson: both are needed to simulate a press")
        cells = [2 * max(round(float(size) / spacing_mm / 2), 2) for size in sheet.size_mm]
        self.shape = (cells[0] + 1, cells[1] + 1)
        self.x_mm, self.y_mm = (
            read_only(np.linspace(-0.5, 0.5, count) * float(size))
            for count, size in zip(self.shape, sheet.size_mm, strict=True)
        )
        self.spacing_mm = np.array([line[1] - line[0] for line in (self.x_mm, self.y_mm)])
        self.sheet, self.half_mm = sheet, 0.5 * sheet.thickness_mm
        self.prestretch = prestretch(sheet)
        assert sheet.young_MPa is not None
        stiffness = BED_STIFFNESS_RATIO * sheet.young_MPa / sheet.thickness_mm
        self.bed = body_kernels.Bed(half_mm=self.half_mm, stiffness_MPa_per_mm=stiffness)
        self.law = shell_law(sheet, self.prestretch, float(np.prod(self.spacing_mm)))
        corners = np.full(self.shape, 8.0)
        corners[[0, -1]] *= 0.5
        corners[:, [0, -1]] *= 0.5
        self._corners = corners
        self.buffers = kernels.ElasticBuffers(
            fibre=np.empty((3, *self.shape)),
            by_fibre=np.empty((3, *self.shape)),
            tangent=np.zeros((2, 6, *self.shape)),
            force=np.zeros((2, 6, *self.shape)),
            determinant=corners.copy(),
        )

    def preconditioner(self) -> Preconditioner:
        """An approximate inverse of the stiffness of the sheet at rest."""
        sheet = self.sheet
        assert sheet.young_MPa is not None
        assert sheet.poisson is not None
        stretching = sheet.young_MPa * sheet.thickness_mm / (1.0 - sheet.poisson**2)
        return Preconditioner(
            nodes=(self.shape[0] - 2, self.shape[1] - 2),
            spacing_mm=(float(self.spacing_mm[0]), float(self.spacing_mm[1])),
            stretching=stretching,
            bending=stretching * sheet.thickness_mm**2 / 12.0,
            shear=self.law.shear_N_per_mm,
            poisson=sheet.poisson,
            tension=sheet.pretension_N_per_mm or 0.0,
        )

    def elastic(self, value: np.ndarray, stretch: np.ndarray) -> tuple[float, np.ndarray]:
        """Energy of the sheet alone in N mm, and its derivatives by displacement in out[:3] of (5, a, b)."""
        out = np.empty_like(value)
        return float(kernels.elastic(value, stretch, self.spacing_mm, self.law, self.buffers, out)), out

    def __call__(
        self, value: np.ndarray, stretch: np.ndarray, bodies: ContactBodies
    ) -> tuple[float, np.ndarray]:
        """Energy in N mm above that at rest, and its derivatives (5, a, b), which are 0 on the outline.

        Args:
            value: (5, a, b) displacement of the middle surface, tilt of the fibres.
            stretch: (a, b) thickness in shares of that at rest.
            bodies: that press; their loads are filled.
        """
        energy, out = self.elastic(value, stretch)
        arguments = (self.bed, bodies.arrays, self.buffers, out, bodies.loads)
        energy += body_kernels.contact_energy(value, self.spacing_mm, *arguments)
        kernels.finish_slope(value, stretch, out, self.buffers.by_fibre)
        return energy, out

    def fibres(self, value: np.ndarray, stretch: np.ndarray) -> np.ndarray:
        """(3, a, b) directors of the sheet, as long as it is thick for 1; valid until the next call."""
        kernels.fibres(value, stretch, self.buffers.fibre)
        return self.buffers.fibre

    def thickness_ratio(self) -> np.ndarray:
        """(a, b) thickness over that at rest, of the sheet as last evaluated: stretched, it is thinner."""
        return np.asarray((self.buffers.determinant / self._corners) ** (-0.5 * self.law.exponent))


def prestretch(sheet: Sheet) -> float:
    """Stretch of the sheet in its plane before it was clamped, which gives its pretension."""
    assert sheet.young_MPa is not None
    tension = sheet.pretension_N_per_mm or 0.0

    def excess(stretch: float) -> float:
        law = shell_law(sheet, stretch, 1.0)
        return (law.first_MPa - law.second_MPa) * sheet.thickness_mm - tension

    return float(brentq(excess, 1.0, 3.0)) if tension > 0.0 else 1.0


def shell_law(sheet: Sheet, stretch: float, cell_mm2: float) -> kernels.ShellLaw:
    """Material and thickness of a sheet that was stretched before it was clamped.

    W = mu/2 (tr C - 2 + (det C^-q - 1) / q), q = nu / (1 - nu), per stress-free volume, C being that of the
    mounted sheet times stretch^2, whose volume is stretch^(2 - 2 q) times the stress-free one. The shear
    stiffness is such that waves of the sheet have the stiffness D k^4 / (1 + t^2 k^2 / 5), that of the
    camera-side face of an exact slab; the usual factor 5/6 is right for q = 0 only.
    """
    assert sheet.young_MPa is not None
    assert sheet.poisson is not None
    mu = sheet.young_MPa / (2.0 * (1.0 + sheet.poisson))
    q = sheet.poisson / (1.0 - sheet.poisson)
    scale = mu / stretch ** (2.0 - 2.0 * q)
    lever_mm = sheet.thickness_mm / math.sqrt(12.0)
    shear = 5.0 / (6.0 * (1.0 - sheet.poisson)) * mu * sheet.thickness_mm
    first, second = scale * stretch**2, scale * stretch ** (-4.0 * q)
    return kernels.ShellLaw(
        first_MPa=first,
        second_MPa=second,
        exponent=q,
        lever_mm=lever_mm,
        shear_N_per_mm=shear,
        cell_mm2=cell_mm2,
        half_mm=0.5 * sheet.thickness_mm,
    )


def _reach_mm(indenter: Indenter) -> float:
    """Largest distance from the lowest point of an indenter to a point of it that can touch the sheet.

    It is then pressed in by half of its height at most: a ball up to its equator. `CONVEX_REACH_MM` of a
    convex body.
    """
    match indenter:
        case Sphere(radius_mm=radius_mm) | RoundPunch(radius_mm=radius_mm):
            return 1.5 * radius_mm
        case Fingertip(semi_axes_mm=semi_axes_mm):
            return 1.5 * max(semi_axes_mm)
        case SquarePunch(side_mm=side_mm):
            return math.hypot(*side_mm)
        case LyingCylinder(radius_mm=radius_mm, length_mm=length_mm):
            return 1.5 * math.hypot(radius_mm, 0.5 * length_mm)
        case Ring(radius_mm=radius_mm, wire_radius_mm=wire_radius_mm):
            return 1.5 * (radius_mm + wire_radius_mm)
        case ConvexBody():
            return CONVEX_REACH_MM
    assert_never(indenter)
