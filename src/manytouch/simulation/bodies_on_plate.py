"""Bodies on their ways, pressed into the linear plate: quick and rough.

A body becomes a round patch of pressure as wide as its cross-section 1 mm above its lowest point. The
forces are those under which the sheet is, in the middle of each patch, as deep as the body's lowest
point; a body that would have to pull does not touch.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import nnls

from manytouch.simulation.fem.indenters import Indenter, signed_distance
from manytouch.simulation.motion import Body
from manytouch.simulation.plate import PatchLoad, Plate, clamped_plate
from manytouch.values import Sheet

SECTION_MM = 1.0
GRID_MM = 0.25


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodiesOnPlate:
    """Forces at any time that a scene's bodies need on a plate; a contact's id counts bodies per round.

    Attributes:
        name, seed, duration_s: see `Action`.
        round_s: after it the bodies' ways begin again.
        sheet: its material must be known.
        bodies: that press.
    """

    name: str
    seed: int
    duration_s: float
    round_s: float
    sheet: Sheet
    bodies: tuple[Body, ...]
    _plate: Plate = field(init=False, repr=False)
    _radius_mm: tuple[float, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_plate", clamped_plate(self.sheet))
        radii = tuple(patch_radius_mm(body.indenter) for body in self.bodies)
        object.__setattr__(self, "_radius_mm", radii)

    def lasting(self, duration_s: float) -> "BodiesOnPlate":
        """The same cut, or played again and again, to another duration."""
        return replace(self, duration_s=duration_s)

    def loads(self, time_s: float) -> dict[int, PatchLoad]:
        """The patches that press at a time, by id: a body that comes again is another touch."""
        number, local_s = divmod(max(time_s, 0.0), self.round_s)
        depth_mm, loads, ids = [], [], []
        for body_id, (body, radius_mm) in enumerate(zip(self.bodies, self._radius_mm, strict=True)):
            x, y, depth = (float(part) for part in body.way.at(np.array([local_s]))[0][0])
            if depth <= 0.0:
                continue
            lands = np.flatnonzero((body.way.place_mm[:-1, 2] <= 0.0) & (body.way.place_mm[1:, 2] > 0.0))
            touch = int((body.way.time_s[lands] <= local_s).sum())
            ids.append(int((number * self._touches + touch) * len(self.bodies) + body_id))
            depth_mm.append(depth)
            loads.append(PatchLoad(centre_mm=(x, y), radius_mm=radius_mm, force_N=1.0))
        if not loads:
            return {}
        force_N = self._forces_N(loads, np.array(depth_mm))
        found = zip(ids, loads, force_N, strict=True)
        return {id_: replace(load, force_N=float(force)) for id_, load, force in found if force > 0.0}

    @property
    def _touches(self) -> int:
        """More than any body makes in a round."""
        return max((len(body.way.time_s) for body in self.bodies), default=0) + 1

    def _forces_N(self, loads: list[PatchLoad], depth_mm: np.ndarray) -> np.ndarray:
        """Non-negative forces f with G f >= depth and f (G f - depth) = 0, G the depth per force.

        G is symmetric and positive, so they are what minimises f G f / 2 - depth f, and with G = L L^T
        that is the least |L^T f - L^-1 depth| over f >= 0.
        """
        modes = self._plate.modes_at(np.array([load.centre_mm for load in loads]))
        depth_per_N = [modes.field(self._plate.coefficients((load,))).depth_mm for load in loads]
        flexibility = np.column_stack(depth_per_N)
        factor = np.linalg.cholesky(0.5 * (flexibility + flexibility.T))
        return np.asarray(nnls(factor.T, np.linalg.solve(factor, depth_mm))[0])


def patch_radius_mm(indenter: Indenter) -> float:
    """Radius of the disc of the same area as a body's section just above its lowest point."""
    line = np.arange(-40.0, 40.0, GRID_MM) + 0.5 * GRID_MM
    x, y = np.meshgrid(line, line)
    point_mm = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, SECTION_MM)])
    inside = signed_distance(indenter, point_mm)[0] < 0.0
    return float(np.sqrt(max(inside.sum(), 1) * GRID_MM**2 / np.pi))
