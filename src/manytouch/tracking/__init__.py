"""Tracking: which dot is which marker. The layout at rest is found (`lattice`), then tracked (`matching`).

Where dots are in an image is detection's; what their displacements mean for the sheet is estimation's.
"""

from manytouch.tracking.held_markers import COMPRESSED_VIDEO
from manytouch.tracking.lattice.find import Lattice, find_lattice
from manytouch.tracking.tracker import MarkerTracker, MarkerTrackerState

__all__ = [
    "COMPRESSED_VIDEO",
    "HeldMarkers",
    "Lattice",
    "MarkerTracker",
    "MarkerTrackerState",
    "find_lattice",
]
