"""The part of a solved state that images and ground truth need."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.forces import TouchedFace, touched_face
from manytouch.simulation.fem.contact.indenters import (
    signed_distance,
)
from manytouch.simulation.fem.elements.mesh import HexMesh, Nodal, reference_nodes
from manytouch.simulation.fem.loading import Loading
from manytouch.simulation.fem.readout import FINE_POINTS, patch_shares
from manytouch.simulation.fem.state import SheetState
from manytouch.simulation.scene.deformation import NO_CONTACT, Deformation, TrueContact, fill_middles
from manytouch.simulation.scene.pressure_region import level_face_mm2, region_area, second_moments
from manytouch.values.arrays import Mask, read_only


def condense(
    state: SheetState,
    loading: Loading,
    *,
    pad_markers_mm: float | None = None,
    pitch_mm: float | None = None,
) -> Deformation:
    """The face that carries the markers, and the contacts, of a solved state of a loading.

    A state that did not converge may have fewer contacts than the loading. A normal force below what is out
    of balance in the state is none: a body that leaves the face may keep 1e-17 N by rounding.

    Args:
        state: of a loading.
        loading: the loading.
        pad_markers_mm: of a pad, from its bonded face to its markers, a grid line of its mesh; the contact
            face is then read out too, and the depth of a contact is that of this face. None: a clamped sheet,
            all of its camera-side face.
        pitch_mm: of the markers, which defines the regions of contacts; None: they are not read out.
    """
    mesh, level = state.mesh, 0
    if pad_markers_mm is not None:
        level = int(np.argmin(np.abs(mesh.lines_mm[2] - pad_markers_mm)))
    found = plane(state, level)
    if pad_markers_mm is not None:
        found = replace(found, contact_face_mm=plane(state, len(mesh.lines_mm[2]) - 1).face_mm)
    face = touched_face(mesh, points=FINE_POINTS, rule="middles")
    contacts = []
    covered = _touched(state, loading, face)
    for number, (touched, contact) in enumerate(zip(covered, state.contacts, strict=False)):
        if number < len(loading.touches) and abs(contact.force_N[2]) <= state.residual_N:
            contacts.append(NO_CONTACT)
            continue
        rest_mm = face.rest_mm.reshape(-1, 3)[touched, :2] if touched.any() else contact.centre_mm[None]
        depth_mm = -found.touched.displacement_mm(np.ascontiguousarray(rest_mm))[:, 2]
        contacts.append(
            TrueContact(
                force_N=contact.force_N,
                torque_Nmm=contact.torque_Nmm,
                area_mm2=contact.area_mm2,
                centre_mm=contact.centre_mm,
                depth_mm=float(depth_mm.max()) if contact.force_N[2] != 0.0 else np.nan,
                **({} if pitch_mm is None else _region(state, loading, number, pitch_mm)),
            )
        )
    return replace(found, contacts=tuple(contacts))


def _region(state: SheetState, loading: Loading, number: int, pitch_mm: float) -> dict[str, Any]:
    """Region and second moments of a touch or patch; of a flat face that presses evenly its footprint."""
    if number < len(loading.touches):
        face = touched_face(state.mesh)
        force_N = (state.pressure_MPa[number] * face.area_mm2).ravel()
    else:
        face = touched_face(state.mesh, points=FINE_POINTS)
        force_N = patch_shares(face, loading.patches[number - len(loading.touches)]).ravel()
    place_mm = np.ascontiguousarray(face.rest_mm.reshape(-1, 3)[:, :2])
    footprint_mm2 = None
    if number < len(loading.touches):
        footprint_mm2 = level_face_mm2(loading.touches[number].indenter, state.rotation_vector[number])
    is_face = footprint_mm2 is not None and force_N.any()
    return {
        "region_mm2": footprint_mm2 if is_face else region_area(place_mm, force_N, pitch_mm),
        "moment_mm2": second_moments(place_mm, force_N),
    }


def plane(state: SheetState, level: int) -> Deformation:
    """How the material between two layers moved: at the grid line of this number along z; no contacts."""
    return replace(moved_plane(state.mesh, state.displacement_mm, level), status=state.status)


def moved_plane(mesh: HexMesh, displacement_mm: Nodal, level: int) -> Deformation:
    """How a plane of nodes moved, from displacements (n, 3) of all nodes, computed by any program."""
    x_mm, y_mm = (with_middles(line) for line in mesh.lines_mm[:2])
    cells = [len(line) - 1 for line in mesh.lines_mm]
    layer = min(level, cells[2] - 1)
    element = mesh.element[mesh.layer(layer)]
    face_mm = np.zeros((2 * cells[0] + 1, 2 * cells[1] + 1, 3))
    halves = np.rint(2 * reference_nodes()).astype(np.int64)
    column, row = np.divmod(np.arange(len(element)), cells[1])
    for node in np.flatnonzero(halves[:, 2] == 2 * (level - layer)):
        at = (2 * column + halves[node, 0], 2 * row + halves[node, 1])
        face_mm[at] = displacement_mm[element[:, node]]
    fill_middles(face_mm)
    return Deformation(
        x_mm=x_mm, y_mm=y_mm, face_mm=read_only(face_mm.astype(np.float32)), contacts=(), status="ok"
    )


def with_middles(line: np.ndarray) -> np.ndarray:
    """Grid lines and the places half-way between them."""
    out = np.empty(2 * len(line) - 1)
    out[::2], out[1::2] = line, 0.5 * (line[:-1] + line[1:])
    return read_only(out)


def _touched(state: SheetState, loading: Loading, face: TouchedFace) -> list[Mask]:
    """Which of the face's points each touch and each patch covers, as its area is counted."""
    place_mm = face.displaced(state.mesh, state.displacement_mm).reshape(-1, 3)
    covered = []
    for number, touch in enumerate(loading.touches):
        rotation = Rotation.from_rotvec(state.rotation_vector[number].copy()).as_matrix()
        there_mm = (place_mm - state.position_mm[number]) @ rotation

        covered.append(signed_distance(touch.indenter, there_mm)[0] < 0.0)
    covered += [patch_shares(face, patch).ravel() > 0.0 for patch in loading.patches]
    return covered
