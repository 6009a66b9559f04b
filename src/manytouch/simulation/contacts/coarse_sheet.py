"""The live sheet on a coarse grid, solved from rest in a few milliseconds."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import CubicSpline

from manytouch.compilation import plain
from manytouch.simulation.contacts.ball_kernels import POINTS, Balls
from manytouch.simulation.contacts.descent import PAIRS, DescentWorkspace, Load, SheetArrays, descend
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.shell.body_kernels import BodyLoads
from manytouch.simulation.shell.energy import ShellEnergy
from manytouch.simulation.shell.live_sheet import camera_side_face
from manytouch.values import Sheet

CELLS = 1536
"""Number of cells of the grid, about: 2.5 mm on a sheet of 120 x 80 mm."""
TOLERANCE = 2e-5
"""Share of the energy that a further step would gain: forces are then within 0.5 %."""
MOST_EVALUATIONS = 2000
"""Evaluations of the energy; usually 30 are enough, thin slack sheets wrinkle and need hundreds."""
MOST_STIFFENING = 4.0
"""Stiffness of the face under a ball, over that of the live sheet, at most."""
LARGEST_STEP_RADII = 0.75
"""Depth by which a ball enters at once, in radii."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DeadLoad:
    """Forces at undeformed places of the touched face, whose direction stays.

    Attributes:
        place_mm: (n, 2) x, y.
        force_N: (n, 3) on the sheet; a press has z < 0.
    """

    place_mm: Float64[np.ndarray, "n 2"]
    force_N: Float64[np.ndarray, "n 3"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetEquilibrium:
    """A sheet in equilibrium.

    Attributes:
        face: its camera-side face, without contacts.
        energy: of the grid on which it was solved.
        loads: what the balls do to it, in their order.
        has_converged: whether it is in equilibrium.
    """

    face: Deformation
    energy: ShellEnergy
    loads: BodyLoads
    has_converged: bool


class SheetGrid:
    """A grid of the sheet, and what its minimisation needs.

    Attributes:
        energy: of the sheet on the grid.
    """

    def __init__(self, sheet: Sheet, spacing_mm: float) -> None:
        self.energy = energy = ShellEnergy(sheet, spacing_mm)
        approximate = energy.preconditioner()
        self._buffers = plain(energy.buffers)
        size = 5 * energy.shape[0] * energy.shape[1]
        slope, new_slope, tried, step, left = (np.empty((5, *energy.shape)) for _ in range(5))
        moved, change, product = np.empty((PAIRS, size)), np.empty((PAIRS, size)), np.empty(PAIRS)
        self._work = plain(DescentWorkspace(slope, new_slope, tried, step, left, moved, change, product))
        self._points = tuple(POINTS * (count - 1) for count in energy.shape)
        self._arrays = plain(
            SheetArrays(
                spacing=energy.spacing_mm,
                law=plain(energy.law),
                bed=plain(energy.bed),
                sines_x=approximate.sines[0],
                sines_y=approximate.sines[1],
                soft=approximate.soft,
                coupling=approximate.coupling,
            )
        )

    def descend(
        self, value: np.ndarray, stretch: np.ndarray, balls: Balls, dead_N: np.ndarray
    ) -> tuple[BodyLoads, bool]:
        """Bring unknowns (5, a, b) to equilibrium with balls and nodal forces (3, a, b).

        Returns:
            What the balls do, and whether equilibrium was reached.
        """
        loads = BodyLoads(
            resultant=np.zeros((len(balls.radius_mm), 7)),
            body_at=np.full(self._points, -1, dtype=np.int64),
            normal_N=np.zeros(self._points),
        )
        load = plain(Load(balls=plain(balls), ball_loads=plain(loads), dead_N=dead_N))
        kept = (self._arrays, load, self._buffers, self._work)
        count = descend(value, stretch, *kept, TOLERANCE, MOST_EVALUATIONS)
        return loads, count > 0

    def nodal(self, dead: DeadLoad) -> np.ndarray:
        """(3, a, b) forces on the nodes, bilinear."""
        out = np.zeros((3, *self.energy.shape))
        if not len(dead.place_mm):
            return out
        cell, share = [], []
        for axis, line_mm in enumerate((self.energy.x_mm, self.energy.y_mm)):
            place = (dead.place_mm[:, axis] - line_mm[0]) / self.energy.spacing_mm[axis]
            cell.append(np.clip(place.astype(np.int64), 0, len(line_mm) - 2))
            share.append(place - cell[axis])
        for right in (0, 1):
            for up in (0, 1):
                weight = np.abs(1 - right - share[0]) * np.abs(1 - up - share[1])
                for k in range(3):
                    np.add.at(out[k], (cell[0] + right, cell[1] + up), weight * dead.force_N[:, k])
        return out


class CoarseSheet:
    """A clamped sheet that is solved for one load after the other, each from rest.

    Attributes:
        fine: the grid of the results; a coarser one gives its first guess.
    """

    def __init__(self, sheet: Sheet) -> None:
        """Args: sheet: its material must be known.

        Raises:
            ValueError: the sheet has no Young's modulus or Poisson's ratio.
        """
        spacing_mm = math.sqrt(float(np.prod(sheet.size_mm)) / CELLS)
        self._coarse, self.fine = SheetGrid(sheet, 2.0 * spacing_mm), SheetGrid(sheet, spacing_mm)
        self._to_fine = tuple(
            CubicSpline(rough, np.eye(len(rough)))(line)
            for rough, line in (
                (self._coarse.energy.x_mm, self.fine.energy.x_mm),
                (self._coarse.energy.y_mm, self.fine.energy.y_mm),
            )
        )

    @property
    def spacing_mm(self) -> float:
        """The larger spacing of the grid."""
        return float(self.fine.energy.spacing_mm.max())

    def press(self, ball_mm: np.ndarray, dead: DeadLoad) -> SheetEquilibrium:
        """The sheet in equilibrium, first on a grid twice as wide, which balls enter step by step.

        Args:
            ball_mm: (n, 4) x, y of the balls, depth of their lowest points below the undeformed touched face,
                and radius.
            dead: other forces.
        """
        energy = self._coarse.energy
        value, stretch = np.zeros((5, *energy.shape)), np.ones(energy.shape)
        dead_N = self._coarse.nodal(dead)
        deepest = float((ball_mm[:, 2] / ball_mm[:, 3]).max(initial=0.0))
        steps = max(math.ceil(deepest / LARGEST_STEP_RADII), 1)
        for step in range(1, steps + 1):
            posed = self._posed(ball_mm, step / steps)
            loads, _ = self._coarse.descend(value, stretch, posed, dead_N)
        along_x, along_y = self._to_fine
        stretch = along_x @ energy.thickness_ratio() @ along_y.T
        value = np.ascontiguousarray(along_x @ value @ along_y.T)
        for line in (value[:, 0], value[:, -1], value[:, :, 0], value[:, :, -1]):
            line[:] = 0.0
        dead_N, posed = self.fine.nodal(dead), self._posed(ball_mm, 1.0)
        stiffness = self._hertz(-loads.resultant[:, 2], ball_mm[:, 3])
        posed = posed._replace(stiffness_MPa_per_mm=np.maximum(posed.stiffness_MPa_per_mm, stiffness))
        loads, has_converged = self.fine.descend(value, stretch, posed, dead_N)
        face = camera_side_face(self.fine.energy, value, stretch)
        return SheetEquilibrium(face=face, energy=self.fine.energy, loads=loads, has_converged=has_converged)

    def _posed(self, ball_mm: np.ndarray, share: float) -> Balls:
        """Balls at a share of their depth, on a face with the stiffness of the live sheet's."""
        x_mm, y_mm, depth_mm, radius_mm = ball_mm.T
        there_mm = depth_mm - (1.0 - share) * np.maximum(depth_mm, 0.0)
        height_mm = self.fine.energy.half_mm - there_mm + radius_mm
        return Balls(
            centre_mm=np.column_stack([x_mm, y_mm, height_mm]),
            radius_mm=np.ascontiguousarray(radius_mm),
            stiffness_MPa_per_mm=np.full(len(ball_mm), self._bed),
        )

    def _hertz(self, force_N: np.ndarray, radius_mm: np.ndarray) -> np.ndarray:
        """(n,) stiffness of a bed (MPa/mm) that balls enter as deep as a half-space under the same force.

        Contacts that are small against the thickness are stiffer than the bed of the live sheet.
        """
        sheet = self.fine.energy.sheet
        assert sheet.young_MPa is not None
        assert sheet.poisson is not None
        plane_MPa = sheet.young_MPa / (1.0 - sheet.poisson**2)
        force_N = np.maximum(force_N, 1e-9)
        depth_mm = (9.0 * force_N**2 / (16.0 * radius_mm * plane_MPa**2)) ** (1.0 / 3.0)
        return np.asarray(
            np.minimum(force_N / (np.pi * radius_mm * depth_mm**2), MOST_STIFFENING * self._bed)
        )

    @property
    def _bed(self) -> float:
        return float(self.fine.energy.bed.stiffness_MPa_per_mm)
