"""Solve the presses of the group `pads_calculix` of `evaluate` with CalculiX; write them into the package.

    apt-get install calculix-ccx
    .venv/bin/python benchmarks/ship_calculix_pads.py            # half an hour for all; what is there is left
    .venv/bin/python benchmarks/ship_calculix_pads.py --check    # a ball against our own finite elements

A file is only written if the force on the body is that on the bonded face within 0.5 %.
"""

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
from calculix_pads import body, deck, mesh, run, states

from manytouch.evaluation.suite.pads.calculix import CalculixCase, calculix_pads
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.pad_presses import solve_pad
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.deformation_file import write_deformations


def solved(
    case: CalculixCase, folder: Path, *, stiffness: float = 1.0
) -> tuple[tuple[Deformation, Deformation], ...]:
    """Plane of the markers and contact face at each level, the stiffness of the contact times a factor."""
    rest = body(case)
    pad = mesh(case, rest)
    folder.mkdir(parents=True, exist_ok=True)
    return tuple(states(case, pad, rest, run(deck(case, pad, rest, stiffness=stiffness), folder)))


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Our own finite elements against CalculiX when the face is equally deep.

    The penalties of both let the body in by a few micrometres, so that the same depth of the body is not the
    same depth of the face.

    Attributes:
        depth_mm: of the face.
        force_N: normal force, ours and CalculiX's.
        apart_mm: largest distance of the displacements of a marker.
        largest_mm: largest displacement of a marker, CalculiX's.
    """

    depth_mm: float
    force_N: tuple[float, float]
    apart_mm: float
    largest_mm: float

    @property
    def percent(self) -> float:
        """By how much CalculiX's force is larger."""
        own, other = self.force_N
        return 100.0 * (other / own - 1.0)


def ball_against_own(folder: Path) -> tuple[Difference, ...]:
    """The ball of 10 mm without friction, by both programs."""
    case = next(calculix_pads())
    sensor = true_pad(case)
    assert sensor.layout is not None
    place_mm = np.ascontiguousarray(sensor.layout.rest_mm[:, :2])
    depths_mm = sorted({*case.press.levels, *(1.03 * level_mm + 0.01 for level_mm in case.press.levels)})
    path_mm = np.array([[*case.press.at_mm, depth_mm] for depth_mm in depths_mm])
    touch = press(Sphere(radius_mm=5.0), thickness_mm=case.thickness_mm, path_mm=path_mm)
    own = list(solve_pad(sensor, Loading(touches=(touch,)), folder=folder / "own"))
    own_mm = np.array([each.contacts[0].depth_mm for each in own])
    force_N = np.array([each.contacts[0].normal_force_N for each in own])
    moved_mm = np.stack([each.markers.displacement_mm(place_mm) for each in own])
    differences = []
    for markers, _ in solved(case, folder):
        depth_mm, there_mm = markers.contacts[0].depth_mm, markers.displacement_mm(place_mm)
        last = int(np.clip(np.searchsorted(own_mm, depth_mm), 1, len(own) - 1))
        share = (depth_mm - own_mm[last - 1]) / (own_mm[last] - own_mm[last - 1])
        here_mm = (1.0 - share) * moved_mm[last - 1] + share * moved_mm[last]
        differences.append(
            Difference(
                depth_mm=depth_mm,
                force_N=(
                    float((1.0 - share) * force_N[last - 1] + share * force_N[last]),
                    markers.contacts[0].normal_force_N,
                ),
                apart_mm=float(np.linalg.norm(there_mm - here_mm, axis=1).max()),
                largest_mm=float(np.linalg.norm(there_mm, axis=1).max()),
            )
        )
    return tuple(differences)


def check(folder: Path) -> None:
    """Print the comparison of the ball, and what doubling the stiffness of the contact changes."""
    for one in ball_against_own(folder):
        own_N, other_N = one.force_N
        print(
            f"face {one.depth_mm:.3f} mm deep: manytouch {own_N:.4f} N, CalculiX {other_N:.4f} N "
            f"({one.percent:+.2f} %); markers at most {one.apart_mm:.4f} mm apart "
            f"of {one.largest_mm:.3f} mm"
        )
    case = next(calculix_pads())
    for once, twice in zip(solved(case, folder), solved(case, folder / "stiff", stiffness=2.0), strict=True):
        force_N = [one[0].contacts[0].normal_force_N for one in (once, twice)]
        print(f"contact twice as stiff: force {100 * (force_N[1] / force_N[0] - 1):+.2f} %")


def ship(folder: Path, only: str) -> None:
    """Solve what is missing in the package, and write it there."""
    package = Path(str(files("manytouch.evaluation") / "deformations"))
    for case in calculix_pads():
        path = package / case.solution
        if path.exists() or only not in case.name:
            continue
        begin_s, planes = time.monotonic(), {}
        for number, (markers, face) in enumerate(solved(case, folder / case.name)):
            key = f"{number} {case.press.levels[number]:g}"
            planes[key] = replace(markers, contact_face_mm=face.face_mm)
        size, seconds = write_deformations(path, planes), time.monotonic() - begin_s
        print(f"{path.name}: {size} bytes, {seconds:.0f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare a ball with our own elements")
    parser.add_argument("--only", default="", help="part of a name")
    parser.add_argument("--keep", type=Path, help="folder for CalculiX's files")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or Path(scratch)
        check(folder) if arguments.check else ship(folder, arguments.only)


if __name__ == "__main__":
    main()
