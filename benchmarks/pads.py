"""How well contacts on pads that are bonded to a window are estimated, from points.

3-D solids with free sides are pressed by balls, a lying cylinder, flat punches and an edge, at several
depths, in the middle and near a side, with and without friction. The method `mechanics` gets the true images
of the markers with 0.02 px of noise and the true sensor file, which states no deviations; with --wrong-file,
Poisson's ratio is .01 too large (but at most .495) and the thickness 4 % too small. Each depth is a new start
from rest, or, with --path, follows the one before. Cases marked "held out" were not used to choose constants.

    .venv/bin/python benchmarks/pads.py            # solves the solids once: about half an hour
    .venv/bin/python benchmarks/pads.py --wrong-file
    .venv/bin/python benchmarks/pads.py --only ball
"""

import argparse
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from manytouch.estimation.pad.estimator import PadEstimator
from manytouch.evaluation.suite.pads import pad_sensor
from manytouch.simulation.fem.contact.indenters import (
    Indenter,
    LyingCylinder,
    RoundPunch,
    Sphere,
    SquarePunch,
)
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.pad_presses import PressedPad, solve_pad
from manytouch.values import Contact, Sensor, TrackedGrid

NOISE_PX = 0.02
DEPTHS_MM = (0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Pad:
    """Size, thickness, material and lattice of a pad; see `manytouch.values.Sheet`."""

    size_mm: tuple[float, float]
    thickness_mm: float
    young_MPa: float
    poisson: float
    marker_depth_mm: float
    rows: int = 7
    columns: int = 9
    pitch_mm: float = 2.0


@dataclass(frozen=True)
class Case:
    """A body, where it presses, and the pad."""

    name: str
    pad: Pad
    body: Indenter
    place_mm: tuple[float, float]
    friction: float = 0.0
    depths_mm: tuple[float, ...] = (0.3, 0.5, 1.0)
    turn_deg: float = 0.0
    held_out: bool = False


GEL = Pad((25.0, 21.0), 4.0, 0.3, 0.48, 0.5)
THIN = Pad((20.0, 20.0), 2.5, 0.4, 0.49, 0.3, pitch_mm=1.9)
SOFT = Pad((25.0, 21.0), 4.0, 0.2, 0.45, 0.3)
DEEP = Pad((25.0, 21.0), 4.0, 0.4, 0.49, 1.0)
CASES = (
    Case("ball 3 mm", GEL, Sphere(radius_mm=3.0), (0.0, 0.0)),
    Case(
        "flat punch 3 mm",
        GEL,
        RoundPunch(radius_mm=3.0, edge_radius_mm=0.3),
        (-2.0, 1.5),
        0.0,
        (0.1, 0.3, 0.5),
    ),
    Case("ball 5 mm, thin pad", THIN, Sphere(radius_mm=5.0), (0.7, 0.4)),
    Case("ball 5 mm near a side", GEL, Sphere(radius_mm=5.0), (9.5, 0.0)),
    Case("ball 5 mm, sticking", GEL, Sphere(radius_mm=5.0), (2.3, -1.2), 1.0),
    Case("edge", GEL, SquarePunch(side_mm=(8.0, 1.0), edge_radius_mm=0.3), (0.0, 1.0), turn_deg=70.0),
    Case(
        "flat punch 3 mm, sticking",
        THIN,
        RoundPunch(radius_mm=3.0, edge_radius_mm=0.3),
        (0.0, 0.0),
        1.0,
        (0.1, 0.3, 0.5),
    ),
    Case(
        "lying cylinder",
        SOFT,
        LyingCylinder(radius_mm=3.0, length_mm=8.0, edge_radius_mm=0.5),
        (1.0, -1.0),
        turn_deg=25.0,
        held_out=True,
    ),
    Case("ball 8 mm, deep markers", DEEP, Sphere(radius_mm=8.0), (0.0, -1.0), held_out=True),
    Case(
        "square 5 mm",
        GEL,
        SquarePunch(side_mm=(5.0, 5.0), edge_radius_mm=0.3),
        (1.0, 1.0),
        0.0,
        (0.1, 0.3, 0.5),
        20.0,
        True,
    ),
)


def sensor_of(pad: Pad) -> Sensor:
    """The pad behind a window of 3 mm, in an image of 320 x 240 px with about 13 px per mm."""
    return pad_sensor("pad", **asdict(pad), width_px=320, centre_noise_px=NOISE_PX)


def wrong(sensor: Sensor) -> Sensor:
    """The sensor with another Poisson's ratio and thickness."""
    assert sensor.sheet is not None
    assert sensor.sheet.poisson is not None
    poisson = min(sensor.sheet.poisson + 0.01, 0.495)
    return replace(
        sensor, sheet=replace(sensor.sheet, poisson=poisson, thickness_mm=0.96 * sensor.sheet.thickness_mm)
    )


def grid_of(position_px: np.ndarray, random: np.random.Generator) -> TrackedGrid:
    count = len(position_px)
    return TrackedGrid(
        position_px=position_px + random.normal(0.0, NOISE_PX, position_px.shape),
        covariance_px2=np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1)),
        is_seen=np.isfinite(position_px).all(axis=1),
        frames_unseen=np.zeros(count, dtype=np.int64),
    )


