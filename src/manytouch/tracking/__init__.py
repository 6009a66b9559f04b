"""Tracking: which dot is which marker. Find the layout at rest, follow it, lock again after it was lost."""

from manytouch.tracking.lattice.find import Lattice, find_lattice
from manytouch.tracking.tracker import MarkerTracker, MarkerTrackerState

__all__ = ["Lattice", "MarkerTracker", "MarkerTrackerState", "find_lattice"]
