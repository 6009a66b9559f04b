"""Protocol of what finds and follows contacts without mechanics, and the marker motion that it is given.

`LoadContactFinder` satisfies it, for any `LoadEstimator`. The method `perimeter` uses it, and `mechanics` in
frames that the sheet does not describe.
"""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from manytouch.values import Contacts, Sensor, Surface, TrackedGrid
from manytouch.values.arrays import Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerMotion:
    """What the markers of one frame show without a model of the sheet.

    Attributes:
        surface: position and depth of the markers in the sheet frame, without the motion of the view.
        displacement_mm: (m, 2) displacement of all markers in the plane of the sheet at rest, with the motion
            of the view; interpolated where a marker is not seen.
        std_mm: median standard deviation of these displacements along an axis.
    """

    surface: Surface
    displacement_mm: Points2
    std_mm: float


@runtime_checkable
class ContactFinder(Protocol):
    """Finds the contacts of a frame and follows them. Its state is a value."""

    def start(self, sensor: Sensor) -> Any:
        """The state before the first frame. The sensor has a layout of at least four markers."""

    def step(self, state: Any, grid: TrackedGrid, motion: MarkerMotion | None) -> tuple[Any, Contacts]:
        """Contacts of the next frame; `motion` is None where too few markers are seen."""

    def is_touched(self, state: Any) -> bool:
        """Whether a contact was found in the last frame, or one that is not confirmed yet."""