def states(case: Case, sensor: Sensor, folder: Path | None) -> Iterator[tuple[float, PressedPad]]:
    """The depths of a case and the solved pads."""
    path = sorted({*case.depths_mm, *(d for d in DEPTHS_MM if d <= max(case.depths_mm))})
    touch = press(
        case.body,
        thickness_mm=case.pad.thickness_mm,
        path_mm=np.array([[*case.place_mm, depth_mm] for depth_mm in path]),
        friction=case.friction,
        yaw_rad=np.full(len(path), np.deg2rad(case.turn_deg)),
    )
    solved = solve_pad(sensor, Loading(touches=(touch,)), folder=folder)
    for depth_mm, state in zip(path, solved, strict=True):
        if depth_mm in case.depths_mm:
            yield depth_mm, state


def row(case: Case, depth_mm: float, state: PressedPad, touching: tuple[Contact, ...]) -> list[float]:
    """Errors of one state, printed and returned; [] where no contact was found."""
    true, mark = state.contacts[0], " held out" if case.held_out else ""
    label = f"{case.name:25} {depth_mm:5.2f} mm{mark:9}"
    if not touching:
        print(f"{label}  not found, {-true.force_N[2]:.3f} N")
        return []
    found = min(touching, key=lambda each: float(np.linalg.norm(each.centre_mm - true.centre_mm)))
    press_N = -float(true.force_N[2])
    force = 100.0 * (-found.force_N[2] / press_N - 1.0)
    away_mm = float(np.linalg.norm(found.centre_mm - true.centre_mm))
    shear = 100.0 * float(np.linalg.norm(found.force_N[:2] - true.force_N[:2])) / press_N
    deviations = (-found.force_N[2] - press_N) / found.std("normal_force")
    depth = 100.0 * (found.depth_mm / true.depth_mm - 1.0)
    print(
        f"{label} {press_N:8.3f} N {force:+6.1f} % ({deviations:+.1f} std)  centre {away_mm:.2f} mm  "
        f"shear {shear:4.1f} %  depth {depth:+6.1f} %  contacts {len(touching)}"
    )
    depth_stds = (found.depth_mm - true.depth_mm) / found.std("depth")
    return [abs(force), force, away_mm, shear, abs(depth), abs(deviations), abs(depth_stds)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument("--path", action="store_true", help="each depth follows the one before")
    parser.add_argument("--wrong-file", action="store_true", help="the sensor file is not exact")
    parser.add_argument("--keep", type=Path, help="folder of solved states; default: the user's cache")
    options = parser.parse_args()
    estimate, random = PadEstimator(), np.random.default_rng(5)
    rows: dict[bool, list[list[float]]] = {False: [], True: []}
    for case in CASES:
        if options.only not in case.name:
            continue
        sensor = sensor_of(case.pad)
        now = started = estimate.start(wrong(sensor) if options.wrong_file else sensor)
        for depth_mm, solved in states(case, sensor, options.keep):
            before = now if options.path else started
            for _ in range(2):
                before, _, contacts = estimate.step(before, grid_of(solved.marker_px, random))
            now = before
            found = row(case, depth_mm, solved, contacts.touching)
            if found:
                rows[case.held_out].append(found)
    for held_out, part in rows.items():
        if part:
            table = np.array(part)
            force = np.percentile(table[:, 0], [50.0, 95.0])
            print(
                f"{'held out' if held_out else 'others':10} {len(part)} states: "
                f"force median {force[0]:.1f} % "
                f"p95 {force[1]:.1f} % bias {table[:, 1].mean():+.1f} %, "
                f"centre {np.median(table[:, 2]):.2f} mm, "
                f"shear {np.median(table[:, 3]):.1f} %, depth {np.median(table[:, 4]):.1f} %, beyond 2 std: "
                f"force {(table[:, 5] > 2.0).sum()}, depth {(table[:, 6] > 2.0).sum()}"
            )


if __name__ == "__main__":
    main()
