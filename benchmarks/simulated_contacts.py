"""Errors of `simulate_contacts` against 3-D finite elements, and its rate.

    python benchmarks/simulated_contacts.py [--case NAME] [--states DIR] [--rate-only]

Balls and patches on clamped sheets: the demo sheet (120 x 80 x 3 mm, 0.4 N/mm) with one to three contacts,
and the sheets of `forward_error.py` (84 x 60 mm, several thicknesses, pretensions and Poisson's ratios) under
one ball. A line is one equilibrium: largest depth of the solid; RMS and largest difference of depth of all
markers in shares of that, and the largest difference in the plane in mm; of the ball that differs most, the
differences of normal force, force centroid and depth, and the ratio of contact areas. The solids take some
minutes; solved ones are kept in the user's cache.

The rate is that of random presses of one to three balls on the demo sheet, 0.5 to 5 mm deep, in processor
time of one thread: best and median of several rounds.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from forward_error import CASES as SHEETS
from forward_error import SIZE_MM, YOUNG_MPA, solve_solid

import manytouch
from manytouch.blas_threads import limit_blas_threads
from manytouch.design.dimensions import light_lattice
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.loading import Loading, PressurePatch, press
from manytouch.simulation.fem.sheet import SheetModel
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.pad import rubber
from manytouch.simulation.solve_scene import states_folder
from manytouch.values import Sensor, Sheet

NEGLIGIBLE_N = 0.1  # contacts with less force are not compared
STEPS = 4  # from nothing to the final depth or force
PRESSES, ROUNDS = 60, 7


@dataclass(frozen=True, kw_only=True)
class Case:
    """Contacts on the demo sheet, in steps to their final depth or force."""

    name: str
    balls: tuple[manytouch.Ball, ...] = ()
    patches: tuple[manytouch.Patch, ...] = ()


def ball(x_mm: float, y_mm: float, depth_mm: float, radius_mm: float) -> manytouch.Ball:
    """A ball."""
    return manytouch.Ball(x_mm=x_mm, y_mm=y_mm, depth_mm=depth_mm, radius_mm=radius_mm)


CASES = (
    Case(name="demo, ball of 6 mm", balls=(ball(11.0, -7.0, 6.0, 6.0),)),
    Case(name="demo, ball of 4 mm", balls=(ball(-21.0, 9.0, 4.0, 4.0),)),
    Case(name="demo, ball of 3 mm", balls=(ball(3.0, 5.0, 2.0, 3.0),)),
    Case(name="demo, ball of 10 mm", balls=(ball(20.0, 4.0, 5.0, 10.0),)),
    Case(name="demo, two balls", balls=(ball(-9.0, 3.0, 4.0, 6.0), ball(9.0, -2.0, 3.0, 5.0))),
    Case(
        name="demo, three balls",
        balls=(ball(-30.0, 10.0, 3.0, 5.0), ball(0.0, -14.0, 5.0, 6.0), ball(26.0, 8.0, 2.0, 8.0)),
    ),
    Case(
        name="demo, two patches",
        patches=(
            manytouch.Patch(x_mm=-20.0, y_mm=6.0, force_N=(1.0, 0.0, -4.0), size_mm=(14.0, 10.0)),
            manytouch.Patch(x_mm=18.0, y_mm=-8.0, force_N=(0.0, -0.5, -2.0), size_mm=(8.0, 8.0)),
        ),
    ),
)
NAMES = [case.name for case in (*CASES, *SHEETS)]


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The simulated contacts compared with a solid; shares of the largest depth, of the solid, or mm."""

    peak_mm: float
    rms: float
    worst: float
    in_plane_mm: float
    force: float
    centre_mm: float
    depth: float
    area: float


def demo_states(case: Case, sheet: Sheet, states: StateCache) -> Iterator[tuple[Deformation, list]]:
    """Equilibria of the solid with the contacts that are to be simulated."""
    shares = np.arange(1, STEPS + 1) / STEPS
    touches = tuple(
        press(
            Sphere(radius_mm=each.radius_mm),
            thickness_mm=sheet.thickness_mm,
            path_mm=np.array([[each.x_mm, each.y_mm, each.depth_mm * share] for share in shares]),
        )
        for each in case.balls
    )
    patches = tuple(
        PressurePatch(
            centre_mm=(each.x_mm, each.y_mm),
            size_mm=each.size_mm,
            outline=each.outline,
            force_N=np.outer(shares, each.force_N),
        )
        for each in case.patches
    )
    loading = Loading(touches=touches, patches=patches)
    model = SheetModel(
        size_mm=(float(sheet.size_mm[0]), float(sheet.size_mm[1])),
        thickness_mm=sheet.thickness_mm,
        material=rubber(sheet),
        pretension_N_per_mm=sheet.pretension_N_per_mm or 0.0,
    )
    for share, state in zip(shares.tolist(), states.states(model, loading), strict=True):
        contacts: list = [replace(each, depth_mm=each.depth_mm * share) for each in case.balls]
        for each in case.patches:
            x_N, y_N, z_N = (share * force_N for force_N in each.force_N)
            contacts.append(replace(each, force_N=(x_N, y_N, z_N)))
        yield condense(state, loading), contacts


