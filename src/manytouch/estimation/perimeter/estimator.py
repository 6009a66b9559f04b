"""The method `perimeter`: the paper's depth on tracked markers, contacts at the peaks of the load."""

from dataclasses import dataclass, field, replace
from typing import Any

from manytouch.estimation.assumptions import is_uncalibrated
from manytouch.estimation.contact_finder import ContactFinder
from manytouch.estimation.load.load_contact_finder import LoadContactFinder
from manytouch.estimation.perimeter.marker_surface import MarkerGeometry, MarkerSurface, unknown_surface
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
from manytouch.values import Contacts, Sensor, Surface, TrackedGrid


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PerimeterState:
    """What stays the same between frames, and what a frame passes to the next.

    Attributes:
        geometry: of markers and camera.
        finder: of the contacts, for this sensor.
        contacts: state of the finder.
    """

    geometry: MarkerGeometry
    finder: ContactFinder
    contacts: Any


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PerimeterEstimator:
    """Depth by equation 11 of the paper, after the motion of the view is removed; contacts at load peaks.

    Attributes:
        surface: at the markers.
        contact_finder: finds contacts where view and sheet are known.
        uncalibrated_contact_finder: finds contacts where the view or the sheet was assumed.
    """

    surface: MarkerSurface = field(default_factory=MarkerSurface)
    contact_finder: ContactFinder = field(default_factory=LoadContactFinder)
    uncalibrated_contact_finder: ContactFinder = field(default_factory=uncalibrated_contact_finder)

    def start(self, sensor: Sensor) -> PerimeterState:
        """Computes everything that depends on the sensor only.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has fewer than four markers.
        """
        geometry = self.surface.start(sensor)
        finder = self.uncalibrated_contact_finder if is_uncalibrated(sensor) else self.contact_finder
        return PerimeterState(geometry=geometry, finder=finder, contacts=finder.start(sensor))

    def step(self, state: PerimeterState, grid: TrackedGrid) -> tuple[PerimeterState, Surface, Contacts]:
        """Surface and contacts of the next frame. It never raises; an unusable frame has a status."""
        motion = self.surface(state.geometry, grid)
        finder_state, contacts = state.finder.step(state.contacts, grid, motion)
        layout = state.geometry.layout
        surface = unknown_surface(layout, grid.status) if motion is None else motion.surface
        return replace(state, contacts=finder_state), surface, contacts
