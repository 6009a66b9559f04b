"""The protocol of a sheet in time: its deformation and its contacts at any time."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from manytouch.simulation.scene.deformation import TrueContact
from manytouch.values.arrays import Points2, Points3

PointMotion = Callable[[float], Points3]
"""Displacements (m, 3) of places that were named before, at a time in s."""


@runtime_checkable
class MovingSheet(Protocol):
    """The sheet in time."""

    @property
    def name(self) -> str:
        """Name of the motion in messages, and after `sim:`."""

    @property
    def duration_s(self) -> float:
        """Duration of the whole motion."""

    @property
    def seed(self) -> int:
        """Seed of the image noise."""

    def with_duration(self, duration_s: float) -> "MovingSheet":
        """The same motion, cut or repeated to another duration."""

    def motion_of(self, place_mm: Points2, height_mm: float = 0.0) -> PointMotion:
        """How points move that stand height_mm off the camera-side face above undeformed places (m, 2)."""

    def contact_face_motion_of(self, place_mm: Points2) -> PointMotion:
        """How undeformed places (m, 2) of a pad's contact face move; of a clamped sheet as `motion_of`."""

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """Contacts at a time, by an id that is never used again."""
