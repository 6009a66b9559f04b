"""The balance of forces at a share of a load step: internal forces, contacts and dead loads."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.forces import (
    ContactField,
    ContactLaw,
    FrictionHistory,
    PosedShape,
    TouchedFace,
    add_contact,
)
from manytouch.simulation.fem.contact.indenters import pack, signed_distance
from manytouch.simulation.fem.elements.elastic_body import ElasticBody
from manytouch.simulation.fem.elements.mesh import Nodal, Poses
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.readout import contact_area_mm2, patch_forces, read_contact
from manytouch.simulation.fem.state import SheetState
from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Substep:
    """Poses of the indenters and dead loads at a share of a load step.

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
    """One step of a loading: from a state to new poses and dead loads, in a straight line.

    Attributes:
        begin: the state before the step.
        position_mm, rotation_vector: (t, 3) poses at its end.
        dead_N: (n, 3) dead loads at its end.
    """

    begin: SheetState
    position_mm: Poses
    rotation_vector: Poses
    dead_N: Nodal

    def substep(self, share: float, last: SheetState) -> Substep:
        """Poses and loads at a share (0 to 1) of the step; turns are from the last equilibrium."""
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
        """Largest displacement of an indenter in the step."""
        return float(np.linalg.norm(self.position_mm - self.begin.position_mm, axis=1).max(initial=0.0))


NO_TANGENT = np.empty((0, 60, 60))
NO_FRICTION = FrictionHistory(np.zeros((1, 0)), np.zeros((1, 0, 3)), np.zeros((1, 0, 3)))


