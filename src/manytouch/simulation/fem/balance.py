"""The balance of forces at one stage of a step: inner forces, contacts, dead loads; and its read-out."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.assembly import ElasticBody
from manytouch.simulation.fem.contact import TouchedFace, add_contact, touched_face
from manytouch.simulation.fem.indenters import packed, signed_distance
from manytouch.simulation.fem.loading import Loading, PressurePatch
from manytouch.simulation.fem.state import ContactForce, SheetState
from manytouch.values.arrays import Points3, read_only

FINE_POINTS = 8
"""Points per element edge when areas are counted or patches laid on."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Stage:
    """Where the indenters are at some share of a step, and what friction remembers there.

    Attributes:
        position_mm, rotation_vector: (t, 3) poses.
        rotation: (t, 3, 3) the same as matrices, sheet_from_indenter.
        turn: (t, 3, 3) from the rotation of the last equilibrium to this one.
        dead_N: (n, 3).
    """

    position_mm: Points3
    rotation_vector: Points3
    rotation: Float64[np.ndarray, "t 3 3"]
    turn: Float64[np.ndarray, "t 3 3"]
    dead_N: Points3


def stage_between(
    begin: SheetState, last: SheetState, end: tuple[Points3, Points3], dead_N: Points3, share: float
) -> Stage:
    """A share of the way from the step's begin to its end, seen from the last equilibrium."""
    position = begin.position_mm + share * (end[0] - begin.position_mm)
    vector = begin.rotation_vector + share * (end[1] - begin.rotation_vector)
    rotation = _matrices(vector)
    return Stage(
        position_mm=position,
        rotation_vector=vector,
        rotation=rotation,
        turn=rotation @ _matrices(last.rotation_vector).transpose(0, 2, 1),
        dead_N=begin.dead_N + share * (dead_N - begin.dead_N),
    )


def _matrices(vector: Points3) -> Float64[np.ndarray, "t 3 3"]:
    if not len(vector):
        return np.zeros((0, 3, 3))
    return np.ascontiguousarray(Rotation.from_rotvec(vector.copy()).as_matrix())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Balance:
    """Forces out of balance, and their derivative, for a loading."""

    body: ElasticBody
    face: TouchedFace
    loading: Loading
    stiffness_MPa_per_mm: float
    rounding_mm: float
    _kind: np.ndarray = field(init=False, repr=False)
    _numbers: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        kind, numbers = packed(tuple(touch.indenter for touch in self.loading.touches))
        object.__setattr__(self, "_kind", kind)
        object.__setattr__(self, "_numbers", numbers)

    @property
    def has_friction(self) -> bool:
        """Then the tangent is not symmetric."""
        return any(touch.friction > 0.0 for touch in self.loading.touches)

    def poses(self, number: int) -> tuple[Points3, Points3]:
        """Positions and rotation vectors (t, 3) of the indenters at the end of a step."""
        touches = self.loading.touches
        position = np.array([touch.position_mm[number] for touch in touches]).reshape(-1, 3)
        return position, np.array([touch.rotation_vector[number] for touch in touches]).reshape(-1, 3)

    def dead_N(self, number: int, gravity: tuple[float, float, float]) -> Points3:
        """(n, 3) nodal forces of the weight and the patches."""
        force = self.body.weight_N[:, None] * np.array(gravity)
        for patch in self.loading.patches:
            force += patch_forces(self.body, patch) * patch.force_N[number]
        return force

    def residual(
        self, state: SheetState, stage: Stage, displacement: Points3, is_free: Bool[np.ndarray, "n 3"]
    ) -> tuple[Points3, float, float]:
        """Forces out of balance (n, 3), the size of the forces that act, and the smallest J."""
        _, inner, smallest = self.body.forces(displacement)
        if smallest <= 0.0:
            return inner, 0.0, smallest
        outer = np.zeros_like(displacement)
        self._contacts(state, stage, displacement, outer, np.empty((0, 60, 60)))
        scale = float(np.linalg.norm(outer) + np.linalg.norm(stage.dead_N))
        return np.where(is_free, inner - outer - stage.dead_N, 0.0), scale, smallest

    def tangent(self, state: SheetState, stage: Stage, displacement: Points3) -> Float64[np.ndarray, "e 60 60"]:
        """Derivative of the forces out of balance by each element's nodes."""
        _, tangent = self.body.forces_and_tangent(displacement)
        self._contacts(state, stage, displacement, np.zeros_like(displacement), tangent)
        return tangent

    def _contacts(
        self, state: SheetState, stage: Stage, displacement: Points3, force: np.ndarray, tangent: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[float]]:
        """Add all contacts; pressure (t, f, q), shear and normals (t, f, q, 3), deepest penetrations."""
        face, mesh = self.face, self.body.mesh
        shape = (len(self._kind), *face.area_mm2.shape)
        pressure, shear, normal = np.zeros(shape), np.zeros((*shape, 3)), np.zeros((*shape, 3))
        deepest = []
        nothing = np.zeros((0, 0, 3))
        for number, touch in enumerate(self.loading.touches):
            old_shear, anchor = nothing, nothing
            if touch.friction > 0.0:
                turn = stage.turn[number]
                old_shear = state.shear_MPa[number] @ turn.T
                was = face.displaced(mesh, state.displacement_mm) - state.position_mm[number]
                anchor = was @ turn.T + stage.position_mm[number]
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
                    state.pressure_MPa[number],
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

    def settled(self, state: SheetState, stage: Stage, displacement: Points3, residual_N: float) -> SheetState:
        """The state that has been found, with its tractions."""
        outer = np.zeros_like(displacement)
        pressure, shear, normal, deepest = self._contacts(state, stage, displacement, outer, np.empty((0, 60, 60)))
        _, inner, _ = self.body.forces(displacement)
        contacts = tuple(
            self._contact(number, stage, displacement, pressure[number, :, :, None] * normal[number] + shear[number], deepest[number])
            for number in range(len(deepest))
        )
        return replace(
            state,
            displacement_mm=read_only(displacement.copy()),
            support_N=read_only((inner - outer - stage.dead_N).sum(axis=0)),
            contacts=contacts,
            residual_N=residual_N,
            dead_N=read_only(stage.dead_N),
            position_mm=read_only(stage.position_mm),
            rotation_vector=read_only(stage.rotation_vector),
            pressure_MPa=read_only(pressure),
            shear_MPa=read_only(shear),
        )

    def _contact(
        self, number: int, stage: Stage, displacement: Points3, traction: np.ndarray, deepest: float
    ) -> ContactForce:
        force = traction * self.face.area_mm2[:, :, None]
        place = self.face.displaced(self.body.mesh, displacement)
        fine = touched_face(self.body.mesh, points=FINE_POINTS, rule="middles")
        at = (fine.displaced(self.body.mesh, displacement) - stage.position_mm[number]) @ stage.rotation[number]
        distance, _, _ = signed_distance(self.loading.touches[number].indenter, at.reshape(-1, 3))
        area = float(fine.area_mm2.ravel()[distance < 0.0].sum())
        return read_contact(force, self.face.rest_mm, place, area, deepest)


