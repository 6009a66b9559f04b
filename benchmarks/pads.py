"""How well contacts on pads that are bonded to a window are estimated, from points.

3-D solids with free sides are pressed by the bodies of the groups of pads of `evaluate`. The method
`mechanics` gets the true images of the markers with 0.02 px of noise and the true sensor file, which states
that outline, thickness, Poisson's ratio and Young's modulus are exact. With --wrong-file, Poisson's ratio is
.01 too large (but at most .495) and the thickness 4 % too small, and the deviations are the defaults of
sensor files. With --drawn, Poisson's ratio, thickness and depth of the markers have random errors with the
deviations of the nominal files from which `pads_calibrated` begins, without its calibration, and the file
states these deviations. With --linear, forces are those of the linear pad. Radial shear is that of the fit
over its normal force, negative towards the centre, as where an object sticks. A torque is printed where the
true one is 0.1 N mm or more. Each state is a new start from rest, or, with --path, follows the one before.
Cases that no constant was chosen on are left out unless --held-out is given. The solved presses are those of
the package.

    .venv/bin/python benchmarks/pads.py
    .venv/bin/python benchmarks/pads.py --wrong-file
    .venv/bin/python benchmarks/pads.py --only ball
"""

import argparse
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from manytouch.estimation.pad.contacts.pad_contacts import PadContacts
from manytouch.estimation.pad.estimator import PadEstimator
from manytouch.estimation.pad.patch_forces import RADIAL_SHEAR
from manytouch.estimation.pad.patches import Patches
from manytouch.evaluation.suite.calibrated.pad_sensor import drawn_pad
from manytouch.evaluation.suite.pads.cases import OwnPadCase, pads
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.evaluation.suite.pads.recording import pad_states
from manytouch.evaluation.suite.sensors import exact_sensor
from manytouch.geometry.refraction import rest_px
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Contact, Sensor, TrackedGrid

NOISE_PX, MATCH_MM, LEAST_NMM = 0.02, 3.0, 0.1


class Row(NamedTuple):
    """Errors of a contact, positive where the estimate is too large.

    Those of normal force and depth are in percent and in standard deviations, that of the centre is in mm,
    that of the shear (length of the difference) in percent of the true normal force.
    """

    force: float
    force_stds: float
    away_mm: float
    shear: float
    depth: float
    depth_stds: float


def sensor_of(case: OwnPadCase) -> Sensor:
    """The pad behind a window of 3 mm, in an image of 320 x 240 px with about 13 px per mm."""
    return true_pad(case, width_px=320, centre_noise_px=NOISE_PX)


def wrong(sensor: Sensor) -> Sensor:
    """The sensor with another Poisson's ratio and thickness."""
    assert sensor.sheet is not None
    assert sensor.sheet.poisson is not None
    poisson = min(sensor.sheet.poisson + 0.01, 0.495)
    return replace(
        sensor, sheet=replace(sensor.sheet, poisson=poisson, thickness_mm=0.96 * sensor.sheet.thickness_mm)
    )


def drawn(sensor: Sensor, case: OwnPadCase) -> Sensor:
    """The sensor with random errors of all numbers of the pad but Young's modulus, and their deviations."""
    sheet = drawn_pad(case).sheet
    assert sheet is not None
    return replace(sensor, sheet=replace(sheet, young_MPa=case.young_MPa, young_std_MPa=0.0))


def grid_of(position_px: np.ndarray, random: np.random.Generator) -> TrackedGrid:
    count = len(position_px)
    return TrackedGrid(
        position_px=position_px + random.normal(0.0, NOISE_PX, position_px.shape),
        covariance_px2=np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1)),
        is_seen=np.isfinite(position_px).all(axis=1),
        frames_unseen=np.zeros(count, dtype=np.int64),
    )


def images_px(sensor: Sensor, markers: Deformation) -> np.ndarray:
    """(m, 2) centroids of the images of the markers."""
    scene = SolidScene(name="press", time_s=np.array([0.0, 1.0]), states=(markers, markers), duration_s=1.0)
    return Simulator(sensor=sensor, scene=scene).truth(0).grid.position_px


