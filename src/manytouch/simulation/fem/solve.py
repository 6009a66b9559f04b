"""Equilibrium of the sheet step by step: Newton with line search, steps that shrink when they must."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.simulation.fem.assembly import ElasticBody, elastic_body
from manytouch.simulation.fem.balance import Balance, Stage, contact_forces, patch_forces, stage_between
from manytouch.simulation.fem.contact import touched_face
from manytouch.simulation.fem.fronts import Dissection
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.material import NeoHooke
from manytouch.simulation.fem.mesh import sheet_mesh
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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solver:
    """Steps a body from equilibrium to equilibrium.

    Attributes:
        body: mesh and material.
        is_free: (n, 3) unknowns; the others stay where they are.
        gravity: (3,) multiples of g.
        contact_stiffness_per_mm: penalty in units of Young's modulus: 0.05 E of pressure enters
            0.05 / stiffness mm, which leaves force and shape in exact balance and only makes the
            indenter that much smaller.
        rounding_mm: penetration below which the penalty softens.
        largest_move_mm: indenters go no further in one solve.
        tolerance: of the forces out of balance, relative to those that act.
        most_iterations: Newton steps before a solve is given up and its step halved.
        smallest_share: of a step, below which it is given up.
    """

    body: ElasticBody
    is_free: Bool[np.ndarray, "n 3"]
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    contact_stiffness_per_mm: float = 10.0
    rounding_mm: float = 0.002
    largest_move_mm: float = 2.0
    tolerance: float = 1e-6
    most_iterations: int = 25
    smallest_share: float = 1e-3
    _order: Dissection = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_order", Dissection(mesh=self.body.mesh, is_free=self.is_free))

    def start(self, loading: Loading) -> SheetState:
        """The unloaded sheet, the indenters where they are in the first step of the loading."""
        nodes, touches = len(self.body.mesh.node_mm), len(loading.touches)
        face = touched_face(self.body.mesh)
        return SheetState(
            mesh=self.body.mesh,
            displacement_mm=read_only(np.zeros((nodes, 3))),
            support_N=read_only(np.zeros(3)),
            contacts=(),
            status="ok",
            reached=1.0,
            newton_steps=0,
            residual_N=0.0,
            dead_N=read_only(np.zeros((nodes, 3))),
            position_mm=read_only(_stacked([touch.position_mm[0] for touch in loading.touches])),
            rotation_vector=read_only(_stacked([touch.rotation_vector[0] for touch in loading.touches])),
            pressure_MPa=read_only(np.zeros((touches, *face.area_mm2.shape))),
            shear_MPa=read_only(np.zeros((touches, *face.area_mm2.shape, 3))),
        )

    def step(self, state: SheetState, loading: Loading, number: int) -> SheetState:
        """The equilibrium under a step of the loading, reached from another state of the same touches."""
        balance = Balance(body=self.body, face=touched_face(self.body.mesh), loading=loading,
                          stiffness_MPa_per_mm=self.contact_stiffness_per_mm * self._young_MPa,
                          rounding_mm=self.rounding_mm)
        dead_N = balance.dead_N(number, self.gravity)
        return self._march(state, balance, number, dead_N)

    @property
    def _young_MPa(self) -> float:
        mu, k = self.body.shear_MPa, self.body.bulk_MPa
        return 9.0 * k * mu / (3.0 * k + mu)

    def _march(self, begin: SheetState, balance: Balance, number: int, dead_N: np.ndarray) -> SheetState:
        """Go through the step in shares that converge."""
        state, reached, velocity, solved = begin, 0.0, None, 0
        end = balance.poses(number)
        move_mm = np.linalg.norm(end[0] - begin.position_mm, axis=1).max(initial=0.0)
        share = min(1.0, self.largest_move_mm / max(float(move_mm), 1e-9))
        largest = share
        while reached < 1.0:
            target = 1.0 if reached + share > 1.0 - 1e-9 else reached + share
            stage = stage_between(begin, state, end, dead_N, target)
            guess = state.displacement_mm
            if velocity is not None:
                guess = guess + (target - reached) * velocity
            found, iterations = self._solve(balance, state, stage, guess)
            solved += iterations
            if found is None:
                share, velocity = 0.5 * (target - reached), None
                if share < self.smallest_share:
                    break
                continue
            velocity = (found.displacement_mm - state.displacement_mm) / (target - reached)
            state, reached = found, target
            share = min(share * (1.5 if iterations < 8 else 1.0), largest)
        return contact_forces(balance, state, loaded=number if reached == 1.0 else None, reached=reached, newton_steps=solved)

    def _solve(
        self, balance: Balance, state: SheetState, stage: Stage, guess: np.ndarray
    ) -> tuple[SheetState | None, int]:
        """Newton's method from a guess; None when it does not converge."""
        displacement = guess
        out, scale, smallest = balance.residual(state, stage, displacement, self.is_free)
        if smallest <= 0.0 or guess is not state.displacement_mm:
            plain = balance.residual(state, stage, state.displacement_mm, self.is_free)
            if smallest <= 0.0 or np.linalg.norm(plain[0]) < np.linalg.norm(out):
                displacement, (out, scale, smallest) = state.displacement_mm, plain
        for iteration in range(self.most_iterations + 1):
            size = float(np.linalg.norm(out))
            if size <= self.tolerance * scale + 1e-9 * self._young_MPa:
                return balance.settled(state, stage, displacement, size), iteration
            if iteration == self.most_iterations or not np.isfinite(size):
                break
            tangent = balance.tangent(state, stage, displacement)
            factors = self._order.factorise(tangent, is_symmetric=not balance.has_friction)
            move = factors.solve(-out)
            found = self._search(balance, state, stage, displacement, move, out)
            if found is None:
                return None, iteration + 1
            displacement, out, scale = found
        return None, self.most_iterations

    def _search(
        self, balance: Balance, state: SheetState, stage: Stage, displacement: np.ndarray, move: np.ndarray, out: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float] | None:
        """As far along a Newton step as brings the forces along it towards zero."""
        slope, size = float(np.vdot(move, out)), float(np.linalg.norm(out))
        length, best = 1.0, None
        for _ in range(8):
            trial = displacement + length * move
            new, scale, smallest = balance.residual(state, stage, trial, self.is_free)
            if smallest <= 0.0:
                length *= 0.3
                continue
            along, new_size = float(np.vdot(move, new)), float(np.linalg.norm(new))
            if best is None or new_size < best[0]:
                best = (new_size, (trial, new, scale))
            if abs(along) <= 0.7 * abs(slope) or new_size < 0.5 * size:
                return trial, new, scale
            ratio = slope / (slope - along) if along * slope < 0.0 else 0.5
            length *= min(max(ratio, 0.1), 0.7)
        return None if best is None else best[1]


def _stacked(rows: list[Float64[np.ndarray, "3"]]) -> Float64[np.ndarray, "t 3"]:
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def sheet_solver(model: SheetModel) -> Solver:
    """A solver for a clamped sheet: all nodes of its side faces are held."""
    mesh = sheet_mesh(model.size_mm, model.thickness_mm, element_mm=model.element_mm, layers=model.layers)
    body = elastic_body(mesh, model.material, pretension_N_per_mm=model.pretension_N_per_mm)
    free = np.repeat(~mesh.is_on_outline[:, None], 3, axis=1)
    return Solver(body=body, is_free=read_only(free), gravity=model.gravity)


def solve_sheet(solver: Solver, loading: Loading, start: SheetState | None = None) -> Iterator[SheetState]:
    """The states of all steps in their order, each reached from the one before."""
    state = solver.start(loading) if start is None else start
    for number in range(loading.steps):
        state = solver.step(state, loading, number)
        yield state
