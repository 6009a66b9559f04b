"""Given contacts to marker fields, images and readings, hundreds a second: the shell on a coarse grid.

Formulae are in docs/derivations/live-sheet.md, rate and errors in docs/how-to.md.
Scenes in time and finite elements are not used here.
"""

from manytouch.simulation.contacts.kinds import Ball, Patch, PointForces, SimulatedContact
from manytouch.simulation.contacts.simulate import simulate_contacts

__all__ = ["Ball", "Patch", "PointForces", "SimulatedContact", "simulate_contacts"]
