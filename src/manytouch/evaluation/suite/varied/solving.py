"""The states of a varied case as a 3-D solid on graded elements."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.evaluation.suite.varied.presses import Kind, VariedPress
from manytouch.simulation.fem.cache import problem_keys
from manytouch.simulation.fem.contact.indenters import (
    Fingertip,
    Indenter,
    LyingCylinder,
    Ring,
    RoundPunch,
    Sphere,
    SquarePunch,
    convex_hull,
)
from manytouch.simulation.fem.elements.material import NeoHooke, Yeoh
from manytouch.simulation.fem.loading import IndenterPath, Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import GradedSheetModel, Refinement, graded_sheet_model, sheet_solver
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation

CLEAR_MM = 2.0
"""Bodies are so far above the sheet in the state at rest."""
CORNER_EDGE_MM = 0.8
"""Rounding of a corner, whose tip is then so many times log(3) sqrt(3/2) short."""


def solve_varied(case: VariedCase, finer: float = 1.0) -> Iterator[Deformation]:
    """The states one by one; the first of a sagging sheet is that at rest.

    Args:
        case: to be solved.
        finer: elements are so many times smaller, in the plane; from 2 on also across the thickness.
    """
    model, load = problem(case, finer)
    solver = sheet_solver(model)
    state = solver.start(load)
    kept = np.cumsum([_substeps(case, share) for share in _shares(case)]) - 1
    for number in range(load.steps):
        state = solver.step(state, load, number)
        if number in kept or state.status != "ok":
            yield condense(state, load, pitch_mm=case.pitch_mm)
        if state.status != "ok":
            return


def problem(case: VariedCase, finer: float = 1.0) -> tuple[GradedSheetModel, Loading]:
    """The sheet and what presses it, step by step."""
    second, third = case.stiffening
    rubber = {"young_MPa": case.young_MPa, "poisson": case.poisson, "density_kg_m3": 1070.0}
    material = Yeoh(**rubber, second=second, third=third) if any(case.stiffening) else NeoHooke(**rubber)
    model = graded_sheet_model(
        case.size_mm,
        case.thickness_mm,
        material,
        element_mm=min(10.0, 0.06 * max(case.size_mm)) / finer,
        layers=2 if finer >= 2.0 else 1,
        refined=tuple(_refined(case, each, finer) for each in case.presses),
        pretension_N_per_mm=case.pretension_N_per_mm,
        gravity=(0.0, 0.0, -1.0 if case.is_sagging else 0.0),
        uneven_share=case.uneven_share,
    )
    shares = _steps(case)
    touches = tuple(_touch(case, each, shares) for each in case.presses if each.kind != "dome")
    patches = tuple(_dome(case, each, shares) for each in case.presses if each.kind == "dome")
    return model, Loading(touches=touches, patches=patches)


def _shares(case: VariedCase) -> np.ndarray:
    """Shares of the full strengths of the presses in each state; 0 at rest."""
    return np.array([0.0] * case.is_sagging + list(case.shares))


def _substeps(case: VariedCase, share: float) -> int:
    """Steps to a state: a ring would jump through the sheet in one that is deeper than its wire is thick."""
    rings = [one for one in case.presses if one.kind == "ring"]
    return max([1, *(math.ceil(share * one.strength / one.size_mm[1]) for one in rings)])


def _steps(case: VariedCase) -> np.ndarray:
    """Shares of the strengths in each step."""
    shares = _shares(case)
    before = np.concatenate([[0.0], shares[:-1]])
    return np.concatenate(
        [
            np.linspace(low, high, _substeps(case, high) + 1)[1:]
            for low, high in zip(before.tolist(), shares.tolist(), strict=True)
        ]
    )


def problem_key(case: VariedCase) -> str:
    """A name of all that the states depend on but the solver."""
    return "".join(problem_keys(*problem(case))[-1:]) + f"{case.pitch_mm:g}"


def _touch(case: VariedCase, one: VariedPress, shares: np.ndarray) -> IndenterPath:
    at_mm = np.tile(one.at_mm, (len(shares), 1))
    at_mm[-1] += case.drag_mm
    lift_mm = CORNER_EDGE_MM * math.log(3.0) * math.sqrt(1.5) if one.kind == "corner" else 0.0
    depth_mm = np.where(shares > 0.0, shares * one.strength + lift_mm, -CLEAR_MM)
    path = press(
        indenter(one),
        thickness_mm=case.thickness_mm,
        path_mm=np.column_stack([at_mm, depth_mm]),
        friction=case.friction,
        yaw_rad=np.full(len(shares), one.yaw_rad),
    )
    if not any(one.tilt_rad):
        return path
    return replace(path, rotation_vector=np.tile([*one.tilt_rad, one.yaw_rad], (len(shares), 1)))


def _dome(case: VariedCase, one: VariedPress, shares: np.ndarray) -> PressurePatch:
    """With friction the last state has half of the shear at which it would slip."""
    force_N = np.column_stack([np.zeros((len(shares), 2)), -one.strength * shares])
    if case.friction > 0.0:
        direction = np.array(case.drag_mm) / np.linalg.norm(case.drag_mm)
        force_N[-1, :2] = 0.5 * case.friction * one.strength * shares[-1] * direction
    return PressurePatch(
        centre_mm=one.at_mm, size_mm=(one.size_mm[0], one.size_mm[1]), outline="dome", force_N=force_N
    )


def indenter(one: VariedPress) -> Indenter:
    """The rigid body of a press.

    Raises:
        ValueError: it is a given pressure.
    """
    bodies: dict[Kind, Callable[..., Indenter]] = {
        "ball": lambda radius: Sphere(radius_mm=radius),
        "block": lambda *side: SquarePunch(side_mm=side),
        "punch": lambda radius: RoundPunch(radius_mm=radius),
        "cylinder": lambda radius, length: LyingCylinder(radius_mm=radius, length_mm=length),
        "ring": lambda radius, wire: Ring(radius_mm=radius, wire_radius_mm=wire),
        "fingertip": lambda *half: Fingertip(semi_axes_mm=half),
        "corner": lambda edge: convex_hull(_cube_on_its_corner(edge), edge_radius_mm=CORNER_EDGE_MM),
    }
    if one.kind not in bodies:
        raise ValueError(f"a {one.kind} is no rigid body")
    return bodies[one.kind](*one.size_mm)


def _cube_on_its_corner(edge_mm: float) -> np.ndarray:
    along = np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0)
    first = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    frame = np.stack([first, np.cross(along, first), along])
    corner = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    return np.asarray(edge_mm * corner @ frame.T)


def _refined(case: VariedCase, one: VariedPress, finer: float) -> Refinement:
    """Where a press touches, and where it is dragged to."""
    contact_mm = one.reach_mm
    if one.kind in {"ball", "fingertip"}:
        contact_mm = min(contact_mm, float(np.sqrt(2.0 * one.size_mm[0] * one.strength)) + 1.0)
    elif one.kind == "corner":
        contact_mm = min(contact_mm, 1.5 * one.strength + 1.5)
    ends = np.array([one.at_mm, np.add(one.at_mm, case.drag_mm if one.kind != "dome" else 0.0)])
    low, high = ends.min(axis=0) - contact_mm, ends.max(axis=0) + contact_mm
    narrow_mm = {"ring": 2.0 * one.size_mm[-1], "cylinder": 1.2 * one.size_mm[0]}.get(one.kind, contact_mm)
    element_mm = float(np.clip(0.45 * narrow_mm, 0.8, 2.0 if one.kind != "dome" else 3.0))
    return Refinement(
        low_mm=(float(low[0]), float(low[1])),
        high_mm=(float(high[0]), float(high[1])),
        element_mm=round(element_mm, 2) / finer,
    )
