"""Bonded pads pressed by rigid bodies with CalculiX: decks, solving, and what the results state.

The pad is made of quadratic hexahedra between grid lines, small where the body touches. The body is one layer
of linear hexahedra whose lower face is its shape; all its nodes are moved. The contact is that of surfaces:
nodal forces of quadratic faces are uneven, which only matters to what is read out of them.
"""

import math
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from calculix_shapes import SHAPES
from check_calculix import CORNERS, EDGES, calculix
from scipy.interpolate import RegularGridInterpolator

from manytouch.evaluation.suite.pads.calculix import C10_MPA, CalculixCase
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import HexMesh, reference_nodes, tensor_mesh
from manytouch.simulation.fem.readout import read_contact
from manytouch.simulation.fem.sheet import Refinement, pad_model
from manytouch.simulation.scene.condense import moved_plane
from manytouch.simulation.scene.deformation import Deformation, TrueContact
from manytouch.simulation.scene.pressure_region import region_area, second_moments

ELEMENT_MM, CONTACT_ELEMENT_MM, LAYERS = 2.5, 0.7, 3
SHARE, MARGIN_MM = 0.5, 0.15
"""Elements are small below the part of a body that is lower than this share of the last depth and a margin.

Under a ball the contact ends where the ball is half its depth above its lowest point (Hertz).
"""
CAP_MM = 0.4
"""So far above the face, at the last depth, the body ends."""
BODY_MM = 1.0
STIFFNESS_MPA_PER_MM, STICK_MPA_PER_MM = 100.0, 10.0
FIRST_MM, STUCK_MM = 0.3, 0.1
"""Longest way of the first increment of a step without friction, and of every increment with it: points that
begin to touch in an increment stick from its beginning on."""
CONTROLS, RESIDUALS = "*CONTROLS, PARAMETERS=FIELD", "0.5, 0.05, , , 0.5"
"""Largest residual over the mean force, and correction over the increment."""
BALANCE = 0.005
"""Largest part of the force on the body that the bonded face may not return."""
GAP_MM = 0.003
"""Places of the face that are less than this below the body are in contact: its facets deviate by as much."""
RASTER_MM, ROUNDS = 0.02, 60
Tables = dict[tuple[str, str], list[tuple[np.ndarray, np.ndarray]]]
"""By quantity and set: node numbers (n,) and values (n, 3) at the end of each step."""
FORCES, DISPLACEMENTS = "forces", "displacements"
ELEMENT = "C3D20R"
ONE_THREAD = {"OMP_NUM_THREADS": "1"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """One layer of linear hexahedra.

    Attributes:
        node_mm: (n, 3) places; at first its lowest point touches the undeformed pad.
        element: (e, 8) nodes in CalculiX's order.
        line_mm: (a,) grid lines along both of its axes.
        face_mm: (a, a) height of its lower face over its lowest point.
        at_mm: (3,) place of its middle, at the height of its lowest point.
        rotation: (2, 2) pad_from_body, about z.
    """

    node_mm: np.ndarray
    element: np.ndarray
    line_mm: np.ndarray
    face_mm: np.ndarray
    at_mm: np.ndarray
    rotation: np.ndarray

    def moved(self, way_mm: tuple[float, float, float]) -> "Body":
        """The body after a way from here."""
        return replace(self, node_mm=self.node_mm + way_mm, at_mm=self.at_mm + way_mm)

    def is_inside(self, place_mm: np.ndarray) -> np.ndarray:
        """(n,) whether places (n, 3) are at or above its lower face."""
        lower = RegularGridInterpolator(
            (self.line_mm, self.line_mm), self.face_mm, bounds_error=False, fill_value=np.inf
        )
        off_mm = place_mm - self.at_mm
        return np.asarray(off_mm[:, 2] + GAP_MM > lower(off_mm[:, :2] @ self.rotation))


def body(case: CalculixCase) -> Body:
    """The body of a press before the first step."""
    press = case.press
    height, half_mm, step_mm = SHAPES[press.shape]
    count = 2 * math.ceil(half_mm / step_mm) + 1
    line_mm = np.linspace(-half_mm, half_mm, count)
    place_mm = np.stack(np.meshgrid(line_mm, line_mm, indexing="ij"), axis=-1).reshape(-1, 2)
    cap_mm = press.levels[-1] + CAP_MM
    lower_mm = np.minimum(height(place_mm), cap_mm)
    turn = math.radians(press.turn_deg)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    at_mm = np.array([*press.at_mm, case.thickness_mm])
    flat_mm = np.column_stack([place_mm @ rotation.T, np.zeros(len(place_mm))]) + at_mm
    layers = [
        flat_mm + z_mm[:, None] * [0.0, 0.0, 1.0]
        for z_mm in (lower_mm, np.full_like(lower_mm, cap_mm + BODY_MM))
    ]
    number = np.arange(len(place_mm)).reshape(count, count)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    lower = np.stack(corners, axis=-1).reshape(-1, 4)
    lower = lower[lower_mm[lower].min(axis=1) < cap_mm]
    used, element = np.unique(np.concatenate([lower, lower + len(place_mm)], axis=1), return_inverse=True)
    return Body(
        node_mm=np.concatenate(layers)[used],
        element=element.reshape(-1, 8),
        line_mm=line_mm,
        face_mm=lower_mm.reshape(count, count),
        at_mm=at_mm,
        rotation=rotation,
    )


def mesh(case: CalculixCase, rest: Body) -> HexMesh:
    """The pad, its elements small below the body."""
    press = case.press
    near = rest.node_mm[:, 2] < case.thickness_mm + SHARE * press.levels[-1] + MARGIN_MM
    touched_mm = rest.node_mm[near][:, :2]
    way_mm = np.array([[0.0, 0.0], press.drag_mm])
    low_mm, high_mm = (
        (touched_mm.min(axis=0) + way_mm).min(axis=0),
        (touched_mm.max(axis=0) + way_mm).max(axis=0),
    )
    half_mm = 0.5 * np.array(case.size_mm)
    low_mm, high_mm = np.maximum(low_mm, -half_mm), np.minimum(high_mm, half_mm)
    fine = Refinement(
        low_mm=(float(low_mm[0]), float(low_mm[1])),
        high_mm=(float(high_mm[0]), float(high_mm[1])),
        element_mm=CONTACT_ELEMENT_MM,
    )
    model = pad_model(
        case.size_mm,
        case.thickness_mm,
        NeoHooke(young_MPa=case.young_MPa, poisson=case.poisson),
        marker_depth_mm=case.marker_depth_mm,
        element_mm=ELEMENT_MM,
        layers=LAYERS,
        refined=(fine,),
    )
    return tensor_mesh(*(np.array(line) for line in model.lines_mm))


def deck(case: CalculixCase, pad: HexMesh, rest: Body, *, stiffness: float = 1.0) -> str:
    """CalculiX's input: one step for each level.

    Args:
        case: what presses.
        pad: mesh of the pad.
        rest: the body.
        stiffness: factor of the stiffness of the contact.
    """
    friction, count, solids = case.press.friction, len(pad.node_mm), len(pad.element)
    place = [*CORNERS, *((np.add(CORNERS[a], CORNERS[b]) / 2).tolist() for a, b in EDGES)]
    order = [int(np.argmin(np.linalg.norm(reference_nodes() - point, axis=1))) for point in place]
    height_mm = pad.node_mm[:, 2]
    lines = ["*NODE, NSET=PAD", *_nodes(pad.node_mm, 1), "*NODE, NSET=BODY", *_nodes(rest.node_mm, count + 1)]
    lines += [f"*ELEMENT, TYPE={ELEMENT}, ELSET=RUBBER", *_elements(pad.element[:, order] + 1, 1)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=RIGID", *_elements(rest.element + count + 1, solids + 1)]
    lines += _set("BONDED", np.flatnonzero(height_mm == 0.0) + 1)
    lines += _set("FACE", np.flatnonzero(height_mm == case.thickness_mm) + 1)
    lines += ["*SURFACE, NAME=TOUCHED, TYPE=ELEMENT", *(f"{number + 1}, S2" for number in pad.touched)]
    lines += ["*SURFACE, NAME=LOWER, TYPE=ELEMENT"]
    lines += [f"{solids + number + 1}, S1" for number in range(len(rest.element))]
    lines += [
        *("*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", f"{C10_MPA:g}, 0."),
        *("*SOLID SECTION, ELSET=RUBBER, MATERIAL=RUBBER",),
        *("*MATERIAL, NAME=RIGID", "*ELASTIC", "1000., 0.3", "*SOLID SECTION, ELSET=RIGID, MATERIAL=RIGID"),
        *("*SURFACE INTERACTION, NAME=PRESS", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"),
        f"{stiffness * STIFFNESS_MPA_PER_MM:g}",
    ]
    if friction > 0.0:
        lines += ["*FRICTION", f"{friction:g}, {stiffness * STICK_MPA_PER_MM:g}"]
    lines += ["*CONTACT PAIR, INTERACTION=PRESS, TYPE=SURFACE TO SURFACE", "TOUCHED, LOWER"]
    lines += ["*BOUNDARY", "BONDED, 1, 3"]
    before_mm = np.zeros(3)
    for way_mm in ways_mm(case):
        step_mm = float(np.linalg.norm(np.subtract(way_mm, before_mm)))
        before_mm = np.array(way_mm)
        lines += ["*STEP, NLGEOM, INC=500", CONTROLS, RESIDUALS, "*STATIC"]
        longest_mm = STUCK_MM if friction > 0.0 else FIRST_MM
        first = 1.0 / math.ceil(step_mm / longest_mm - 1e-9)
        lines += [f"{first:.6g}, 1., 1e-4, {first if friction > 0.0 else 1.0:.6g}", "*BOUNDARY"]
        lines += [f"BODY, {axis}, {axis}, {move_mm:.9g}" for axis, move_mm in enumerate(way_mm, start=1)]
        lines += ["*NODE PRINT, NSET=PAD, FREQUENCY=1000", "U"]
        for name in ("BONDED", "BODY", "FACE"):
            lines += [f"*NODE PRINT, NSET={name}, FREQUENCY=1000", "RF"]
        lines += ["*END STEP"]
    return "\n".join(lines) + "\n"


def run(text: str, folder: Path) -> Tables:
    """Solve a deck with CalculiX."""
    program = calculix()
    if program is None:
        raise SystemExit("CalculiX is not installed: apt-get install calculix-ccx")
    (folder / "pad.inp").write_text(text)
    with (folder / "pad.log").open("w") as log:
        subprocess.run(
            [program, "-i", "pad"], cwd=folder, check=True, stdout=log, env={**os.environ, **ONE_THREAD}
        )
    return tables((folder / "pad.dat").read_text())


def tables(text: str) -> Tables:
    """What a .dat file states, table by table."""
    found: Tables = {}
    rows: list[list[str]] = []
    key = ("", "")
    for line in [*text.splitlines(), " end for set NONE and time"]:
        if " for set " in line:
            if rows:
                table = np.array(rows, dtype=float)
                found.setdefault(key, []).append((table[:, 0].astype(np.int64), table[:, 1:4]))
            quantity, rest = line.split(" for set ", 1)
            key, rows = (quantity.split("(")[0].strip(), rest.split()[0]), []
        elif line.strip():
            rows.append(line.split())
    return found


def states(
    case: CalculixCase, pad: HexMesh, rest: Body, found: Tables
) -> Iterator[tuple[Deformation, Deformation]]:
    """Plane of the markers and contact face, both with the contact, at the end of each step.

    Raises:
        SystemExit: the force on the body is not that on the bonded face, or a step is missing.
    """
    solved, levels = len(found[FORCES, "BODY"]), len(case.press.levels)
    if solved != levels:
        raise SystemExit(f"{case.name}: CalculiX solved {solved} of {levels} steps")
    for number, way_mm in enumerate(ways_mm(case)):
        body_N, bonded_N = (found[FORCES, name][number][1].sum(axis=0) for name in ("BODY", "BONDED"))
        if np.linalg.norm(body_N + bonded_N) > BALANCE * np.linalg.norm(body_N):
            raise SystemExit(f"{case.name}, level {number}: {body_N} N on the body, {bonded_N} N on the pad")
        displacement_mm, force_N = np.zeros_like(pad.node_mm), np.zeros_like(rest.node_mm)
        nodes, moved_mm = found[DISPLACEMENTS, "PAD"][number]
        displacement_mm[nodes - 1] = moved_mm
        nodes, found_N = found[FORCES, "BODY"][number]
        force_N[nodes - len(pad.node_mm) - 1] = found_N
        markers, face = (
            moved_plane(pad, displacement_mm, int(np.argmin(np.abs(pad.lines_mm[2] - height_mm))))
            for height_mm in (case.thickness_mm - case.marker_depth_mm, case.thickness_mm)
        )
        contact = true_contact(case, rest.moved(way_mm), face, force_N)
        yield replace(markers, contacts=(contact,)), replace(face, contacts=(contact,))


def ways_mm(case: CalculixCase) -> list[tuple[float, float, float]]:
    """Way of the body from its first place to that at the end of each step."""
    press, last = case.press, len(case.press.levels) - 1
    sideways_mm = [press.drag_mm if number == last else (0.0, 0.0) for number in range(last + 1)]
    return [(*way_mm, -level_mm) for way_mm, level_mm in zip(sideways_mm, press.levels, strict=True)]


def true_contact(case: CalculixCase, there: Body, face: Deformation, force_N: np.ndarray) -> TrueContact:
    """The contact from what the body does to the pad at its nodes.

    Args:
        case: the press.
        there: the body where it is now.
        face: how the touched face moved.
        force_N: (n, 3) what its nodes do to the pad.
    """
    touching = np.abs(force_N).max(axis=1) > 0.0
    now_mm, force_N = there.node_mm[touching], force_N[touching]
    before_mm = material_mm(face, now_mm[:, :2])
    inside_mm = covered_mm(case, there, face)
    read = read_contact(
        force_N, np.column_stack([before_mm, now_mm[:, 2]]), now_mm, len(inside_mm) * RASTER_MM**2, 0.0
    )
    return TrueContact(
        force_N=read.force_N,
        torque_Nmm=read.torque_Nmm,
        area_mm2=read.area_mm2,
        centre_mm=read.centre_mm,
        depth_mm=-float(face.displacement_mm(inside_mm)[:, 2].min()),
        region_mm2=region_area(before_mm, -force_N[:, 2], case.pitch_mm),
        moment_mm2=second_moments(before_mm, -force_N[:, 2]),
    )


def material_mm(face: Deformation, place_mm: np.ndarray) -> np.ndarray:
    """Undeformed places (n, 2) of the points of a face that are now at these (n, 2), at most on its edge."""
    low_mm, high_mm = (np.array([face.x_mm[end], face.y_mm[end]]) for end in (0, -1))
    before_mm = np.clip(place_mm, low_mm, high_mm)
    for _ in range(ROUNDS):
        before_mm = np.clip(place_mm - face.displacement_mm(before_mm)[:, :2], low_mm, high_mm)
    return before_mm


def covered_mm(case: CalculixCase, there: Body, face: Deformation) -> np.ndarray:
    """Undeformed places (n, 2) on a raster of the face that are inside the body."""
    reach_mm = there.line_mm[-1] * math.sqrt(2.0)
    line_mm = np.arange(-reach_mm, reach_mm, RASTER_MM)
    place_mm = np.stack(np.meshgrid(line_mm, line_mm, indexing="ij"), axis=-1).reshape(-1, 2)
    place_mm = place_mm + there.at_mm[:2]
    place_mm = place_mm[(np.abs(place_mm) <= 0.5 * np.array(case.size_mm)).all(axis=1)]
    now_mm = np.column_stack([place_mm, np.full(len(place_mm), case.thickness_mm)])
    return np.ascontiguousarray(place_mm[there.is_inside(now_mm + face.displacement_mm(place_mm))])


def _nodes(node_mm: np.ndarray, first: int) -> list[str]:
    return [f"{n}, {x:.9g}, {y:.9g}, {z:.9g}" for n, (x, y, z) in enumerate(node_mm, start=first)]


def _elements(nodes: np.ndarray, first: int) -> list[str]:
    """Lines of elements, at most twelve numbers in each."""
    lines = []
    for number, row in enumerate(nodes, start=first):
        names = [str(node) for node in (number, *row)]
        parts = [", ".join(names[begin : begin + 12]) for begin in range(0, len(names), 12)]
        lines += [*(f"{part}," for part in parts[:-1]), parts[-1]]
    return lines


def _set(name: str, nodes: np.ndarray) -> list[str]:
    return [f"*NSET, NSET={name}", *(f"{node}," for node in nodes)]