def equilibria(name: str, states: StateCache) -> tuple[Sensor, list[tuple[Deformation, list]]]:
    """The sensor of a case, and its equilibria with the contacts that are to be simulated."""
    demo = demo_sensor()
    for case in CASES:
        if case.name == name:
            assert demo.sheet is not None
            return demo, list(demo_states(case, demo.sheet, states))
    (case,) = (each for each in SHEETS if each.name == name)
    sheet = Sheet(
        size_mm=np.array(SIZE_MM),
        thickness_mm=case.thickness_mm,
        young_MPa=YOUNG_MPA,
        poisson=case.poisson,
        pretension_N_per_mm=case.pretension_N_per_mm,
    )
    sensor = replace(demo, name=name, layout=light_lattice(SIZE_MM, 4.0, 1.0, 0.0), sheet=sheet)
    solids = solve_solid(case, states)
    contacts = [[ball(*case.place_mm, depth_mm, case.radius_mm)] for depth_mm in case.depth_mm]
    return sensor, list(zip(solids, contacts, strict=True))


def compare(sensor: Sensor, solid: Deformation, contacts: list) -> Difference:
    """One equilibrium."""
    assert sensor.layout is not None
    reading = manytouch.simulate_contacts(sensor, contacts, output="reading")
    true_mm = solid.displacement_mm(np.ascontiguousarray(sensor.layout.rest_mm[:, :2]))
    off_mm, peak_mm = reading.surface.displacement_mm - true_mm, -float(true_mm[:, 2].min())
    found = {contact.id: contact for contact in reading.contacts.contacts}
    rows = [
        (
            -found[number].force_N[2] / true.normal_force_N - 1.0,
            float(np.linalg.norm(found[number].centre_mm - true.centre_mm)),
            found[number].depth_mm / true.depth_mm - 1.0,
            found[number].area_mm2 / true.area_mm2,
        )
        for number, true in enumerate(solid.contacts)
        if true.normal_force_N > NEGLIGIBLE_N
    ]
    worst = [max(column, key=abs) for column in zip(*rows, strict=True)] or [float("nan")] * 4
    return Difference(
        peak_mm=peak_mm,
        rms=float(np.sqrt(np.mean(off_mm[:, 2] ** 2))) / peak_mm,
        worst=float(np.abs(off_mm[:, 2]).max()) / peak_mm,
        in_plane_mm=float(np.abs(off_mm[:, :2]).max()),
        force=worst[0],
        centre_mm=worst[1],
        depth=worst[2],
        area=worst[3],
    )


def print_errors(names: list[str], states: StateCache) -> None:
    """A line per equilibrium, then median and worst values."""
    print(
        f"{'case':<22}{'peak mm':>9}{'RMS':>7}{'worst':>7}{'plane mm':>10}{'force':>8}{'centre mm':>11}"
        f"{'depth':>8}{'area':>6}"
    )
    groups: dict[str, list[Difference]] = {"away from the clamp": [], "near the clamp": []}
    for name in names:
        sensor, solids = equilibria(name, states)
        for solid, contacts in solids:
            each = compare(sensor, solid, contacts)
            groups["near the clamp" if "clamp" in name else "away from the clamp"].append(each)
            print(f"{name:<22}{each.peak_mm:9.2f}{_row(each)}", flush=True)
    for group, found in groups.items():
        if not found:
            continue
        for label, choose in (("median", np.nanmedian), ("worst", np.nanmax)):
            fields = [field for field in Difference.__dataclass_fields__ if field != "area"]
            values = {field: float(choose([abs(getattr(each, field)) for each in found])) for field in fields}
            values["area"] = float(np.nanmedian([each.area for each in found]))
            print(f"{group}, {label}:".ljust(31) + _row(Difference(**values)))


def _row(each: Difference) -> str:
    return (
        f"{each.rms:7.1%}{each.worst:7.1%}{each.in_plane_mm:10.3f}{each.force:+8.1%}{each.centre_mm:11.3f}"
        f"{each.depth:+8.1%}{each.area:6.2f}"
    )


def print_rate() -> None:
    """Marker fields, readings and images a second."""
    sensor, chance = demo_sensor(), np.random.default_rng(0)
    presses = [
        [
            ball(
                chance.uniform(-40.0, 40.0),
                chance.uniform(-25.0, 25.0),
                chance.uniform(0.5, 5.0),
                chance.uniform(4.0, 8.0),
            )
            for _ in range(chance.integers(1, 4))
        ]
        for _ in range(PRESSES)
    ]
    for output, count in (("markers", PRESSES), ("reading", 20), ("image", 4)):
        manytouch.simulate_contacts(sensor, presses[:1], output=output)
        seconds = []
        for _ in range(ROUNDS):
            start_s = time.process_time()
            manytouch.simulate_contacts(sensor, presses[:count], output=output)
            seconds.append((time.process_time() - start_s) / count)
        print(f"{output:<8}{1.0 / min(seconds):8.0f} /s at best, {1.0 / np.median(seconds):.0f} /s median")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--case", choices=NAMES, action="append", help="only this one; may be repeated")
    parser.add_argument("--states", type=Path, metavar="DIR", help="keep solved solids here")
    parser.add_argument("--rate-only", action="store_true", help="no solids")
    given = parser.parse_args()
    limit_blas_threads()
    print_rate()
    if not given.rate_only:
        print_errors(given.case or NAMES, StateCache(folder=given.states or states_folder()))


if __name__ == "__main__":
    main()
