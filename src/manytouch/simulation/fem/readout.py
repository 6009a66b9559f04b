"""Resultants: what each indenter and each patch does to the sheet."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from manytouch.simulation.fem.contact.forces import TouchedFace, touched_face
from manytouch.simulation.fem.contact.indenters import Indenter, signed_distance
from manytouch.simulation.fem.elements.mesh import HexMesh, Nodal
from manytouch.simulation.fem.loading import PressurePatch
from manytouch.simulation.fem.state import ContactForce, SheetState
from manytouch.values.arrays import read_only

FINE_POINTS = 8
"""Points per element edge when areas are counted or patches laid on."""


def contact_area_mm2(
    mesh: HexMesh,
    displacement_mm: Nodal,
    indenter: Indenter,
    position_mm: Float64[np.ndarray, "3"],
    rotation: Float64[np.ndarray, "3 3"],
) -> float:
    """Undeformed area of the touched face that is inside an indenter."""
    face = touched_face(mesh, points=FINE_POINTS, rule="middles")
    there = (face.displaced(mesh, displacement_mm) - position_mm) @ rotation
    distance, _, _ = signed_distance(indenter, there.reshape(-1, 3))
    return float(face.area_mm2.ravel()[distance < 0.0].sum())


def read_contact(
    force: np.ndarray, rest: np.ndarray, place: np.ndarray, area_mm2: float, deepest: float
) -> ContactForce:
    """Resultant of forces (..., 3) at undeformed and present places (..., 3)."""
    force, rest, place = force.reshape(-1, 3), rest.reshape(-1, 3), place.reshape(-1, 3)
    total = force.sum(axis=0)
    if total[2] == 0.0:
        return ContactForce(
            force_N=read_only(total),
            torque_Nmm=np.nan,
            area_mm2=area_mm2,
            centre_mm=read_only(np.full(2, np.nan)),
            penetration_mm=deepest,
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
    square = (offset**2).sum(axis=-1)
    inside = offset.max(axis=-1) <= 1.0 if patch.outline == "rectangle" else square <= 1.0
    height = np.sqrt(np.maximum(1.0 - square, 0.0)) if patch.outline == "dome" else 1.0
    share = np.where(inside, height * face.area_mm2, 0.0)
    if not inside.any():
        raise ValueError(
            f"a pressure patch at {patch.centre_mm} mm of {patch.size_mm} mm covers no part of the sheet"
        )
    return np.asarray(share / share.sum())


def patch_forces(mesh: HexMesh, patch: PressurePatch) -> Float64[np.ndarray, "n 1"]:
    """(n, 1) the part of a patch's force that each node carries."""
    face = touched_face(mesh, points=FINE_POINTS)
    density = patch_shares(face, patch) / face.area_mm2
    return face.nodal_force_N(mesh, density[:, :, None] * np.ones(3))[:, :1]


def with_patches(state: SheetState, patches: tuple[PressurePatch, ...], number: int) -> SheetState:
    """A solved step with its patches read like contacts."""
    if not patches:
        return state
    face = touched_face(state.mesh, points=FINE_POINTS)
    place = face.displaced(state.mesh, state.displacement_mm)
    read = list(state.contacts)
    for patch in patches:
        share = patch_shares(face, patch)
        force = share[:, :, None] * patch.force_N[number]
        read.append(read_contact(force, face.rest_mm, place, float(face.area_mm2[share > 0.0].sum()), 0.0))
    return replace(state, contacts=tuple(read))
