"""The finite elements against CalculiX, an independent program: a sheet and a pad under large dead loads.

    apt-get install calculix-ccx
    python benchmarks/check_calculix.py [--keep DIR]

A sheet of 40 x 30 x 2 mm, E = 1 MPa, nu 0.45, all side faces held, is pressed by 1.2 N spread over an
ellipse of 12 x 8 mm: twice its thickness deep. A pad of 14 x 12 x 4 mm of the same rubber, bonded below, is
pressed by 5 N and sheared by 1.5 N spread over an ellipse of 6 x 5 mm. Both programs get the same nodes, the
same elements of 20 nodes, the same nodal forces and the same neo-Hooke,
C10 (J^(-2/3) I1 - 3) + (J - 1)^2 / D1 with C10 = mu / 2 and D1 = 2 / k. They differ in their quadrature, and
CalculiX does nothing against the locking of nearly incompressible rubber: on a coarse mesh it is
too stiff, and comes near as the mesh gets finer.
"""

import argparse
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.elements.mesh import HexMesh, reference_nodes
from manytouch.simulation.fem.loading import Loading, PressurePatch
from manytouch.simulation.fem.readout import patch_forces
from manytouch.simulation.fem.sheet import SheetModel, SolidModel, pad_model, sheet_solver, solve_sheet

RUBBER = NeoHooke(young_MPa=1.0, poisson=0.45)
STEPS = 6
# corners and edge middles of C3D20 in the unit cube, in CalculiX's order
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A solid under a patch of dead load.

    Attributes:
        model: of the solid.
        patch: its force grows in steps.
        seen_mm: place of the node whose depth is compared.
    """

    model: SolidModel
    patch: PressurePatch
    seen_mm: tuple[float, float, float]


def sheet(element_mm: float) -> Problem:
    """The clamped sheet, its elements of a width; seen on the camera-side face."""
    model = SheetModel(size_mm=(40.0, 30.0), thickness_mm=2.0, material=RUBBER, element_mm=element_mm)
    patch = PressurePatch(
        centre_mm=(2.0, -1.0), size_mm=(12.0, 8.0), force_N=growing(np.array([0.0, 0.0, -1.2]))
    )
    return Problem(model=model, patch=patch, seen_mm=(2.5, 0.0, 0.0))


def pad(element_mm: float) -> Problem:
    """The bonded pad, its elements of a width and height; seen on the touched face."""
    model = pad_model(
        (14.0, 12.0), 4.0, RUBBER, marker_depth_mm=1.0, element_mm=element_mm, layers=round(4.0 / element_mm)
    )
    patch = PressurePatch(
        centre_mm=(1.0, 0.5), size_mm=(6.0, 5.0), force_N=growing(np.array([1.5, 0.0, -5.0]))
    )
    return Problem(model=model, patch=patch, seen_mm=(1.0, 0.5, 4.0))


def growing(force_N: np.ndarray) -> np.ndarray:
    """(STEPS, 3) from a part of the force to all of it."""
    return force_N * np.arange(1, STEPS + 1)[:, None] / STEPS


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Both programs' answers to the same problem.

    Attributes:
        depth_mm: of the node that is compared, manytouch and CalculiX.
        apart_mm: largest distance of the displacements of any node.
    """

    depth_mm: tuple[float, float]
    apart_mm: float

    @property
    def percent(self) -> float:
        """By how much CalculiX is deeper."""
        own, other = self.depth_mm
        return 100.0 * (other - own) / own


def calculix() -> str | None:
    """Where CalculiX is; None when it is not installed."""
    return shutil.which("ccx")


