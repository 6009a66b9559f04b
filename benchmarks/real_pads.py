"""Dead weights on a real pad: forces of `mechanics` on the data set UM-FingerVision, next to a regression.

DATA contains labels.csv and images/ of github.com/mpatankar/UM-FingerVision (fv_ros_standalone/calib):
weights that stand on the whole pad through a flat panel, straight and on tilted blocks, ten images each. The
images are not part of this repository. The pad is that of `--sensor fingervision-um`, its pose is measured at
rest. Young's modulus is fitted to two straight cases (the lightest from 5 N on, and the heaviest); the others
are predicted. Ten images of a case count as one measurement.

    .venv/bin/python benchmarks/real_pads.py ../shared/data/um_fingervision --out out/real-pads
"""

import argparse
import csv
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from plate_load import (
    GROWTH,
    NOISE_PX,
    SHIFT_PX,
    PlateForces,
    changed_pads,
    plate_forces,
    plate_model,
    young_MPa,
)

from manytouch.calibration.marker_tracks import track_markers
from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.rest.rest_report import describe
from manytouch.estimation.pad.estimator import PadEstimator
from manytouch.estimation.pad.patch_fit import PatchFitter
from manytouch.values import Frame, Sensor, TrackedGrid
from manytouch.values.sensor_file.read import load_sensor

DEFAULT = Path(__file__).parents[1] / "../shared/data/um_fingervision"
SENSOR = "fingervision-um"
NORMAL_FROM_N, SHEAR_FROM_N = 5.0, 1.5
INTERVAL = 1.96


@dataclass(frozen=True)
class Case:
    """A load: its name, tilt of the block, true force (shear x, y, normal) and images."""

    name: str
    tilt_deg: tuple[float, float]
    force_N: np.ndarray
    images: tuple[Path, ...]

    @property
    def is_straight(self) -> bool:
        """Whether the pad lies flat."""
        return self.tilt_deg == (0.0, 0.0)


def read_cases(folder: Path) -> list[Case]:
    """The cases of labels.csv, the unloaded one first."""
    groups: dict[tuple[float, float, float], list[dict[str, str]]] = {}
    with (folder / "labels.csv").open(encoding="utf-8", newline="") as table:
        for row in csv.DictReader(table):
            key = (float(row["mass_g"]), float(row["theta_x_deg"]), float(row["theta_z_deg"]))
            groups.setdefault(key, []).append(row)
    found = []
    for (mass_g, x_deg, z_deg), rows in sorted(groups.items()):
        force_N = np.array([float(rows[0][name]) for name in ("shear_x_N", "shear_z_N", "normal_N")])
        images = tuple(folder / row["file"] for row in rows)
        found.append(Case(f"{mass_g:6.1f} g {x_deg:+3.0f} {z_deg:+3.0f}", (x_deg, z_deg), force_N, images))
    return found


def read_frames(images: tuple[Path, ...], start: int = 0) -> list[Frame]:
    return [
        Frame(index=number, timestamp_ns=number * 33_000_000, camera="images", image=cv2.imread(str(path)))
        for number, path in enumerate(images, start)
    ]


def measure(sensor: Sensor, rest: list[Frame], cases: list[Case]) -> np.ndarray:
    """(n, m, 2) mean displacements of the markers from the unloaded case; NaN where not seen."""
    registered = register_rest(sensor, rest)
    moved = []
    for case in cases:
        seen = track_markers(registered, [*rest, *read_frames(case.images, len(rest))])
        is_rest = np.arange(len(seen.timestamp_ns)) < len(rest)
        moved.append(seen.median_px(~is_rest) - seen.median_px(is_rest))
    return np.array(moved)


def regression(moved_px: np.ndarray, rest_px: np.ndarray, force_N: np.ndarray) -> np.ndarray:
    """(n, 3) forces by linear regression on mean shift and mean divergence, each from all other cases."""
    away = rest_px - rest_px.mean(axis=0)
    features = []
    for moved in moved_px:
        seen = np.isfinite(moved).all(axis=1)
        slope, *_ = np.linalg.lstsq(
            np.column_stack([away[seen], np.ones(seen.sum())]), moved[seen], rcond=None
        )
        features.append([*np.nanmean(moved, axis=0), slope[0, 0] + slope[1, 1], 1.0])
    table = np.array(features)
    found = np.empty_like(force_N)
    for case in range(len(table)):
        others = np.arange(len(table)) != case
        found[case] = table[case] @ np.linalg.lstsq(table[others], force_N[others], rcond=None)[0]
    return found


