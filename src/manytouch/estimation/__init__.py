"""Estimation: from tracked markers to the shape of the sheet and its contacts.

The methods `mechanics` and `perimeter` with what they share; the paper's own system is `manytouch.paper`.
"""

from manytouch.estimation.contact_finder import ContactFinder, MarkerMotion
from manytouch.estimation.contact_tracker import ContactTracker
from manytouch.estimation.load.displacement_load import LoadModel
from manytouch.estimation.load.load_contact_finder import LoadContactFinder
from manytouch.estimation.load.load_peaks import LoadPeakFinder
from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.estimation.pad.estimator import PadEstimator
from manytouch.estimation.perimeter.estimator import PerimeterEstimator
from manytouch.estimation.perimeter.marker_surface import MarkerSurface
from manytouch.estimation.perimeter.rigid_motion import RigidMotionEstimator

__all__ = [
    "ContactFinder",
    "ContactTracker",
    "LoadContactFinder",
    "LoadModel",
    "LoadPeakFinder",
    "MarkerMotion",
    "MarkerSurface",
    "MechanicsEstimator",
    "PadEstimator",
    "PerimeterEstimator",
    "RigidMotionEstimator",
]
