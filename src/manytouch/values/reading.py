"""All results of one frame, and its ground truth in simulation."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional

from manytouch.values.contacts import Contacts
from manytouch.values.detections import Detections
from manytouch.values.display.html import facts_table
from manytouch.values.display.text import count_of
from manytouch.values.frame import Frame
from manytouch.values.grid import TrackedGrid
from manytouch.values.status import Status
from manytouch.values.surface import Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from manytouch.values.tabular.rows import ArrowTable


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reading:
    """Results of all stages for one frame; the value that sinks receive.

    Attributes:
        frame: the frame that was processed.
        detections, grid, surface, contacts: the results of the stages.
        milliseconds: processing time from the decoded frame to this reading.
    """

    frame: Frame
    detections: Detections
    grid: TrackedGrid
    surface: Surface
    contacts: Contacts
    milliseconds: float

    @property
    def status(self) -> Status:
        """Status of the first stage that has one other than `OK`."""
        found = (self.detections.status, self.grid.status, self.surface.status, self.contacts.status)
        return next((each for each in found if each is not Status.OK), Status.OK)

    @property
    def markers(self) -> "ArrowTable":
        """The markers as a table for pandas, polars and others, in the columns of markers.parquet."""
        from manytouch.values.tabular.rows import ArrowTable, marker_values_by_column

        return ArrowTable(marker_values_by_column(self))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, texts and lists, which `json.dumps` takes; None where a value is unknown."""
        from manytouch.values.tabular.rows import reading_dict

        return reading_dict(self)

    def draw(self, axes: Optional["Axes"] = None, *, magnification: float = 3.0) -> "Axes":
        """Draw the camera image with markers, displacements since rest and contacts.

        Args:
            axes: matplotlib axes to draw on; None: a new figure.
            magnification: of the displacements.

        Raises:
            MissingExtraError: matplotlib is not installed (extra `lab`).
        """
        from manytouch.values.display.drawing import draw_reading

        return draw_reading(self, axes, magnification)

    def __repr__(self) -> str:
        seen, markers = int(self.grid.is_seen.sum()), len(self.grid.is_seen)
        contacts = count_of(len(self.contacts.touching), "contact")
        return (
            f"Reading(frame {self.frame.index}, {seen} of {markers} markers seen, {contacts}, {self.status})"
        )

    def _repr_html_(self) -> str:
        facts = (
            ("frame", f"{self.frame.index} ({self.frame.timestamp_ns * 1e-9:.3f} s)"),
            ("status", f"{self.status} {self.status.remedy}"),
            ("markers seen", f"{int(self.grid.is_seen.sum())} of {len(self.grid.is_seen)}"),
            ("surface", repr(self.surface)),
            ("time", f"{self.milliseconds:.1f} ms"),
        )
        return facts_table(f"Reading of frame {self.frame.index}", facts) + self.contacts._repr_html_()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Truth:
    """Ground truth of one simulated frame, in the same values as its estimate.

    Attributes:
        frame_index: index of the frame.
        grid: true centres of the dots.
        surface: the true surface at the markers.
        contacts: the true contacts.
    """

    frame_index: int
    grid: TrackedGrid
    surface: Surface
    contacts: Contacts

    def __repr__(self) -> str:
        return f"Truth(frame {self.frame_index}, {count_of(len(self.contacts.touching), 'contact')})"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Comparison:
    """Another result for the same frame, which is shown next to the estimate.

    Attributes:
        name: "truth" or "recorded".
        surface: at the same markers; None if it has other markers.
        contacts: its contacts.
    """

    name: str
    surface: Surface | None
    contacts: Contacts
