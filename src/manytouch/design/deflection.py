"""Depth of a clamped sheet under a fingertip, by the shell of `mechanics`.

The shape depends only on force over Young's modulus, so one curve per thickness serves every material.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.design.spacing import gap_mm
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import Shell

FINGERTIP_MM2 = 100.0  # 1 cm², as in Table 1 of the paper
ELEMENT_MM = 5.0
FIRST_FORCE_OVER_E_MM2 = 1e-3
GROWTH = 2.0
LAST_FORCE_OVER_E_MM2 = 1e3
POSITIONS_PER_PITCH = 10


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DeflectionCurve:
    """Depth in the middle of a clamped sheet under the increasing force of a fingertip.

    Attributes:
        size_mm, thickness_mm, poisson: of the sheet.
        force_over_E_mm2: (k,) increasing.
        depth_mm: (k,) peak depth.
        strain: (k,) largest Green strain of the face, membrane and bending.
        coefficient_mm: (k, n, 3) spline coefficients of the shell.
        shell: model of the sheet.
    """

    size_mm: tuple[float, float]
    thickness_mm: float
    poisson: float
    force_over_E_mm2: Float64[np.ndarray, " k"]
    depth_mm: Float64[np.ndarray, " k"]
    strain: Float64[np.ndarray, " k"]
    coefficient_mm: Float64[np.ndarray, "k n 3"]
    shell: Shell

    def depth_at(self, force_over_E_mm2: float) -> float:
        """Depth under a force; linear interpolation of the logarithms."""
        return _interpolate(force_over_E_mm2, self.force_over_E_mm2, self.depth_mm)

    def force_over_E_at(self, depth_mm: float) -> float:
        """Force over Young's modulus that gives a depth."""
        return _interpolate(depth_mm, self.depth_mm, self.force_over_E_mm2)

    def strain_at(self, depth_mm: float) -> float:
        """Largest strain at a depth."""
        return _interpolate(depth_mm, self.depth_mm, self.strain)

    def smallest_gap_mm(
        self, *, pitch_mm: float, radius_mm: float, height_mm: float, depth_mm: float
    ) -> float:
        """Smallest gap between neighbouring marker tips at a depth (equation 1 for all pairs of a row).

        Pairs start at ten positions per pitch, because a press can be anywhere relative to the markers.
        """
        return min(
            gap_mm(pitch_mm=pitch_mm, radius_mm=radius_mm, height_mm=height_mm, slope_rad=here, turn_rad=turn)
            for here, turn in self.pairs_rad(pitch_mm, depth_mm)
        )

    def pairs_rad(self, pitch_mm: float, depth_mm: float) -> list[tuple[float, float]]:
        """Slopes along x through the press, and their change within a pitch; positive towards the camera."""
        level = int(np.argmin(np.abs(self.depth_mm - depth_mm)))
        half = 0.5 * self.size_mm[0]
        x = np.arange(-half, half + 1e-9, pitch_mm / POSITIONS_PER_PITCH)
        basis = self.shell.patch.at(np.column_stack([x, np.zeros(len(x))]))
        rise = -np.einsum("kj,kj->k", basis.slope_x, self.coefficient_mm[level, :, 2][basis.node])
        slope = np.arctan(rise)
        turn = slope[POSITIONS_PER_PITCH:] - slope[:-POSITIONS_PER_PITCH]
        return list(zip(slope.tolist(), turn.tolist(), strict=False))


def deflection_curve(
    *, size_mm: tuple[float, float], thickness_mm: float, poisson: float, deepest_mm: float
) -> DeflectionCurve:
    """The curve of a fingertip of 1 cm² in the middle of a clamped sheet.

    Args:
        size_mm: clamped outline.
        thickness_mm, poisson: of the sheet.
        deepest_mm: the curve ends beyond this depth.
    """
    shell = clamped_shell(size_mm=size_mm, thickness_mm=thickness_mm, poisson=poisson)
    place, weight = fingertip(np.sqrt(FINGERTIP_MM2 / np.pi))
    unit_load = shell.patch.load(place, np.outer(weight, [0.0, 0.0, -1.0]))
    middle = Face(shell=shell, point_mm=np.zeros((1, 2)), height_mm=0.0)
    force = FIRST_FORCE_OVER_E_MM2
    forces: list[float] = []
    depths: list[float] = []
    strains: list[float] = []
    shapes: list[np.ndarray] = []
    coefficient = None
    while force < LAST_FORCE_OVER_E_MM2 and (not depths or depths[-1] < 1.05 * deepest_mm):
        coefficient = equilibrium(shell, force * unit_load, start_mm=coefficient).coefficient_mm
        forces.append(force)
        depths.append(-float(middle.displacement(coefficient)[0, 2]))
        strains.append(_largest_strain(shell, coefficient))
        shapes.append(coefficient.copy())
        force *= GROWTH
    return DeflectionCurve(
        size_mm=size_mm,
        thickness_mm=thickness_mm,
        poisson=poisson,
        force_over_E_mm2=np.array(forces),
        depth_mm=np.array(depths),
        strain=np.array(strains),
        coefficient_mm=np.array(shapes),
        shell=shell,
    )


def clamped_shell(*, size_mm: tuple[float, float], thickness_mm: float, poisson: float) -> Shell:
    """The shell of a designed sheet: thick, without pretension."""
    elements = tuple(max(8, round(size / ELEMENT_MM)) for size in size_mm)
    patch = SplinePatch(size_mm=size_mm, elements=(elements[0], elements[1]), boundary="clamped")
    return Shell(patch=patch, thickness_mm=thickness_mm, poisson=poisson)


def fingertip(radius_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """(60, 2) points that fill a disc around the origin, and their equal weights, which sum to 1."""
    number = np.arange(60) + 0.5
    angle = np.pi * (1 + np.sqrt(5)) * number
    place = radius_mm * np.sqrt(number / 60)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return place, np.full(60, 1 / 60)


def _largest_strain(shell: Shell, coefficient_mm: np.ndarray) -> float:
    """Largest Green strain along x or y, of the membrane and of bending at the face."""
    half = 0.5 * np.asarray(shell.patch.size_mm)
    x, y = np.meshgrid(np.linspace(-half[0], half[0], 61), np.linspace(-half[1], half[1], 41))
    basis = shell.patch.at(np.column_stack([x.ravel(), y.ravel()]))
    by_x, by_y, bend_x, bend_y = (
        np.einsum("kj,kjc->kc", part, coefficient_mm[basis.node])
        for part in (basis.dx, basis.dy, basis.dxx, basis.dyy)
    )
    along_x = by_x[:, 0] + 0.5 * (by_x**2).sum(axis=1) + 0.5 * shell.thickness_mm * np.abs(bend_x[:, 2])
    along_y = by_y[:, 1] + 0.5 * (by_y**2).sum(axis=1) + 0.5 * shell.thickness_mm * np.abs(bend_y[:, 2])
    return float(max(along_x.max(), along_y.max()))


def _interpolate(at: float, x: np.ndarray, y: np.ndarray) -> float:
    """Linear interpolation of the logarithms, extrapolated beyond the last point."""
    u, v, w = np.log(x), np.log(y), np.log(at)
    if w > u[-1]:
        return float(np.exp(v[-1] + (w - u[-1]) * (v[-1] - v[-2]) / (u[-1] - u[-2])))
    return float(np.exp(np.interp(w, u, v)))