def by_contacts(sensor: Sensor, moved_px: np.ndarray, rest_px: np.ndarray) -> np.ndarray:
    """(n, 2) normal force of all contacts that the method finds if no plate is known, and its deviation."""
    motion = PatchFitter(shift_px=SHIFT_PX, growth=GROWTH, turn_rad=GROWTH)
    estimator, found = PadEstimator(fitter=motion), []
    layout = sensor.layout
    assert layout is not None
    state = estimator.start(replace(sensor, layout=replace(layout, rest_px=rest_px)))
    for moved in moved_px:
        seen = np.isfinite(moved).all(axis=1)
        grid = TrackedGrid(
            position_px=np.where(seen[:, None], rest_px + moved, np.nan),
            covariance_px2=np.where(seen[:, None, None], NOISE_PX**2 * np.eye(2), np.nan),
            is_seen=seen,
            frames_unseen=np.where(seen, 0, 1).astype(np.int64),
        )
        _, _, contacts = estimator.step(state, grid)
        total = -sum(contact.force_N[2] for contact in contacts.touching)
        found.append([total, np.sqrt(sum(contact.std("normal_force") ** 2 for contact in contacts.touching))])
    return np.array(found, dtype=np.float64)


@dataclass(frozen=True)
class Prediction:
    """Forces (n, 3) and deviations (n, 3) of all cases, N; the modulus and its relative deviation."""

    force_N: np.ndarray
    std_N: np.ndarray
    young_MPa: float
    young_share: float
    plain: PlateForces


def predict(sensor: Sensor, moved_px: np.ndarray, fitted: list[int], force_N: np.ndarray) -> Prediction:
    """The plate on the pad; deviations contain noise, mounting, the modulus and the nominal numbers."""
    plain = plate_forces(plate_model(sensor), moved_px)
    young, share = young_MPa(plain, fitted, force_N[:, 2])
    found_N = young * plain.force
    variance = young**2 * np.diagonal(plain.covariance, axis1=1, axis2=2) + (share * found_N) ** 2
    for changed in changed_pads(sensor):
        other = plate_forces(plate_model(changed), moved_px)
        variance += (young_MPa(other, fitted, force_N[:, 2])[0] * other.force - found_N) ** 2
    return Prediction(found_N, np.sqrt(variance), young, share, plain)


