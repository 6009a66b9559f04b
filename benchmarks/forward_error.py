"""The shell against 3-D finite elements, with the load given: how much its shape differs.

    python benchmarks/forward_error.py [--case NAME] [--states DIR] [--no-slope]

Solids of several thicknesses, pretensions and Poisson's ratios are pressed by a ball without friction. Their
contact force, as even pressure on the contact area, is put on the shell, which is solved on the elements that
the inversion would use. The table compares both at points 4 mm apart on the camera-side face: the share by
which the depth of the shell is larger (least squares, points within and beyond two thicknesses of the
contact's centre), the same of the displacement in the plane beyond them, and the RMS difference of depth.
Elements of the solids are short at the clamp: long ones are too stiff there. With --no-slope the outline of
the shell has no slope and no deflection, and not the conditions of a slab.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.mechanics.shell.shell import SHEAR_FACTOR, Shell
from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.sheet import Refinement, graded_sheet_model
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation

YOUNG_MPA, SIZE_MM, SPACING_MM = 3.1, (84.0, 60.0), 4.0
AT_CLAMP = 0.15  # length of the elements there, over the thickness
RINGS = ((0.0, 1), (0.5, 6), (0.87, 12))  # radius and number of points of equal weight in a unit disc


@dataclass(frozen=True, kw_only=True)
class Case:
    """A ball on a sheet, and the depths of its lowest point."""

    name: str
    thickness_mm: float = 3.0
    poisson: float = 0.45
    pretension_N_per_mm: float = 0.0
    place_mm: tuple[float, float] = (6.0, 4.0)
    radius_mm: float = 6.0
    depth_mm: tuple[float, ...] = (1.0, 3.0, 6.0)


CASES = (
    Case(name="3 mm"),
    Case(name="3 mm, 0.4 N/mm", pretension_N_per_mm=0.4),
    Case(name="1.5 mm", thickness_mm=1.5),
    Case(name="1.5 mm, 0.2 N/mm", thickness_mm=1.5, pretension_N_per_mm=0.2),
    Case(name="5 mm", thickness_mm=5.0),
    Case(name="nu 0.3", poisson=0.3),
    Case(name="nu 0.49", poisson=0.49),
    Case(name="2.7 t from the clamp", place_mm=(34.0, 0.0), radius_mm=5.0, depth_mm=(0.6, 1.8, 3.6)),
    Case(name="2 t from the clamp", place_mm=(0.0, 24.0), radius_mm=5.0, depth_mm=(0.5, 1.5, 3.0)),
)


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The shell compared with a solid.

    Attributes:
        force_N, depth_mm: of the contact of the solid.
        near, far: relative excess of the shell's depth within and beyond two thicknesses of the contact.
        in_plane: of its displacement in the plane beyond them.
        rms_mm: difference of depth over the sheet.
    """

    force_N: float
    depth_mm: float
    near: float
    far: float
    in_plane: float
    rms_mm: float


def solve_solid(case: Case, states: StateCache) -> list[Deformation]:
    """Equilibria of the solid, one for each depth."""
    t = case.thickness_mm
    corner = 0.5 * np.array(SIZE_MM)
    ends = [sorted([tuple(sign * corner), tuple(sign * (corner - AT_CLAMP * t))]) for sign in (-1.0, 1.0)]
    place = np.array(case.place_mm)
    model = graded_sheet_model(
        SIZE_MM,
        t,
        NeoHooke(young_MPa=YOUNG_MPA, poisson=case.poisson),
        pretension_N_per_mm=case.pretension_N_per_mm,
        element_mm=2.5,
        layers=3,
        refined=(
            Refinement(low_mm=tuple(place - 3.0), high_mm=tuple(place + 3.0), element_mm=1.2),
            *(Refinement(low_mm=low, high_mm=high, element_mm=AT_CLAMP * t) for low, high in ends),
        ),
    )
    path_mm = np.array([[*case.place_mm, depth] for depth in case.depth_mm])
    loading = Loading(touches=(press(Sphere(radius_mm=case.radius_mm), thickness_mm=t, path_mm=path_mm),))
    return [condense(state, loading) for state in states.states(model, loading)]


