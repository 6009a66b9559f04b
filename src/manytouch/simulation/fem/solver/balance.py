"""The balance of forces at one stage of a step: inner forces, contacts and dead loads."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.forces import TouchedFace, add_contact
from manytouch.simulation.fem.contact.indenters import pack, signed_distance
from manytouch.simulation.fem.elements.assembly import ElasticBody
from manytouch.simulation.fem.elements.mesh import Nodal, Poses
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.readout import contact_area_mm2, patch_forces, read_contact
from manytouch.simulation.fem.state import SheetState
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Substep:
    """Where the indenters are at some share of a step, and what friction remembers there.

    Attributes:
        position_mm, rotation_vector: (t, 3) poses.
        rotation: (t, 3, 3) the same as matrices, sheet_from_indenter.
        turn: (t, 3, 3) from the rotation of the last equilibrium to this one.
        dead_N: (n, 3).
    """

    position_mm: Poses
    rotation_vector: Poses
    rotation: Float64[np.ndarray, "touches 3 3"]
    turn: Float64[np.ndarray, "touches 3 3"]
    dead_N: Nodal


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadStep:
    """The way of a step: from a state to new poses and dead loads, in a straight line.

    Attributes:
        begin: the state before the step.
        position_mm, rotation_vector: (t, 3) poses at its end.
        dead_N: (n, 3) dead loads at its end.
    """

    begin: SheetState
    position_mm: Poses
    rotation_vector: Poses
    dead_N: Nodal

    def stage(self, share: float, last: SheetState) -> Substep:
        """A share of the way, seen from the last equilibrium on it."""
        begin = self.begin
        vector = begin.rotation_vector + share * (self.rotation_vector - begin.rotation_vector)
        rotation = _matrices(vector)
        return Substep(
            position_mm=begin.position_mm + share * (self.position_mm - begin.position_mm),
            rotation_vector=vector,
            rotation=rotation,
            turn=rotation @ _matrices(last.rotation_vector).transpose(0, 2, 1),
            dead_N=begin.dead_N + share * (self.dead_N - begin.dead_N),
        )

    @property
    def length_mm(self) -> float:
        """How far the indenter goes that goes farthest."""
        return float(np.linalg.norm(self.position_mm - self.begin.position_mm, axis=1).max(initial=0.0))


def _matrices(vector: Poses) -> Float64[np.ndarray, "touches 3 3"]:
    if not len(vector):
        return np.zeros((0, 3, 3))
    return np.ascontiguousarray(Rotation.from_rotvec(vector.copy()).as_matrix())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceBalance:
    """Forces out of balance, and their derivative, for a loading."""

    body: ElasticBody
    face: TouchedFace
    loading: Loading
    stiffness_MPa_per_mm: float
    rounding_mm: float
    _kind: np.ndarray = field(init=False, repr=False)
    _numbers: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        kind, numbers = pack(tuple(touch.indenter for touch in self.loading.touches))
        object.__setattr__(self, "_kind", kind)
        object.__setattr__(self, "_numbers", numbers)

    @property
    def has_friction(self) -> bool:
        """Then the tangent is not symmetric."""
        return any(touch.friction > 0.0 for touch in self.loading.touches)

    def poses(self, number: int) -> tuple[Poses, Poses]:
        """Positions and rotation vectors (t, 3) of the indenters at the end of a step."""
        touches = self.loading.touches
        position = np.array([touch.position_mm[number] for touch in touches]).reshape(-1, 3)
        return position, np.array([touch.rotation_vector[number] for touch in touches]).reshape(-1, 3)

    def course(self, begin: SheetState, number: int, gravity: tuple[float, float, float]) -> LoadStep:
        """The way from a state to a step of the loading."""
        dead_N = self.body.weight_N[:, None] * np.array(gravity)
        for patch in self.loading.patches:
            dead_N += patch_forces(self.body.mesh, patch) * patch.force_N[number]
        position, rotation = self.poses(number)
        return LoadStep(begin=begin, position_mm=position, rotation_vector=rotation, dead_N=dead_N)

    def residual(
        self, state: SheetState, stage: Substep, displacement: Nodal, is_free: Bool[np.ndarray, "nodes 3"]
    ) -> tuple[Nodal, float, float]:
        """Forces out of balance (n, 3), the size of the forces that act, and the smallest J."""
        _, inner, smallest = self.body.forces(displacement)
        if smallest <= 0.0:
            return inner, 0.0, smallest
        outer = np.zeros_like(displacement)
        self._contacts(state, stage, displacement, outer, np.empty((0, 60, 60)))
        scale = float(np.linalg.norm(outer) + np.linalg.norm(stage.dead_N))
        return np.where(is_free, inner - outer - stage.dead_N, 0.0), scale, smallest

    def tangent(
        self, state: SheetState, stage: Substep, displacement: Nodal, *, is_exact: bool = True
    ) -> Float64[np.ndarray, "e 60 60"]:
        """Derivative of the forces out of balance by each element's nodes.

        Not exact: without the curvature of the indenters, which destabilises points on sharp edges.
        """
        _, tangent = self.body.forces_and_tangent(displacement)
        nothing = np.zeros_like(displacement)
        self._contacts(state, stage, displacement, nothing, tangent, bending=1.0 if is_exact else 0.0)
        return tangent

    def penetration_mm(self, state: SheetState, stage: Substep, displacement: Nodal) -> float:
        """How far an indenter enters the face at worst."""
        force = np.zeros_like(displacement)
        return max(self._contacts(state, stage, displacement, force, np.empty((0, 60, 60)))[3], default=0.0)

    def _contacts(
        self,
        state: SheetState,
        stage: Substep,
        displacement: Nodal,
        force: np.ndarray,
        tangent: np.ndarray,
        *,
        bending: float = 1.0,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[float]]:
        """Add all contacts; pressure (t, f, q), shear and normals (t, f, q, 3), deepest penetrations."""
        face, mesh = self.face, self.body.mesh
        shape = (len(self._kind), *face.area_mm2.shape)
        pressure, shear, normal = np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3))
        deepest = []
        displacement = displacement.copy()  # writable, always: the kernel is compiled once
        nothing = np.zeros((1, 0, 3))
        for number, touch in enumerate(self.loading.touches):
            held, old_shear, anchor = np.zeros((1, 0)), nothing, nothing
            if touch.friction > 0.0:
                held, old_shear, anchor = self._memory(number, state, stage)
            deepest.append(
                add_contact(
                    displacement,
                    mesh.element,
                    face.owner,
                    face.local,
                    face.value,
                    face.area_mm2,
                    face.rest_mm,
                    self._kind[number],
                    self._numbers[number],
                    stage.position_mm[number],
                    stage.rotation[number],
                    touch.friction,
                    self.stiffness_MPa_per_mm,
                    self.rounding_mm,
                    bending,
                    held,
                    old_shear,
                    anchor,
                    force,
                    tangent,
                    pressure[number],
                    shear[number],
                    normal[number],
                )
            )
        return pressure, shear, normal, deepest

    def _memory(
        self, number: int, state: SheetState, stage: Substep
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What friction knows of the last equilibrium: see `add_contact`.

        A point that did not touch then does so from when the indenter would reach it if it stood still.
        """
        turn, indenter = stage.turn[number], self.loading.touches[number].indenter
        was = self.face.displaced(self.body.mesh, state.displacement_mm)
        away = was - state.position_mm[number]
        before = (away @ turn.T @ stage.rotation[number]).reshape(-1, 3)
        after = ((was - stage.position_mm[number]) @ stage.rotation[number]).reshape(-1, 3)
        apart = np.maximum(signed_distance(indenter, before)[0], 0.0)
        inside = np.maximum(-signed_distance(indenter, after)[0], 0.0)
        held = (inside / np.maximum(apart + inside, 1e-12)).reshape(was.shape[:2])
        held[state.pressure_MPa[number] > 0.0] = 1.0
        return held, state.shear_MPa[number] @ turn.T, away @ turn.T + stage.position_mm[number]

    def lifted(self, position_mm: Poses, rotation_vector: Poses) -> Poses:
        """(t, 3) positions above these, as low as the undeformed sheet is not touched."""
        rotation = _matrices(rotation_vector)
        lifted = position_mm.copy()
        for number, touch in enumerate(self.loading.touches):
            while True:
                at = (self.face.rest_mm.reshape(-1, 3) - lifted[number]) @ rotation[number]
                inside_mm = -float(signed_distance(touch.indenter, at)[0].min())
                if inside_mm < 0.0:
                    break
                lifted[number, 2] += inside_mm + 1e-3
        return lifted

    def settled(
        self, state: SheetState, stage: Substep, displacement: Nodal, residual_N: float
    ) -> SheetState:
        """The state that has been found, with its tractions."""
        outer = np.zeros_like(displacement)
        pressure, shear, normal, deepest = self._contacts(
            state, stage, displacement, outer, np.empty((0, 60, 60))
        )
        _, inner, _ = self.body.forces(displacement)
        rest = self.face.rest_mm
        place = self.face.displaced(self.body.mesh, displacement)
        contacts = []
        for number, touch in enumerate(self.loading.touches):
            traction = pressure[number, :, :, None] * normal[number] + shear[number]
            area_mm2 = contact_area_mm2(
                self.body.mesh,
                displacement,
                touch.indenter,
                stage.position_mm[number],
                stage.rotation[number],
            )
            force = traction * self.face.area_mm2[:, :, None]
            contacts.append(read_contact(force, rest, place, area_mm2, deepest[number]))
        return replace(
            state,
            displacement_mm=read_only(displacement.copy()),
            support_N=read_only((inner - outer - stage.dead_N).sum(axis=0)),
            contacts=tuple(contacts),
            residual_N=residual_N,
            dead_N=read_only(stage.dead_N),
            position_mm=read_only(stage.position_mm),
            rotation_vector=read_only(stage.rotation_vector),
            pressure_MPa=read_only(pressure),
            shear_MPa=read_only(shear),
        )
