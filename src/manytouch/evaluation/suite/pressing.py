"""The touches of a case as rigid balls that press the solid sheet, step by step.

A strength that is a depth is how deep the ball's lowest point goes. Strengths that are forces are met
by the balls' depths: the strongest goes as deep as the case requires, the others are moved after every step
until their forces stand in the ratio that is wanted.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.evaluation.suite.cases import RAMP_FRAMES, REST_FRAMES, Case, pressure_share
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver
from manytouch.simulation.fem.solver.newton import NewtonSolver
from manytouch.simulation.fem.state import SheetState

ELEMENT_MM = 2.0
FORCE_TOLERANCE = 0.02
MOST_TRIALS = 10
LARGEST_CHANGE_MM = 0.4
DRAG_MM = 3.0
"""Balls with friction are dragged so far along the sheet in the second half of the ramp: they slip."""

Depths = Float64[np.ndarray, " t"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pressed:
    """The sheet in equilibrium at one step of a case.

    Attributes:
        state: of the sheet.
        loading: a single step: where the balls are.
    """

    state: SheetState
    loading: Loading


def sheet_model(case: Case, element_mm: float = ELEMENT_MM) -> SheetModel:
    """The sheet of a case as a solid."""
    return SheetModel(
        size_mm=case.size_mm,
        thickness_mm=case.thickness_mm,
        material=NeoHooke(young_MPa=case.young_MPa, poisson=case.poisson),
        pretension_N_per_mm=case.pretension_N_per_mm,
        element_mm=element_mm,
    )


def solve_presses(case: Case, element_mm: float = ELEMENT_MM) -> Iterator[Pressed]:
    """The equilibria of a case's ramp, `RAMP_FRAMES` of them, each reached from the one before."""
    solver = sheet_solver(sheet_model(case, element_mm))
    strength = np.array([touch.strength for touch in case.touches])
    is_force = case.strength_is == "force"
    depth_mm = np.full(len(strength), case.deepest_mm) if is_force else strength
    state = None
    for step in range(RAMP_FRAMES):
        share = pressure_share(REST_FRAMES + step)
        if is_force:
            found, depth_mm = _balanced(case, solver, state, share=share, depth_mm=depth_mm)
        else:
            found = _reached(case, solver, state, share=share, depth_mm=depth_mm)
        state = found.state
        yield found


def _reached(
    case: Case, solver: NewtonSolver, state: SheetState | None, *, share: float, depth_mm: Depths
) -> Pressed:
    """The equilibrium with the balls at a share of their depths."""
    drag_mm = np.zeros(2)
    if case.friction > 0:
        angle = np.random.default_rng(case.seed).uniform(0, 2 * np.pi)
        drag_mm = DRAG_MM * max(2 * share - 1, 0.0) * np.array([np.cos(angle), np.sin(angle)])
    loading = Loading(
        touches=tuple(
            press(
                Sphere(radius_mm=touch.radius_mm),
                thickness_mm=case.thickness_mm,
                path_mm=np.array([[*(np.array(touch.at_mm) + drag_mm), share * deep_mm]]),
                friction=case.friction,
            )
            for touch, deep_mm in zip(case.touches, depth_mm.tolist(), strict=True)
        )
    )
    begin = solver.start(loading) if state is None else state
    return Pressed(state=solver.step(begin, loading, 0), loading=loading)


def _balanced(
    case: Case, solver: NewtonSolver, state: SheetState | None, *, share: float, depth_mm: Depths
) -> tuple[Pressed, Depths]:
    """The equilibrium in which the forces stand in the ratio of the strengths, and its final depths.

    The first of the strongest balls keeps its depth, the others follow by the secant method, each with
    a stiffness of its own.
    """
    strength = np.array([touch.strength for touch in case.touches])
    lead = int(np.argmax(strength))
    others = np.arange(len(strength)) != lead
    before: tuple[Depths, Depths] | None = None
    stiffness = np.full(len(strength), np.nan)
    for _ in range(MOST_TRIALS):
        found = _reached(case, solver, state, share=share, depth_mm=depth_mm)
        state = found.state
        force_N = np.array([contact.normal_force_N for contact in state.contacts])
        wanted_N = force_N[lead] * strength / strength[lead]
        over_N = force_N - wanted_N
        if state.status != "ok" or (np.abs(over_N) <= FORCE_TOLERANCE * wanted_N).all():
            break
        if before is not None:
            moved_mm = share * (depth_mm - before[0])
            with np.errstate(invalid="ignore", divide="ignore"):
                stiffness = (over_N - before[1]) / moved_mm
        plain = force_N[lead] / (share * depth_mm[lead])
        stiffness = np.where(stiffness > 0.2 * plain, stiffness, plain)
        before = (depth_mm, over_N)
        largest_mm = min(LARGEST_CHANGE_MM, 0.3 * share * case.deepest_mm)
        change_mm = np.clip(-over_N / stiffness, -largest_mm, largest_mm) / share
        depth_mm = np.where(others, depth_mm + change_mm, depth_mm)
    return found, depth_mm