def compare(case: Case, states: StateCache, shear_factor: float = SHEAR_FACTOR) -> Iterator[Difference]:
    """The shell under the contact forces of each equilibrium of the solid."""
    t, size = case.thickness_mm, np.array(SIZE_MM)
    element_mm = np.clip(SPACING_MM, 1.1 * t, 1.4 * t)
    count = np.rint(size / element_mm).astype(int)
    shell = Shell(
        patch=SplinePatch(size_mm=SIZE_MM, elements=(int(count[0]), int(count[1]))),
        thickness_mm=t,
        poisson=case.poisson,
        pretension_over_E_mm=case.pretension_N_per_mm / YOUNG_MPA,
        shear_factor=shear_factor,
    )
    axes = [np.arange(-0.5 * side + 2.0, 0.5 * side, SPACING_MM) for side in size]
    point_mm = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    face, start = Face(shell=shell, point_mm=point_mm), None
    disc = np.array(
        [[r * np.cos(a), r * np.sin(a)] for r, n in RINGS for a in 2.0 * np.pi * np.arange(n) / n]
    )
    for state in solve_solid(case, states):
        (contact,) = state.contacts
        place_mm = contact.centre_mm + np.sqrt(contact.area_mm2 / np.pi) * disc
        force_mm2 = np.tile(contact.force_N / YOUNG_MPA / len(disc), (len(disc), 1))
        found = equilibrium(shell, shell.patch.load(place_mm, force_mm2), start_mm=start)
        if state.status != "ok" or found.status != "ok":
            raise SystemExit(f"{case.name}: no equilibrium was found at {contact.depth_mm:.1f} mm")
        start = found.coefficient_mm
        own, true = face.displacement(start), state.displacement_mm(point_mm)
        is_far = np.linalg.norm(point_mm - contact.centre_mm, axis=1) > 2.0 * t

        def excess(part: slice, chosen: np.ndarray, own: np.ndarray = own, true: np.ndarray = true) -> float:
            one, other = own[chosen, part].ravel(), true[chosen, part].ravel()
            return float(one @ other / (other @ other)) - 1.0

        yield Difference(
            force_N=contact.normal_force_N,
            depth_mm=contact.depth_mm,
            near=excess(slice(2, 3), ~is_far),
            far=excess(slice(2, 3), is_far),
            in_plane=excess(slice(0, 2), is_far),
            rms_mm=float(np.sqrt(np.mean((own - true)[:, 2] ** 2))),
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--case", choices=[case.name for case in CASES], help="only this one")
    parser.add_argument("--states", type=Path, metavar="DIR", help="keep solved solids here")
    parser.add_argument("--no-slope", action="store_true", help="at the clamp")
    given = parser.parse_args()
    # the conditions of a slab are those of its own shear factor only
    shear_factor = float(np.nextafter(SHEAR_FACTOR, 1.0)) if given.no_slope else SHEAR_FACTOR
    with tempfile.TemporaryDirectory() as folder:
        states = StateCache(folder=given.states or Path(folder))
        print(
            f"{'sheet':<22}{'force N':>9}{'depth mm':>10}{'near':>8}{'far':>8}{'in plane':>10}{'RMS mm':>9}"
        )
        for case in CASES:
            if given.case not in (None, case.name):
                continue
            for each in compare(case, states, shear_factor):
                shares = f"{each.near:>+8.1%}{each.far:>+8.1%}{each.in_plane:>+10.1%}"
                print(f"{case.name:<22}{each.force_N:9.3f}{each.depth_mm:10.2f}{shares}{each.rms_mm:9.4f}")


if __name__ == "__main__":
    main()
