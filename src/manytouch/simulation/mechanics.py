"""What the simulated sensor asks of a mechanics: where the sheet is at a time, and what touches it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from manytouch.simulation.deformation import TrueContact
from manytouch.simulation.imaging import displacements
from manytouch.simulation.plate import PatchLoad, Plate, clamped_plate
from manytouch.values import Sheet
from manytouch.values.arrays import Points2, Points3, read_only

Watch = Callable[[float], Points3]
"""Displacements (m, 3) of places that were named before, at a time in s."""


@runtime_checkable
class Action(Protocol):
    """Something that happens to the sheet."""

    @property
    def name(self) -> str:
        """For people, and after `sim:`."""

    @property
    def duration_s(self) -> float:
        """Of the whole."""

    @property
    def seed(self) -> int:
        """Of the image noise."""

    def lasting(self, duration_s: float) -> "Action":
        """This action cut, or played again and again, to another duration."""


@runtime_checkable
class Mechanics(Protocol):
    """The sheet in time."""

    def watch(self, place_mm: Points2, height_mm: float = 0.0) -> Watch:
        """How points move that stand height_mm off the camera-side face above undeformed places (m, 2)."""

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """What touches at a time, by an id that is never used again."""


@runtime_checkable
class Pressing(Action, Protocol):
    """An action of given forces, for the linear plate."""

    def loads(self, time_s: float) -> dict[int, PatchLoad]:
        """The presses that touch at a time, by id."""


WITHIN_PATCH = np.array(
    [[0.0, 0.0]]
    + [
        [share * np.cos(angle), share * np.sin(angle)]
        for share in (0.2, 0.4, 0.6, 0.8, 1.0)
        for angle in 2 * np.pi * np.arange(12) / 12
    ]
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlateMechanics:
    """Presses on the linear clamped plate: any force anywhere at once, roughly.

    Attributes:
        sheet: its material must be known.
        scene: the presses.
    """

    sheet: Sheet
    scene: Pressing
    _plate: Plate = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_plate", clamped_plate(self.sheet))

    def watch(self, place_mm: Points2, height_mm: float = 0.0) -> Watch:
        """See `Mechanics`; normals stay normal to the middle surface."""
        modes, lever_mm = self._plate.modes_at(place_mm), self.sheet.thickness_mm / 2 + height_mm

        def displacement_mm(time_s: float) -> Points3:
            loads = self.scene.loads(time_s)
            return displacements(modes.field(self._plate.coefficients(tuple(loads.values()))), lever_mm)

        return displacement_mm

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """The presses of a time, as they are given."""
        loads = self.scene.loads(time_s)
        coefficients = self._plate.coefficients(tuple(loads.values()))
        found = {}
        for id_, load in loads.items():
            patch_mm = np.array(load.centre_mm) + load.radius_mm * WITHIN_PATCH
            found[id_] = TrueContact(
                force_N=read_only(np.array([0.0, 0.0, -load.force_N])),
                torque_Nmm=0.0,
                area_mm2=float(np.pi * load.radius_mm**2),
                centre_mm=read_only(np.array(load.centre_mm)),
                depth_mm=float(self._plate.modes_at(patch_mm).field(coefficients).depth_mm.max()),
            )
        return found