def _matrices(vector: Poses) -> Float64[np.ndarray, "touches 3 3"]:
    if not len(vector):
        return np.zeros((0, 3, 3))
    return np.ascontiguousarray(Rotation.from_rotvec(vector.copy()).as_matrix())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ForceBalance:
    """Forces out of balance, and their derivative, for a loading.

    Attributes:
        body: mesh and material.
        face: quadrature points of the contacts.
        loading: indenters and patches.
        stiffness_MPa_per_mm, rounding_mm: of the penalty; see `ContactLaw`.
    """

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
        """Whether any indenter has friction; then the tangent is not symmetric."""
        return any(touch.friction > 0.0 for touch in self.loading.touches)

    def poses(self, number: int) -> tuple[Poses, Poses]:
        """Positions and rotation vectors (t, 3) of the indenters at the end of a step."""
        touches = self.loading.touches
        position = np.array([touch.position_mm[number] for touch in touches]).reshape(-1, 3)
        return position, np.array([touch.rotation_vector[number] for touch in touches]).reshape(-1, 3)

    def load_step(self, begin: SheetState, number: int, gravity: tuple[float, float, float]) -> LoadStep:
        """The step of the loading with this number, from a state; gravity in multiples of g."""
        dead_N = self.body.weight_N[:, None] * np.array(gravity)
        for patch in self.loading.patches:
            dead_N += patch_forces(self.body.mesh, patch) * patch.force_N[number]
        position, rotation = self.poses(number)
        return LoadStep(begin=begin, position_mm=position, rotation_vector=rotation, dead_N=dead_N)

    def residual(
        self, state: SheetState, substep: Substep, displacement: Nodal, is_free: Bool[np.ndarray, "nodes 3"]
    ) -> tuple[Nodal, float, float]:
        """Forces out of balance (n, 3), the size of the forces that act, and the smallest J."""
        _, internal, smallest = self.body.forces(displacement)
        if smallest <= 0.0:
            return internal, 0.0, smallest
        external = np.zeros_like(displacement)
        self._add_contacts(state, substep, displacement, external, NO_TANGENT)
        scale = float(np.linalg.norm(external) + np.linalg.norm(substep.dead_N))
        return np.where(is_free, internal - external - substep.dead_N, 0.0), scale, smallest

    def tangent(
        self, state: SheetState, substep: Substep, displacement: Nodal, *, is_exact: bool = True
    ) -> Float64[np.ndarray, "e 60 60"]:
        """Derivative of the forces out of balance by each element's nodes.

        Not exact: without the curvature of the indenters, which destabilises points on sharp edges.
        """
        _, tangent = self.body.forces_and_tangent(displacement)
        nothing = np.zeros_like(displacement)
        factor = 1.0 if is_exact else 0.0
        self._add_contacts(state, substep, displacement, nothing, tangent, curvature_factor=factor)
        return tangent

    def penetration_mm(self, state: SheetState, substep: Substep, displacement: Nodal) -> float:
        """Largest penetration of an indenter into the face."""
        force = np.zeros_like(displacement)
        return max(self._add_contacts(state, substep, displacement, force, NO_TANGENT)[1], default=0.0)

    def _add_contacts(
        self,
        state: SheetState,
        substep: Substep,
        displacement: Nodal,
        force: np.ndarray,
        tangent: np.ndarray,
        *,
        curvature_factor: float = 1.0,
    ) -> tuple[ContactField, list[float]]:
        """Add all contacts; their field (first axis: indenters) and deepest penetrations."""
        shape = (len(self._kind), *self.face.area_mm2.shape)
        field = ContactField(np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3)))
        face = self.face.arrays(self.body.mesh)
        displacement = displacement.copy()  # writable, so the kernel is compiled for one type only
        deepest = []
        for number, touch in enumerate(self.loading.touches):
            history = NO_FRICTION
            if touch.friction > 0.0:
                history = self._friction_history(number, state, substep)
            indenter = PosedShape(
                self._kind[number],
                self._numbers[number],
                substep.position_mm[number],
                substep.rotation[number],
            )
            law = ContactLaw(touch.friction, self.stiffness_MPa_per_mm, self.rounding_mm, curvature_factor)
            out = ContactField(*(array[number] for array in field))
            deepest.append(add_contact(displacement, face, indenter, law, history, out, force, tangent))
        return field, deepest

    def _friction_history(self, number: int, state: SheetState, substep: Substep) -> FrictionHistory:
        """What the friction of one indenter needs of the last equilibrium.

        A point that was not in contact comes into it when the indenter would reach it if it stood still.
        """
        turn, indenter = substep.turn[number], self.loading.touches[number].indenter
        was = self.face.displaced(self.body.mesh, state.displacement_mm)
        away = was - state.position_mm[number]
        before = (away @ turn.T @ substep.rotation[number]).reshape(-1, 3)
        after = ((was - substep.position_mm[number]) @ substep.rotation[number]).reshape(-1, 3)
        apart = np.maximum(signed_distance(indenter, before)[0], 0.0)
        inside = np.maximum(-signed_distance(indenter, after)[0], 0.0)
        fraction = (inside / np.maximum(apart + inside, 1e-12)).reshape(was.shape[:2])
        fraction[state.pressure_MPa[number] > 0.0] = 1.0
        return FrictionHistory(
            contact_fraction=fraction,
            trial_MPa=state.shear_MPa[number] @ turn.T,
            anchor_mm=away @ turn.T + substep.position_mm[number],
        )

    def lift_clear(self, position_mm: Poses, rotation_vector: Poses) -> Poses:
        """Positions (t, 3) raised until no indenter touches the undeformed sheet."""
        rotation = _matrices(rotation_vector)
        clear = position_mm.copy()
        for number, touch in enumerate(self.loading.touches):
            while True:
                at = (self.face.rest_mm.reshape(-1, 3) - clear[number]) @ rotation[number]
                inside_mm = -float(signed_distance(touch.indenter, at)[0].min())
                if inside_mm < 0.0:
                    break
                clear[number, 2] += inside_mm + 1e-3
        return clear

    def equilibrium_state(
        self, state: SheetState, substep: Substep, displacement: Nodal, residual_N: float
    ) -> SheetState:
        """The state at an equilibrium, with its tractions and resultants."""
        external = np.zeros_like(displacement)
        field, deepest = self._add_contacts(state, substep, displacement, external, NO_TANGENT)
        _, internal, _ = self.body.forces(displacement)
        rest = self.face.rest_mm
        place = self.face.displaced(self.body.mesh, displacement)
        contacts = []
        for number, touch in enumerate(self.loading.touches):
            pressure, shear, normal = (array[number] for array in field)
            traction = pressure[:, :, None] * normal + shear
            area_mm2 = contact_area_mm2(
                self.body.mesh,
                displacement,
                touch.indenter,
                substep.position_mm[number],
                substep.rotation[number],
            )
            force = traction * self.face.area_mm2[:, :, None]
            contacts.append(read_contact(force, rest, place, area_mm2, deepest[number]))
        return replace(
            state,
            displacement_mm=read_only(displacement.copy()),
            support_N=read_only((internal - external - substep.dead_N).sum(axis=0)),
            contacts=tuple(contacts),
            residual_N=residual_N,
            dead_N=read_only(substep.dead_N),
            position_mm=read_only(substep.position_mm),
            rotation_vector=read_only(substep.rotation_vector),
            pressure_MPa=read_only(field.pressure_MPa),
            shear_MPa=read_only(field.shear_MPa),
        )