def read_contact(
    force: np.ndarray, rest: np.ndarray, place: np.ndarray, area_mm2: float, deepest: float
) -> ContactForce:
    """Resultant of forces (..., 3) at undeformed and present places (..., 3)."""
    force, rest, place = force.reshape(-1, 3), rest.reshape(-1, 3), place.reshape(-1, 3)
    total = force.sum(axis=0)
    if total[2] == 0.0:
        return ContactForce(
            force_N=read_only(total), torque_Nmm=np.nan, area_mm2=area_mm2,
            centre_mm=read_only(np.full(2, np.nan)), penetration_mm=deepest,
        )
    arm = place[:, :2] - force[:, 2] @ place[:, :2] / total[2]
    return ContactForce(
        force_N=read_only(total),
        torque_Nmm=float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum()),
        area_mm2=area_mm2,
        centre_mm=read_only(force[:, 2] @ rest[:, :2] / total[2]),
        penetration_mm=deepest,
    )


def patch_shares(face: TouchedFace, patch: PressurePatch) -> Float64[np.ndarray, "f q"]:
    """(f, q) the part of a patch's force that each point of the face carries; they sum to 1."""
    offset = np.abs(face.rest_mm[:, :, :2] - patch.centre_mm) / (0.5 * np.array(patch.size_mm))
    inside = offset.max(axis=-1) <= 1.0 if patch.outline == "rectangle" else (offset**2).sum(axis=-1) <= 1.0
    share = np.where(inside, face.area_mm2, 0.0)
    if not inside.any():
        raise ValueError(f"a pressure patch at {patch.centre_mm} mm of {patch.size_mm} mm covers no part of the sheet")
    return np.asarray(share / share.sum())


def patch_forces(body: ElasticBody, patch: PressurePatch) -> Float64[np.ndarray, "n 1"]:
    """(n, 1) the part of a patch's force that each node carries."""
    face = touched_face(body.mesh, points=FINE_POINTS)
    density = patch_shares(face, patch) / face.area_mm2
    return face.nodal_force_N(body.mesh, density[:, :, None] * np.ones(3))[:, :1]


def contact_forces(
    balance: Balance, state: SheetState, *, loaded: int | None, reached: float, newton_steps: int
) -> SheetState:
    """The end of a step: the patches read like contacts, and how the solution went."""
    read = list(state.contacts)
    for patch in balance.loading.patches if loaded is not None else ():
        face = touched_face(balance.body.mesh, points=FINE_POINTS)
        share = patch_shares(face, patch)
        force = share[:, :, None] * patch.force_N[loaded]
        place = face.displaced(balance.body.mesh, state.displacement_mm)
        area = float(face.area_mm2[share > 0.0].sum())
        read.append(read_contact(force, face.rest_mm, place, area, 0.0))
    return replace(
        state,
        contacts=tuple(read),
        status="ok" if loaded is not None else "not_converged",
        reached=reached,
        newton_steps=newton_steps,
    )
