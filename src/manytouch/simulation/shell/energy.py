"""Energy of the live sheet with the bodies that press it, and its derivatives, on a grid."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.indenters import (
    Fingertip,
    Indenter,
    LyingCylinder,
    RoundPunch,
    Sphere,
    SquarePunch,
    pack,
)
from manytouch.simulation.shell import kernels
from manytouch.simulation.shell.preconditioner import Preconditioner
from manytouch.values import Sheet
from manytouch.values.arrays import read_only

SHEAR_SHARE = 5.0 / 6.0
BED = 1.7  # stiffness of the touched face, in young_MPa / thickness_mm


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PosedIndenter:
    """A rigid body where it is now.

    Attributes:
        indenter: its shape.
        position_mm: (3,) of its frame's origin, which is its lowest point, in the sheet frame.
        rotation_vector: (3,) of its frame (Rodrigues, rad), sheet_from_indenter.
    """

    indenter: Indenter
    position_mm: Float64[np.ndarray, "3"]
    rotation_vector: Float64[np.ndarray, "3"]


class ContactBodies:
    """ContactBodies as the kernels want them, and what they do to the sheet (see `kernels.touch`)."""

    def __init__(self, bodies: Sequence[PosedIndenter], thickness_mm: float) -> None:
        """Args: bodies; thickness_mm: of the sheet at rest."""
        self.kind, self.numbers = pack(tuple(body.indenter for body in bodies))
        places = np.array([body.position_mm for body in bodies]).reshape(-1, 3)
        self.position_mm = places - [0.0, 0.0, 0.5 * thickness_mm]
        turns = [Rotation.from_rotvec(body.rotation_vector.copy()).as_matrix() for body in bodies]
        self.rotation = np.array(turns).reshape(-1, 3, 3)
        self.reach_mm = np.array([_reach_mm(body.indenter) for body in bodies])
        self.told = np.zeros((len(places), 7))


class ShellEnergy:
    """The sheet on its grid, as a function of its unknowns: displacements and tilts (5, a, b)."""

    def __init__(self, sheet: Sheet, spacing_mm: float) -> None:
        """Args: sheet: its material must be known; spacing_mm: of the grid, about.

        Raises:
            ValueError: the sheet has no Young's modulus or Poisson's ratio.
        """
        if sheet.young_MPa is None or sheet.poisson is None:
            raise ValueError("a sheet that shall be pressed needs young_MPa and poisson")
        cells = [2 * max(round(float(size) / spacing_mm / 2), 2) for size in sheet.size_mm]
        self.shape = (cells[0] + 1, cells[1] + 1)
        self.x_mm, self.y_mm = (
            read_only(np.linspace(-0.5, 0.5, count) * float(size))
            for count, size in zip(self.shape, sheet.size_mm, strict=True)
        )
        self.spacing_mm = np.array([line[1] - line[0] for line in (self.x_mm, self.y_mm)])
        self.sheet, self.half_mm = sheet, 0.5 * sheet.thickness_mm
        self.prestretch = prestretch(sheet)
        self._bed = BED * sheet.young_MPa / sheet.thickness_mm
        self._law = _law(sheet, self.prestretch, float(np.prod(self.spacing_mm)))
        self._q = sheet.poisson / (1.0 - sheet.poisson)
        corners = np.full(self.shape, 8.0)
        corners[[0, -1]] *= 0.5
        corners[:, [0, -1]] *= 0.5
        self._corners = corners
        self.fibre, self._on_fibre = np.empty((3, *self.shape)), np.empty((3, *self.shape))
        self._tangents, self._forces = np.zeros((2, 6, *self.shape)), np.zeros((2, 6, *self.shape))
        self._square = corners.copy()
        self.covered = np.empty((2 * cells[0], 2 * cells[1]), dtype=np.int64)

    def softness(self) -> Preconditioner:
        """How the sheet at rest gives way."""
        sheet = self.sheet
        assert sheet.young_MPa is not None
        assert sheet.poisson is not None
        stretching = sheet.young_MPa * sheet.thickness_mm / (1.0 - sheet.poisson**2)
        return Preconditioner(
            nodes=(self.shape[0] - 2, self.shape[1] - 2),
            spacing_mm=(float(self.spacing_mm[0]), float(self.spacing_mm[1])),
            stretching=stretching,
            bending=stretching * sheet.thickness_mm**2 / 12.0,
            shear=float(self._law[4]),
            poisson=sheet.poisson,
            tension=sheet.pretension_N_per_mm or 0.0,
        )

    def elastic(self, value: np.ndarray, stretch: np.ndarray) -> tuple[float, np.ndarray]:
        """Of the sheet alone: energy, and its derivatives by displacement in the first 3 of (5, a, b)."""
        out = np.empty_like(value)
        energy = kernels.elastic(
            value,
            stretch,
            self.fibre,
            self.spacing_mm,
            self._law,
            self._tangents,
            self._forces,
            self._square,
            out,
            self._on_fibre,
        )
        return float(energy), out

    def __call__(
        self, value: np.ndarray, stretch: np.ndarray, bodies: ContactBodies
    ) -> tuple[float, np.ndarray]:
        """Energy in N mm above that at rest, and its derivatives (5, a, b), which are 0 on the outline.

        Args:
            value: (5, a, b) displacement of the middle surface, tilt of the fibres.
            stretch: (a, b) thickness in shares of that at rest.
            bodies: that press; what they do to the sheet is written into them.
        """
        energy, out = self.elastic(value, stretch)
        energy += kernels.touch(
            value,
            self.fibre,
            self.spacing_mm,
            self.half_mm,
            self._bed,
            bodies.kind,
            bodies.numbers,
            bodies.position_mm,
            bodies.rotation,
            bodies.reach_mm,
            out,
            self._on_fibre,
            self.covered,
            bodies.told,
        )
        kernels.close(value, stretch, out, self._on_fibre)
        return energy, out

    def thinned(self) -> np.ndarray:
        """(a, b) thickness of the sheet as last looked at: what is stretched becomes thinner."""
        return np.asarray((self._square / self._corners) ** (-0.5 * self._q))


def prestretch(sheet: Sheet) -> float:
    """How far the sheet was stretched in its plane before it was clamped, so that it pulls as it shall."""
    assert sheet.young_MPa is not None
    tension = sheet.pretension_N_per_mm or 0.0

    def excess(stretch: float) -> float:
        first, second = _law(sheet, stretch, 1.0)[:2]
        return float(first - second) * sheet.thickness_mm - tension

    return float(brentq(excess, 1.0, 3.0)) if tension > 0.0 else 1.0


def _law(sheet: Sheet, stretch: float, area_mm2: float) -> np.ndarray:
    """The kernels' numbers.

    W = mu/2 (tr C - 2 + (det C^-q - 1) / q), q = nu / (1 - nu), per stress-free volume, C being that of the
    mounted sheet times stretch^2, whose volume is stretch^(2 - 2 q) times the stress-free one.
    """
    assert sheet.young_MPa is not None
    assert sheet.poisson is not None
    mu = sheet.young_MPa / (2.0 * (1.0 + sheet.poisson))
    q = sheet.poisson / (1.0 - sheet.poisson)
    scale = mu / stretch ** (2.0 - 2.0 * q)
    lever_mm = sheet.thickness_mm / math.sqrt(12.0)
    shear = SHEAR_SHARE * mu * sheet.thickness_mm
    first, second = scale * stretch**2, scale * stretch ** (-4.0 * q)
    return np.array([first, second, q, lever_mm, shear, area_mm2, 0.5 * sheet.thickness_mm])


def _reach_mm(indenter: Indenter) -> float:
    """From a body's lowest point to the furthest that it can touch when it is pressed in to its middle."""
    match indenter:
        case Sphere(radius_mm=radius_mm) | RoundPunch(radius_mm=radius_mm):
            return 1.5 * radius_mm
        case Fingertip(semi_axes_mm=semi_axes_mm):
            return 1.5 * max(semi_axes_mm)
        case SquarePunch(side_mm=side_mm):
            return math.hypot(*side_mm)
        case LyingCylinder(radius_mm=radius_mm, length_mm=length_mm):
            return 1.5 * math.hypot(radius_mm, 0.5 * length_mm)
    return 30.0