def shear_errors(found_N: np.ndarray, true_N: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles in degrees and relative errors of the amount."""
    found, true = (force[:, 0] + 1j * force[:, 1] for force in (found_N, true_N))
    return np.degrees(np.abs(np.angle(found / true))), np.abs(np.abs(found) / np.abs(true) - 1.0)


def summary(label: str, found_N: np.ndarray, true_N: np.ndarray) -> str:
    """One line of figures."""
    normal = true_N[:, 2] >= NORMAL_FROM_N
    shear = np.hypot(true_N[:, 0], true_N[:, 1]) >= SHEAR_FROM_N
    relative = 100.0 * np.abs(found_N[normal, 2] / true_N[normal, 2] - 1.0)
    angle, amount = shear_errors(found_N[shear], true_N[shear])
    return (
        f"{label:38} normal r {np.corrcoef(found_N[:, 2], true_N[:, 2])[0, 1]:.3f}, "
        f"median {np.median(relative):.0f} % from {NORMAL_FROM_N:g} N on; "
        f"shear {np.median(angle):.1f} deg, {100 * np.median(amount):.0f} % from {SHEAR_FROM_N:g} N on"
    )


def print_limits(cases: list[Case], found: Prediction, used: list[int]) -> None:
    """What mounting again costs: with and without it, and what a common motion of the view changes."""
    at = {(case.tilt_deg, round(float(np.linalg.norm(case.force_N)), 1)): i for i, case in enumerate(cases)}
    pairs = [
        (low, high)
        for (tilt, light), low in at.items()
        for (other, heavy), high in at.items()
        if tilt == other and heavy - light > NORMAL_FROM_N and low in used and high in used and tilt != (0, 0)
    ]
    if pairs:
        low, high = (list(side) for side in zip(*pairs, strict=True))
        true = np.array([cases[b].force_N - cases[a].force_N for a, b in pairs])
        print(summary("differences at the same tilt", found.force_N[high] - found.force_N[low], true))
    normal = found.young_MPa * np.sqrt(found.plain.covariance[used, 2, 2])
    print(
        f"deviation of the normal force by noise and mounting: median {np.median(normal):.2f} N; with the"
        f" modulus ({100 * found.young_share:.0f} %) and the nominal pad"
        f" {np.median(found.std_N[used, 2]):.2f} N"
    )


def print_mounting(moved_px: np.ndarray, rest_px: np.ndarray, cases: list[Case]) -> None:
    """Forces that a motion of the view by its deviation looks like, by the measured mean growth and shift."""
    away = (rest_px - rest_px.mean(axis=0)).ravel()
    force_N = np.array([case.force_N for case in cases])
    straight = np.array([case.is_straight for case in cases])
    flat = np.nan_to_num(moved_px).reshape(len(cases), -1)
    growth, shift_px = flat @ away / (away @ away), np.nanmean(moved_px, axis=1)

    def per_N(value: np.ndarray, force: np.ndarray) -> float:
        return float(value @ force / (force @ force))

    growth_per_N = per_N(growth[straight], force_N[straight, 2])
    along = [per_N(shift_px[~straight, axis], force_N[~straight, axis]) for axis in (0, 1)]
    print(
        f"a view that grows by {100 * GROWTH:g} % looks like {GROWTH / growth_per_N:.2f} N of normal force, "
        f"one that shifts by {SHIFT_PX:g} px like {SHIFT_PX / along[0]:.2f} N of shear along x and "
        f"{SHIFT_PX / along[1]:.2f} N along y"
    )


def draw(cases: list[Case], found: Prediction, used: list[int], fitted: list[int], path: Path) -> None:
    """Estimated against true normal force and shear, with intervals of two deviations."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    true_N = np.array([case.force_N for case in cases])
    figure, axes = plt.subplots(1, 3, figsize=(13.0, 4.4), constrained_layout=True)
    titles = ("shear x", "shear y", "normal force")
    for axis, column, title in zip(axes, (0, 1, 2), titles, strict=True):
        for rows, colour, label in ((used, "#1f5fa8", "predicted"), (fitted, "#c0392b", "fitted")):
            axis.errorbar(
                true_N[rows, column],
                found.force_N[rows, column],
                2.0 * found.std_N[rows, column],
                fmt="o",
                color=colour,
                markersize=4,
                elinewidth=1,
                label=label,
            )
        ends = np.array([true_N[:, column].min(), true_N[:, column].max()])
        axis.plot(ends, ends, color="0.6", zorder=0)
        axis.set(title=title, xlabel="weight, N", ylabel="estimated, N (± 2 std)")
    axes[2].legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", nargs="?", type=Path, default=DEFAULT, help="folder with labels.csv")
    parser.add_argument("--out", type=Path, default=Path("out/real-pads"), help="folder of the plot")
    parser.add_argument(
        "--contacts", action="store_true", help="also without knowing of a plate: free contacts (20 s)"
    )
    options = parser.parse_args()
    if not (options.data / "labels.csv").is_file():
        print(
            f"real_pads: {options.data} has no labels.csv: give the folder with labels.csv and images/ of "
            "UM-FingerVision (docs/how-to.md, public data sets)",
            file=sys.stderr,
        )
        return 1
    cases = read_cases(options.data)
    unloaded, loaded = cases[0], cases[1:]
    rest = read_frames(unloaded.images)
    calibrated = calibrate_rest(load_sensor(SENSOR), rest)
    print(*(f"  {line}" for line in describe(calibrated)), sep="\n")
    sensor = calibrated.sensor
    assert sensor.layout is not None
    assert sensor.layout.rest_px is not None
    rest_px = sensor.layout.rest_px
    moved_px = measure(sensor, rest, loaded)
    true_N = np.array([case.force_N for case in loaded])
    straight = sorted(
        (case.force_N[2], number)
        for number, case in enumerate(loaded)
        if case.is_straight and case.force_N[2] >= NORMAL_FROM_N
    )
    fitted = [straight[0][1], straight[-1][1]]
    used = [number for number in range(len(loaded)) if number not in fitted]
    found = predict(sensor, moved_px, fitted, true_N)
    base_N = regression(
        np.concatenate([np.zeros((1, *moved_px.shape[1:])), moved_px]),
        rest_px,
        np.vstack([unloaded.force_N, true_N]),
    )[1:]
    print(f"Young's modulus {found.young_MPa:.4f} MPa ± {100 * found.young_share:.0f} % from 2 cases\n")
    print(
        "case                normal N: true  found    std  regression | shear x, y: true    found       std"
    )
    for number, case in enumerate(loaded):
        (x, y, z), (fx, fy, fz), std = case.force_N, found.force_N[number], found.std_N[number]
        mark = " fitted" if number in fitted else ""
        print(
            f"{case.name}    {z:9.2f} {fz:6.2f} {std[2]:6.2f} {base_N[number, 2]:11.2f} | "
            f"{x:+6.2f} {y:+6.2f}  {fx:+6.2f} {fy:+6.2f}  {std[0]:5.2f} {std[1]:5.2f}{mark}"
        )
    print()
    print(summary("plate on the pad, predicted", found.force_N[used], true_N[used]))
    print(summary("regression, leave one case out", base_N[used], true_N[used]))
    inside = np.abs(found.force_N - true_N)[used] <= INTERVAL * found.std_N[used]
    print(
        f"95 % intervals contain {100 * inside[:, 2].mean():.0f} % of the normal forces, "
        f"{100 * inside[:, :2].mean():.0f} % of the shear forces"
    )
    print_limits(loaded, found, used)
    print_mounting(moved_px, rest_px, loaded)
    if options.contacts:
        assert sensor.sheet is not None
        sheet = replace(
            sensor.sheet, young_MPa=found.young_MPa, young_std_MPa=found.young_share * found.young_MPa
        )
        free = by_contacts(replace(sensor, sheet=sheet), moved_px, rest_px)[used]
        inside_free = np.abs(free[:, 0] - true_N[used, 2]) <= INTERVAL * free[:, 1]
        correlation = np.corrcoef(free[:, 0], true_N[used, 2])[0, 1]
        print(
            f"free contacts instead of a plate: normal r {correlation:.3f}, 95 % intervals contain "
            f"{100 * inside_free.mean():.0f} %, median deviation "
            f"{100 * np.median(free[:, 1] / true_N[used, 2]):.0f} % of the force"
        )
    draw(loaded, found, used, fitted, options.out / "forces.png")
    print(f"plot in {options.out / 'forces.png'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
