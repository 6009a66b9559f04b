"""Estimation: from tracked markers to the shape of the sheet and to what touches it.

`PerimeterEstimator` is the method `perimeter`: the paper's depth (`depth`) on markers tracked by manytouch,
contacts where the sheet is loaded (`load`, `contacts`), identities that last (`identity`). `paper` is the
paper's own system.
"""

from manytouch.estimation.contact_tracker import ContactTracker
from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.estimation.perimeter.contacts import ContactFinder
from manytouch.estimation.perimeter.estimator import PerimeterEstimator
from manytouch.estimation.perimeter.load_model import LoadModel
from manytouch.estimation.perimeter.view_motion import RigidMotionEstimator

__all__ = [
    "ContactFinder",
    "ContactTracker",
    "LoadModel",
    "MechanicsEstimator",
    "PerimeterEstimator",
    "RigidMotionEstimator",
]
