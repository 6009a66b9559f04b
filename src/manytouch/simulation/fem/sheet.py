"""A clamped sheet or a bonded pad as a solver, and its states under a loading."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from manytouch.simulation.fem.elements.elastic_body import elastic_body
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import HexMesh, sheet_mesh, tensor_mesh
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


Lines = tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadModel:
    """A pad that is bonded to a rigid window, its sides free: everything that decides how it deforms.

    Attributes:
        lines_mm: grid lines of the mesh along x, y and z, increasing; z runs from 0, the bonded face, to the
            thickness, the touched face.
        material: of the pad.
    """

    lines_mm: tuple[Lines, Lines, Lines]
    material: NeoHooke


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GradedSheetModel:
    """A clamped sheet on graded lines: everything that decides how it deforms.

    Attributes:
        lines_mm: grid lines of the mesh along x, y and z, increasing; z runs from 0, the camera-side face, to
            the thickness.
        material: of the sheet.
        pretension_N_per_mm, gravity: as of `SheetModel`.
        uneven_share: largest deviation of the thickness from its mean, over that; the camera-side face is
            flat.
    """

    lines_mm: tuple[Lines, Lines, Lines]
    material: NeoHooke
    pretension_N_per_mm: float = 0.0
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    uneven_share: float = 0.0


SolidModel = SheetModel | PadModel | GradedSheetModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """A rectangle of a pad whose elements are at most element_mm wide; around it they grow.

    Attributes:
        low_mm, high_mm: corners x, y.
        element_mm: width of the elements inside.
    """

    low_mm: tuple[float, float]
    high_mm: tuple[float, float]
    element_mm: float


ELEMENT_GROWTH = 0.6
"""Elements around a refinement widen by this share of the distance to it."""
PENALTY_PER_MM = 40.0
"""Contact stiffness of pads in units of Young's modulus: bodies enter a quarter as deep as a wide sheet's."""


def pad_model(
    size_mm: tuple[float, float],
    thickness_mm: float,
    material: NeoHooke,
    *,
    marker_depth_mm: float,
    element_mm: float,
    layers: int,
    refined: tuple[Refinement, ...] = (),
) -> PadModel:
    """A pad with a grid line at its markers.

    Args:
        size_mm, thickness_mm: of the pad, centred on the origin.
        material: of the pad.
        marker_depth_mm: from the touched face to the markers.
        element_mm: largest width of the elements.
        layers: least number of elements through the thickness.
        refined: where the elements are smaller.
    """
    x_mm, y_mm = _plane_lines(size_mm, element_mm, refined)
    marker_mm = thickness_mm - marker_depth_mm
    z_mm = np.zeros(1)
    for low_mm, high_mm in ((0.0, marker_mm), (marker_mm, thickness_mm)):
        count = math.ceil(layers * (high_mm - low_mm) / thickness_mm - 1e-9)
        z_mm = np.concatenate([z_mm, np.linspace(low_mm, high_mm, count + 1)[1:]])
    return PadModel(lines_mm=(x_mm, y_mm, _rounded(z_mm)), material=material)


def graded_sheet_model(
    size_mm: tuple[float, float],
    thickness_mm: float,
    material: NeoHooke,
    *,
    element_mm: float,
    layers: int = 1,
    refined: tuple[Refinement, ...] = (),
    pretension_N_per_mm: float = 0.0,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    uneven_share: float = 0.0,
) -> GradedSheetModel:
    """A clamped sheet whose elements are small where it is pressed.

    Args:
        size_mm, thickness_mm: mounted, centred on the origin.
        material: of the sheet.
        element_mm: largest width of the elements.
        layers: of elements through the thickness.
        refined: where the elements are smaller.
        pretension_N_per_mm, gravity, uneven_share: see `GradedSheetModel`.
    """
    x_mm, y_mm = _plane_lines(size_mm, element_mm, refined)
    return GradedSheetModel(
        lines_mm=(x_mm, y_mm, _rounded(np.linspace(0.0, thickness_mm, layers + 1))),
        material=material,
        pretension_N_per_mm=pretension_N_per_mm,
        gravity=gravity,
        uneven_share=uneven_share,
    )


def _plane_lines(
    size_mm: tuple[float, float], element_mm: float, refined: tuple[Refinement, ...]
) -> tuple[Lines, Lines]:
    """Lines along x and y, dense in the refinements."""
    x_mm, y_mm = (
        _rounded(
            _graded_lines(
                0.5 * size_mm[axis],
                element_mm,
                [(item.low_mm[axis], item.high_mm[axis], item.element_mm) for item in refined],
            )
        )
        for axis in (0, 1)
    )
    return x_mm, y_mm


def _graded_lines(half_mm: float, element_mm: float, refined: list[tuple[float, float, float]]) -> np.ndarray:
    """Lines from -half_mm to half_mm whose spacing is that of the refinements and grows around them."""
    place_mm = np.linspace(-half_mm, half_mm, 4001)
    width_mm = np.full(len(place_mm), element_mm)
    for low_mm, high_mm, fine_mm in refined:
        away_mm = np.maximum(np.maximum(low_mm - place_mm, place_mm - high_mm), 0.0)
        width_mm = np.minimum(width_mm, fine_mm + ELEMENT_GROWTH * away_mm)
    density = 1.0 / width_mm
    count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(place_mm))])
    elements = math.ceil(count[-1] - 1e-6)
    line_mm: np.ndarray = np.interp(np.arange(elements + 1) * count[-1] / elements, count, place_mm)
    return line_mm


def _rounded(line_mm: np.ndarray) -> Lines:
    """Rounded to 1 nm, so that a mesh is the same everywhere."""
    return tuple((np.round(line_mm, 6) + 0.0).tolist())


def sheet_solver(model: SolidModel) -> NewtonSolver:
    """A solver: all nodes of a clamped sheet's side faces are held, or those of a pad's bonded face."""
    if isinstance(model, PadModel):
        x_mm, y_mm, z_mm = (np.array(line) for line in model.lines_mm)
        mesh = tensor_mesh(x_mm, y_mm, z_mm)
        is_held = mesh.node_mm[:, 2] == z_mm[0]
        return NewtonSolver(
            body=elastic_body(mesh, model.material),
            is_free=read_only(np.repeat(~is_held[:, None], 3, axis=1)),
            contact_stiffness_per_mm=PENALTY_PER_MM,
        )
    if isinstance(model, GradedSheetModel):
        mesh = uneven_mesh(tensor_mesh(*(np.array(line) for line in model.lines_mm)), model.uneven_share)
    else:
        mesh = sheet_mesh(model.size_mm, model.thickness_mm, element_mm=model.element_mm, layers=model.layers)
    body = elastic_body(mesh, model.material, pretension_N_per_mm=model.pretension_N_per_mm)
    free = np.repeat(~mesh.is_on_outline[:, None], 3, axis=1)
    return NewtonSolver(body=body, is_free=read_only(free), gravity=model.gravity)


def uneven_mesh(mesh: HexMesh, share: float) -> HexMesh:
    """A mesh whose thickness deviates smoothly from its mean, by at most this share of it."""
    if share == 0.0:
        return mesh
    x, y = (mesh.node_mm[:, axis] / np.ptp(mesh.lines_mm[axis]) for axis in (0, 1))
    wave = np.cos(1.6 * np.pi * x + 0.7) * np.cos(1.3 * np.pi * y - 0.4)
    node_mm = mesh.node_mm * np.column_stack([np.ones((len(x), 2)), 1.0 + share * wave])
    return replace(mesh, node_mm=read_only(node_mm))


def solve_sheet(
    solver: NewtonSolver, loading: Loading, start: SheetState | None = None
) -> Iterator[SheetState]:
    """The states of all steps in their order, each reached from the one before."""
    state = solver.start(loading) if start is None else start
    for number in range(loading.steps):
        state = solver.step(state, loading, number)
        yield state
