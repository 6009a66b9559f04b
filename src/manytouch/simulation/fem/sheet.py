"""The clamped sheet as a solver, and its states under a loading."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from manytouch.simulation.fem.elements.assembly import elastic_body
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import sheet_mesh
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.solver.newton import NewtonSolver
from manytouch.simulation.fem.state import SheetState
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetModel:
    """A clamped sheet: everything that decides how it deforms.

    Attributes:
        size_mm, thickness_mm: mounted, before anything touches.
        material: of the sheet.
        pretension_N_per_mm: see `NeoHooke.prestretch`.
        gravity: (3,) multiples of g along the sheet's axes; (0, 0, -1) hangs away from the touched side.
        element_mm, layers: of the mesh.
    """

    size_mm: tuple[float, float]
    thickness_mm: float
    material: NeoHooke
    pretension_N_per_mm: float = 0.0
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    element_mm: float = 2.0
    layers: int = 1


def sheet_solver(model: SheetModel) -> NewtonSolver:
    """A solver for a clamped sheet: all nodes of its side faces are held."""
    mesh = sheet_mesh(model.size_mm, model.thickness_mm, element_mm=model.element_mm, layers=model.layers)
    body = elastic_body(mesh, model.material, pretension_N_per_mm=model.pretension_N_per_mm)
    free = np.repeat(~mesh.is_on_outline[:, None], 3, axis=1)
    return NewtonSolver(body=body, is_free=read_only(free), gravity=model.gravity)


def solve_sheet(
    solver: NewtonSolver, loading: Loading, start: SheetState | None = None
) -> Iterator[SheetState]:
    """The states of all steps in their order, each reached from the one before."""
    state = solver.start(loading) if start is None else start
    for number in range(loading.steps):
        state = solver.step(state, loading, number)
        yield state
