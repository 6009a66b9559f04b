"""Everything that is known of one frame."""

from dataclasses import dataclass

from manytouch.values.contacts import Contacts
from manytouch.values.detections import Detections
from manytouch.values.frame import Frame
from manytouch.values.grid import TrackedGrid
from manytouch.values.surface import Surface


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reading:
    """One frame, read: the only thing sinks see.

    Attributes:
        frame: the picture it comes from.
        detections, grid, surface, contacts: what each stage made of it.
        milliseconds: from the decoded frame to this reading.
    """

    frame: Frame
    detections: Detections
    grid: TrackedGrid
    surface: Surface
    contacts: Contacts
    milliseconds: float

    @property
    def status(self) -> str:
        """The first stage's word that is not "ok", or "ok"."""
        words = (self.detections.status, self.grid.status, self.surface.status, self.contacts.status)
        return next((word for word in words if word != "ok"), "ok")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Truth:
    """What really happened in one simulated frame, in the same values as its estimate.

    Attributes:
        frame_index: the frame it belongs to.
        grid: true centres of the markers' images.
        surface: the true surface at the markers.
        contacts: the true contacts.
    """

    frame_index: int
    grid: TrackedGrid
    surface: Surface
    contacts: Contacts


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Comparison:
    """What an estimate is shown beside, for the same frame.

    Attributes:
        name: what it is, in one word: "truth" or "recorded".
        surface: its surface at the same markers; None where its markers are others.
        contacts: its contacts.
    """

    name: str
    surface: Surface | None
    contacts: Contacts
