"""Equilibrium of the sheet step by step: Newton with line search, steps that shrink when they must."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool
from threadpoolctl import threadpool_limits

from manytouch.simulation.fem.contact.forces import touched_face
from manytouch.simulation.fem.elements.elastic_body import ElasticBody
from manytouch.simulation.fem.elements.mesh import Nodal
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.readout import with_patches
from manytouch.simulation.fem.solver.balance import ForceBalance, LoadStep, Substep
from manytouch.simulation.fem.solver.multifrontal import MultifrontalSolver
from manytouch.simulation.fem.state import SheetState
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NewtonSolver:
    """Steps a body from equilibrium to equilibrium.

    Attributes:
        body: mesh and material.
        is_free: (n, 3) unknowns; the others stay where they are.
        gravity: (3,) multiples of g.
        contact_stiffness_per_mm: penalty in units of Young's modulus: 0.05 E of pressure enters
            0.05 / stiffness mm, which leaves force and shape in exact balance and only makes the
            indenter that much smaller.
        rounding_mm: penetration below which the penalty softens.
        largest_guess_mm: a share of a step is so small that its first guess is no deeper in an indenter.
        largest_move_mm: nor has it moved any node further.
        largest_slide_mm: with friction, indenters go no further at once.
        tolerance: of the forces out of balance, relative to those that act.
        most_iterations: Newton steps before a solve is given up and its step halved.
        smallest_share: of a step, below which it is given up.
    """

    body: ElasticBody
    is_free: Bool[np.ndarray, "nodes 3"]
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    contact_stiffness_per_mm: float = 10.0
    rounding_mm: float = 0.002
    largest_guess_mm: float = 0.3
    largest_move_mm: float = 2.5
    largest_slide_mm: float = 1.0
    tolerance: float = 1e-5
    most_iterations: int = 40
    smallest_share: float = 1e-3
    _order: MultifrontalSolver = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_order", MultifrontalSolver(mesh=self.body.mesh, is_free=self.is_free))

    def start(self, loading: Loading) -> SheetState:
        """The unloaded sheet, the indenters of the loading's first step lifted off it."""
        nodes, touches = len(self.body.mesh.node_mm), len(loading.touches)
        balance = self._balance(loading)
        face = balance.face
        position, rotation = balance.poses(0)
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
            position_mm=read_only(balance.lift_clear(position, rotation)),
            rotation_vector=read_only(rotation),
            pressure_MPa=read_only(np.zeros((touches, *face.area_mm2.shape))),
            shear_MPa=read_only(np.zeros((touches, *face.area_mm2.shape, 3))),
        )

    def step(self, state: SheetState, loading: Loading, number: int) -> SheetState:
        """The equilibrium under a step of the loading, reached from another state of the same touches.

        Where no equilibrium is found the state is the last one on the way, its status "not_converged".
        """
        balance = self._balance(loading)
        load_step = balance.load_step(state, number, self.gravity)
        # The fronts are small, and the threads of numpy's library and of scipy's wait for each other: on two
        # cores that is twenty times slower.
        with threadpool_limits(limits=1, user_api="blas"):
            found, reached, solved = self._march(balance, load_step)
        done = reached == 1.0
        found = replace(found, status="ok" if done else "not_converged", reached=reached, newton_steps=solved)
        return with_patches(found, loading.patches, number) if done else found

    def _balance(self, loading: Loading) -> ForceBalance:
        return ForceBalance(
            body=self.body,
            face=touched_face(self.body.mesh),
            loading=loading,
            stiffness_MPa_per_mm=self.contact_stiffness_per_mm * self._young_MPa,
            rounding_mm=self.rounding_mm,
        )

    @property
    def _young_MPa(self) -> float:
        mu, k = self.body.shear_MPa, self.body.bulk_MPa
        return 9.0 * k * mu / (3.0 * k + mu)

    def _march(self, balance: ForceBalance, load_step: LoadStep) -> tuple[SheetState, float, int]:
        """Go the way in shares that converge: the state, the share reached, linear systems solved."""
        state, reached, solved = load_step.begin, 0.0, 0
        slide_mm = self.largest_slide_mm if balance.has_friction else np.inf
        largest = share = min(1.0, slide_mm / max(load_step.length_mm, 1e-9))
        while reached < 1.0:
            velocity = self._velocity(balance, load_step, state, reached)
            found, iterations = None, 1
            while found is None and share >= self.smallest_share:
                target, guess = self._guess(
                    balance, load_step, state, velocity=velocity, reached=reached, share=share
                )
                substep = load_step.substep(target, state)
                found, more = self._solve(balance, state, substep, guess)
                iterations += more
                share = (1.0 if found else 0.5) * (target - reached)
            solved += iterations
            if found is None:
                break
            state, reached, share = found, target, min(2.0 * share, largest)
        return state, reached, solved

    def _velocity(
        self, balance: ForceBalance, load_step: LoadStep, state: SheetState, reached: float
    ) -> Nodal:
        """How the sheet follows the way, to first order: d displacement / d share."""
        here, ahead = load_step.substep(reached, state), load_step.substep(reached + 1e-7, state)
        out = [balance.residual(state, at, state.displacement_mm, self.is_free)[0] for at in (here, ahead)]
        if not np.any(out[1] - out[0]):
            return np.zeros_like(state.displacement_mm)
        tangent = balance.tangent(state, here, state.displacement_mm)
        factors = self._order.factorise(tangent, is_symmetric=not balance.has_friction)
        return factors.solve((out[0] - out[1]) / 1e-7)

    def _guess(
        self,
        balance: ForceBalance,
        load_step: LoadStep,
        state: SheetState,
        *,
        velocity: Nodal,
        reached: float,
        share: float,
    ) -> tuple[float, Nodal]:
        """The next share of the way, so small that the guess is near, and the guess."""
        share = min(share, self.largest_move_mm / max(float(np.abs(velocity).max()), 1e-9))
        while True:
            target = 1.0 if reached + share > 1.0 - 1e-9 else reached + share
            guess = state.displacement_mm + (target - reached) * velocity
            inside_mm = balance.penetration_mm(state, load_step.substep(target, state), guess)
            if inside_mm < self.largest_guess_mm or share < self.smallest_share:
                return target, guess
            share = 0.7 * (target - reached)

    def _solve(
        self, balance: ForceBalance, state: SheetState, substep: Substep, guess: Nodal
    ) -> tuple[SheetState | None, int]:
        """Newton's method from a guess; None when it does not converge."""
        displacement = guess
        out, scale, smallest = balance.residual(state, substep, displacement, self.is_free)
        if smallest <= 0.0:
            return None, 0
        sizes: list[float] = []
        is_exact = True
        for iteration in range(self.most_iterations + 1):
            size = float(np.linalg.norm(out))
            if size <= self.tolerance * scale + 1e-9 * self._young_MPa:
                return balance.equilibrium_state(state, substep, displacement, size), iteration
            sizes.append(size)
            if iteration == self.most_iterations or (len(sizes) > 8 and size > 0.7 * sizes[-7]):
                break
            tangent = balance.tangent(state, substep, displacement, is_exact=is_exact)
            factors = self._order.factorise(tangent, is_symmetric=not balance.has_friction)
            if is_exact and not balance.has_friction and factors.pivoted_parts:
                tangent = balance.tangent(state, substep, displacement, is_exact=False)
                factors = self._order.factorise(tangent, is_symmetric=True)
            move = factors.solve(-out)
            found = self._search(balance, state, substep, displacement=displacement, move=move, out=out)
            if found is None:
                return None, iteration + 1
            snaps = np.vdot(move, found[1]) < np.vdot(move, out) < 0.0
            if snaps:
                sizes.clear()
            new, out, scale = found
            is_exact = bool(np.abs(new - displacement).max() > 0.2 * np.abs(move).max())
            displacement = new
        return None, iteration

    def _search(
        self,
        balance: ForceBalance,
        state: SheetState,
        substep: Substep,
        *,
        displacement: Nodal,
        move: Nodal,
        out: Nodal,
    ) -> tuple[np.ndarray, np.ndarray, float] | None:
        """As far along a Newton step as brings the forces along it towards zero."""
        slope, size = float(np.vdot(move, out)), float(np.linalg.norm(out))
        length, best, downhill = 1.0, None, None
        for _ in range(10):
            trial = displacement + length * move
            new, scale, smallest = balance.residual(state, substep, trial, self.is_free)
            if smallest <= 0.0:
                if downhill is not None:
                    break
                length *= 0.3
                continue
            along, new_size = float(np.vdot(move, new)), float(np.linalg.norm(new))
            if best is None or new_size < best[0]:
                best = (new_size, (trial, new, scale))
            if abs(along) <= 0.7 * abs(slope) or new_size < 0.5 * size:
                return trial, new, scale
            if slope < 0.0 and along < 0.0:
                downhill = (trial, new, scale)  # steeper on: the sheet snaps over an edge
                if length >= 8.0:
                    break
                length *= 2.0
            elif downhill is not None:
                break
            else:
                ratio = slope / (slope - along) if along * slope < 0.0 else 0.5
                length *= min(max(ratio, 0.1), 0.7)
        if downhill is not None:
            return downhill
        return None if best is None else best[1]