def compare(problem: Problem, element: str, *, folder: Path) -> Agreement:
    """Solve with both.

    Args:
        problem: to solve.
        element: CalculiX's, "C3D20" (27 points) or "C3D20R" (8 points).
        folder: for CalculiX's files.
    """
    solver = sheet_solver(problem.model)
    *_, state = solve_sheet(solver, Loading(patches=(problem.patch,)))
    mesh = solver.body.mesh
    force_N = patch_forces(mesh, problem.patch) * problem.patch.force_N[-1]
    other_mm = run(deck(mesh, force_N, ~solver.is_free.any(axis=1), element), len(mesh.node_mm), folder)
    middle = int(np.argmin(np.linalg.norm(mesh.node_mm - problem.seen_mm, axis=1)))
    return Agreement(
        depth_mm=(-float(state.displacement_mm[middle, 2]), -float(other_mm[middle, 2])),
        apart_mm=float(np.linalg.norm(state.displacement_mm - other_mm, axis=1).max()),
    )


def deck(mesh: HexMesh, force_N: np.ndarray, is_held: np.ndarray, element: str) -> str:
    """CalculiX's input: nodes, elements, material, held nodes, dead nodal forces (n, 3)."""
    place = [*CORNERS, *((np.add(CORNERS[a], CORNERS[b]) / 2).tolist() for a, b in EDGES)]
    order = [int(np.argmin(np.linalg.norm(reference_nodes() - point, axis=1))) for point in place]
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{n}, {x:.9g}, {y:.9g}, {z:.9g}" for n, (x, y, z) in enumerate(mesh.node_mm, start=1)]
    lines.append(f"*ELEMENT, TYPE={element}, ELSET=SHEET")
    for number, nodes in enumerate(mesh.element[:, order] + 1, start=1):
        names = [str(node) for node in (number, *nodes)]
        lines += [", ".join(names[:12]) + ",", ", ".join(names[12:])]
    lines += [
        "*MATERIAL, NAME=RUBBER",
        "*HYPERELASTIC, NEO HOOKE",
        f"{RUBBER.shear_MPa / 2:.12g}, {2 / RUBBER.bulk_MPa:.12g}",
        "*SOLID SECTION, ELSET=SHEET, MATERIAL=RUBBER",
        "*NSET, NSET=HELD",
        *(f"{node + 1}," for node in np.flatnonzero(is_held)),
        "*BOUNDARY",
        "HELD, 1, 3",
        "*STEP, NLGEOM, INC=200",
        "*STATIC",
        "0.1, 1.",
        "*CLOAD",
        *(f"{node + 1}, {axis + 1}, {force_N[node, axis]:.12g}" for node, axis in np.argwhere(force_N)),
        "*NODE PRINT, NSET=ALL, FREQUENCY=200",
        "U",
        "*END STEP",
    ]
    return "\n".join(lines) + "\n"


def run(text: str, nodes: int, folder: Path) -> np.ndarray:
    """Displacements (n, 3) at the end of CalculiX's step."""
    program = calculix()
    if program is None:
        raise SystemExit("CalculiX is not installed: apt-get install calculix-ccx")
    (folder / "sheet.inp").write_text(text)
    subprocess.run([program, "-i", "sheet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    rows = [line.split() for line in (folder / "sheet.dat").read_text().splitlines()]
    table = np.array([row for row in rows if len(row) == 4 and row[0].isdigit()], dtype=float)[-nodes:]
    moved_mm = np.empty((nodes, 3))
    moved_mm[table[:, 0].astype(int) - 1] = table[:, 1:]
    return moved_mm


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--keep", type=Path, help="folder for CalculiX's files")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for solid, element, element_mm in (
            (sheet, "C3D20", 2.5),
            (sheet, "C3D20R", 2.5),
            (sheet, "C3D20R", 1.25),
            (pad, "C3D20R", 1.4),
            (pad, "C3D20R", 1.0),
        ):
            found = compare(solid(element_mm), element, folder=folder)
            own, other = found.depth_mm
            print(
                f"{solid.__name__}, {element:<6} of {element_mm:<4} mm: "
                f"manytouch {own:.4f} mm, CalculiX {other:.4f} mm "
                f"({found.percent:+.2f} %), nodes at most {found.apart_mm:.4f} mm apart"
            )


if __name__ == "__main__":
    main()
