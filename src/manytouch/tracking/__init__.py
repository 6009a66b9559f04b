"""Tracking: which dot is which marker. Find the layout at rest, follow it, lock again after it was lost."""

from manytouch.tracking.follow import FollowGrid, Following
from manytouch.tracking.lattice import Lattice, find_lattice

__all__ = ["FollowGrid", "Following", "Lattice", "find_lattice"]
