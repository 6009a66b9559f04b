"""Estimation: from tracked markers to the shape of the sheet and to what touches it.

`PerimeterDepth` is the method `perimeter`: the paper's depth (`depth`) on markers tracked by manytouch,
contacts where the sheet is loaded (`load`, `contacts`), identities that last (`identity`). `paper` is the
paper's own system.
"""

from manytouch.estimation.contacts import ContactFinder
from manytouch.estimation.identity import ContactIdentity
from manytouch.estimation.inversion import MechanicalInversion
from manytouch.estimation.load import LoadModel
from manytouch.estimation.perimeter import PerimeterDepth
from manytouch.estimation.view import RobustView

__all__ = [
    "ContactFinder",
    "ContactIdentity",
    "LoadModel",
    "MechanicalInversion",
    "PerimeterDepth",
    "RobustView",
]