def rows_of(
    case: OwnPadCase, level: float, state: Deformation, touching: tuple[Contact, ...], patches: Patches
) -> list[Row]:
    """Errors of the contacts of one state that were found, printed with their radial shear and returned."""
    unit, rows = "N" if not case.press.bodies else "mm", []
    for true in state.contacts:
        label = f"{case.name:25} {level:5.2f} {unit:2}{'' if case.looked_at else ' held out':9}"
        press_N = -float(true.force_N[2])
        near = [each for each in touching if np.linalg.norm(each.centre_mm - true.centre_mm) < MATCH_MM]
        if not near:
            print(f"{label}  not found, {press_N:.3f} N, contacts {len(touching)}")
            continue
        found = min(near, key=lambda each: float(np.linalg.norm(each.centre_mm - true.centre_mm)))
        shear_N = found.force_N[:2] - true.force_N[:2]
        row = Row(
            force=100.0 * (-found.force_N[2] / press_N - 1.0),
            force_stds=(-found.force_N[2] - press_N) / found.std("normal_force"),
            away_mm=float(np.linalg.norm(found.centre_mm - true.centre_mm)),
            shear=100.0 * float(np.linalg.norm(shear_N)) / press_N,
            depth=100.0 * (found.depth_mm / true.depth_mm - 1.0),
            depth_stds=(found.depth_mm - true.depth_mm) / found.std("depth"),
        )
        rows.append(row)
        nearest = np.linalg.norm(patches.parameters[:, :2] - found.centre_mm, axis=1).argmin()
        radial = patches.parameters[nearest, RADIAL_SHEAR]
        torque = f"torque {found.torque_Nmm:+.2f}, true {true.torque_Nmm:+.2f} N mm  "
        torque = torque if abs(true.torque_Nmm) >= LEAST_NMM else ""
        print(
            f"{label} {press_N:8.3f} N {row.force:+6.1f} % ({row.force_stds:+.1f} std)  "
            f"centre {row.away_mm:.2f} mm  shear off {row.shear:5.1f} %, true "
            f"{100.0 * np.linalg.norm(true.force_N[:2]) / press_N:3.0f} % of the force  "
            f"depth {row.depth:+6.1f} % ({row.depth_stds:+.1f} std)  "
            f"{torque}radial {radial:+.2f}  contacts {len(touching)}"
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument("--path", action="store_true", help="each depth follows the one before")
    parser.add_argument("--held-out", action="store_true", help="also cases that no constant was chosen on")
    parser.add_argument("--linear", action="store_true", help="forces without stiffening")
    file = parser.add_mutually_exclusive_group()
    file.add_argument("--wrong-file", action="store_true", help="wrong numbers, deviations not stated")
    file.add_argument("--drawn", action="store_true", help="random errors, deviations stated")
    options = parser.parse_args()
    estimate, random = PadEstimator(), np.random.default_rng(5)
    if options.linear:
        estimate = PadEstimator(pad_contacts=PadContacts(stiffening=0.0, sticking=0.0, sticking_power=0.0))
    rows: dict[bool, list[Row]] = {True: [], False: []}
    true_count = {True: 0, False: 0}
    for case in pads("pads"):
        if options.only not in case.name or not (case.looked_at or options.held_out):
            continue
        sensor = sensor_of(case)
        stated = drawn(sensor, case) if options.drawn else exact_sensor(sensor)
        given = wrong(sensor) if options.wrong_file else stated
        assert given.layout is not None
        # markers at rest are measured, whatever the file states
        offset_px = rest_px(given, given.layout) - rest_px(sensor, given.layout)
        now = started = estimate.start(given)
        for level, (markers, _) in zip(case.press.levels, pad_states(case), strict=True):
            before, position_px = now if options.path else started, images_px(sensor, markers) + offset_px
            for _ in range(2):
                before, _, contacts = estimate.step(before, grid_of(position_px, random))
            now = before
            true_count[case.looked_at] += len(markers.contacts)
            rows[case.looked_at] += rows_of(case, level, markers, contacts.touching, before.patches)
    for looked_at, part in rows.items():
        if part:
            force, depth = (np.array([getattr(row, name) for row in part]) for name in ("force", "depth"))
            stds = np.array([[row.force_stds, row.depth_stds] for row in part])
            median, p95 = np.percentile(np.abs(force), [50.0, 95.0])
            print(
                f"{'others' if looked_at else 'held out':10} "
                f"{len(part)} of {true_count[looked_at]} contacts found: "
                f"force median {median:.1f} % p95 {p95:.1f} % bias {force.mean():+.1f} %, "
                f"centre {np.median([row.away_mm for row in part]):.2f} mm, "
                f"shear {np.median([row.shear for row in part]):.1f} % of the force, "
                f"depth {np.nanmedian(np.abs(depth)):.1f} %, beyond 2 std: "
                f"force {(np.abs(stds[:, 0]) > 2.0).sum()}, depth {(np.abs(stds[:, 1]) > 2.0).sum()}"
            )


if __name__ == "__main__":
    main()
