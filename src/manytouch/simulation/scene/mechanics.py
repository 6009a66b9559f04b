"""What the simulated sensor asks of a mechanics: where the sheet is at a time, and what touches it."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from manytouch.simulation.scene.deformation import TrueContact
from manytouch.values.arrays import Points2, Points3

PointMotion = Callable[[float], Points3]
"""Displacements (m, 3) of places that were named before, at a time in s."""


@runtime_checkable
class Mechanics(Protocol):
    """The sheet in time."""

    @property
    def name(self) -> str:
        """For people, and after `sim:`."""

    @property
    def duration_s(self) -> float:
        """Of the whole."""

    @property
    def seed(self) -> int:
        """Of the image noise."""

    def with_duration(self, duration_s: float) -> "Mechanics":
        """The same cut, or played again and again, to another duration."""

    def watch(self, place_mm: Points2, height_mm: float = 0.0) -> PointMotion:
        """How points move that stand height_mm off the camera-side face above undeformed places (m, 2)."""

    def contacts(self, time_s: float) -> dict[int, TrueContact]:
        """What touches at a time, by an id that is never used again."""
