"""Errors on sensors and scenes that are drawn from a seed, and that no choice was made on.

    python benchmarks/random_scenes.py --out DIR [--first 0] [--scenes 6] [--pads] [--moving] [--drawn]
                                             [--long] [--layouts]

Each scene has a sensor of its own (size, thickness, modulus, pretension or depth of the markers, pitch,
light or dark dots, lens, camera, noise, missing dots, dust) and one to three bodies of five shapes, some
with friction, that begin and end at different times; with `--moving` up to five bodies on larger sheets,
which press deeper, and of which some slide, roll or turn (`moving_scenes`). With `--pads --moving` they
move on pads, many of them lightly. `--long` and `--layouts` are scenes as with `--moving`: with cylinders
and bars of 12 to 45 mm, and with markers that are not a square lattice over the whole sheet
(`marker_layouts`). Contacts less than 0.3 mm deep are not in the usual figures: those of all contacts are
printed too, in frames with 0.3 of their largest force or more. The commands `simulate` and `process` are
run as users run them, with the exact sensor file, or with `--drawn` with one that has the errors of a
careful user; what they write into DIR stays there. Scene number n is the same on every machine. Some lines
for each scene are printed, then the figures of all.
"""

import argparse
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from marker_layouts import with_layout
from moving_scenes import PAD_SEED as MOVING_PAD_SEED
from moving_scenes import SECONDS as MOVING_SECONDS
from moving_scenes import SEED as MOVING_SEED
from moving_scenes import moving_bodies, moving_pad_bodies, pad_sensor_with_errors, sensor_with_errors

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording
from manytouch.evaluation.evaluated_recordings.folders import load_result, load_truth
from manytouch.evaluation.metrics.comparison import MethodErrors, compare, figures, pooled
from manytouch.evaluation.metrics.matching import GATE_MM, assigned

FPS = 15.0
SECONDS = 2.4
PAD_SEED, SHEET_SEED = 5000, 900
LEAST_SHARE = 0.3
"""Share of the largest force of a contact from which on its frames are counted."""


def body_shape(draw: np.random.Generator, radius_mm: float, *, is_pad: bool) -> dict[str, Any]:
    """A ball, fingertip, punch or lying cylinder of about this radius."""
    narrower = 0.5 if is_pad else 0.7
    shapes: tuple[dict[str, Any], ...] = (
        {"kind": "sphere", "radius_mm": radius_mm},
        {"kind": "fingertip", "semi_axes_mm": [radius_mm + 1.0, radius_mm + 2.0, radius_mm + 1.0]},
        {"kind": "round_punch", "radius_mm": narrower * radius_mm},
        {"kind": "square_punch", "side_mm": [2.0 * narrower * radius_mm, 1.6 * narrower * radius_mm]},
        {"kind": "cylinder", "radius_mm": narrower * radius_mm, "length_mm": 3.0 * narrower * radius_mm},
    )
    return shapes[int(draw.integers(len(shapes)))]


def camera_of(draw: np.random.Generator, size_mm: np.ndarray) -> dict[str, Any]:
    """A camera in whose picture the sheet or pad is nearly as large as possible."""
    width = int(draw.choice([640, 800, 1280]))
    height = 3 * width // 4
    distance_mm = float(draw.uniform(1.0, 1.6) * size_mm.max())
    focal_px = 0.87 * float(np.min(np.array([width, height]) / size_mm)) * distance_mm
    return {
        "width_px": width,
        "height_px": height,
        "fx_px": focal_px,
        "fy_px": focal_px,
        "cx_px": 0.5 * width - 0.5 + float(draw.uniform(-6.0, 6.0)),
        "cy_px": 0.5 * height - 0.5 + float(draw.uniform(-6.0, 6.0)),
        "distortion": [float(draw.uniform(-0.2, 0.08)), 0.0, 0.0, 0.0, 0.0],
        "pose": {"translation_mm": [0.0, 0.0, distance_mm]},
    }


def sheet_sensor(draw: np.random.Generator, name: str) -> dict[str, Any]:
    """A clamped sheet of 34 to 80 mm, slack or taut."""
    thickness_mm, pitch_mm = float(draw.uniform(1.5, 4.0)), float(draw.uniform(2.0, 4.5))
    count = np.maximum(draw.integers([9, 8], [17, 14]), int(np.ceil(34.0 / pitch_mm)))
    return clamped_sensor(
        draw, name, count, pitch_mm, thickness_mm=thickness_mm, most_stretch=0.02, least_poisson=0.4
    )


def moving_sensor(draw: np.random.Generator, name: str) -> dict[str, Any]:
    """A clamped sheet of 55 to 140 mm and 1.5 to 6 mm, slack or taut."""
    thickness_mm = float(np.exp(draw.uniform(np.log(1.5), np.log(6.0))))
    length_mm, aspect = float(draw.uniform(55.0, 140.0)), float(draw.uniform(0.6, 1.0))
    pitch_mm = float(draw.uniform(max(2.0, length_mm / 36.0), min(8.0, length_mm / 12.0)))
    count = np.maximum(np.round(np.array([length_mm, length_mm * aspect]) / pitch_mm - 1.0).astype(int), 8)
    return clamped_sensor(
        draw, name, count, pitch_mm, thickness_mm=thickness_mm, most_stretch=0.03, least_poisson=0.3
    )


def clamped_sensor(
    draw: np.random.Generator,
    name: str,
    count: np.ndarray,
    pitch_mm: float,
    *,
    thickness_mm: float,
    most_stretch: float,
    least_poisson: float,
) -> dict[str, Any]:
    """A clamped sheet with an edge of one pitch and E of 0.2 to 3.2 MPa; every second one is slack."""
    size_mm = (count + 1) * pitch_mm
    young_MPa = float(10.0 ** draw.uniform(-0.7, 0.5))
    stretch = float(draw.choice([0.0, draw.uniform(0.0, most_stretch)]))
    return {
        "schema": 1,
        "name": name,
        "camera": camera_of(draw, size_mm),
        "sheet": {
            "size_mm": size_mm.tolist(),
            "thickness_mm": thickness_mm,
            "young_MPa": young_MPa,
            "poisson": float(draw.uniform(least_poisson, 0.49)),
            "pretension_N_per_mm": 2.0 * stretch * young_MPa * thickness_mm,
        },
        "markers": markers_of(draw, count, pitch_mm),
    }


def pad_sensor(draw: np.random.Generator, name: str) -> dict[str, Any]:
    """A bonded pad of 14 to 34 mm, with or without refraction by its window."""
    size_mm = np.sort(draw.uniform(14.0, 34.0, 2))[::-1]
    pitch_mm = float(draw.uniform(1.2, 3.0))
    count = (size_mm / pitch_mm - 0.6).astype(int)
    while np.prod(count) < 40:
        pitch_mm *= 0.85
        count = (size_mm / pitch_mm - 0.6).astype(int)
    window = {"pad_index": 1.41, "window_mm": 3.0, "window_index": 1.49} if draw.random() < 0.5 else {}
    return {
        "schema": 1,
        "name": name,
        "camera": camera_of(draw, size_mm),
        "sheet": {
            "boundary": "bonded",
            "size_mm": size_mm.tolist(),
            "thickness_mm": float(draw.uniform(2.0, 5.0)),
            "young_MPa": float(10.0 ** draw.uniform(-1.0, -0.2)),
            "poisson": float(draw.uniform(0.45, 0.492)),
            "marker_depth_mm": float(draw.uniform(0.1, 0.5)),
            **window,
        },
        "markers": markers_of(draw, count, pitch_mm),
    }


def markers_of(draw: np.random.Generator, count: np.ndarray, pitch_mm: float) -> dict[str, Any]:
    """A square lattice of light or dark dots."""
    return {
        "columns": int(count[0]),
        "rows": int(count[1]),
        "pitch_mm": pitch_mm,
        "radius_mm": float(pitch_mm * draw.uniform(0.18, 0.3)),
        "polarity": str(draw.choice(["light", "dark"])),
    }


def still_bodies(draw: np.random.Generator, sensor: dict[str, Any], *, is_pad: bool) -> list[dict[str, Any]]:
    """One to three bodies on a sensor, at least three thicknesses or 14 mm apart."""
    size_mm, thickness_mm = np.array(sensor["sheet"]["size_mm"]), float(sensor["sheet"]["thickness_mm"])
    room_mm = np.maximum(0.5 * size_mm - (2.5 + 0.4 * thickness_mm if is_pad else 8.0 + thickness_mm), 0.5)
    apart_mm = 3.0 * thickness_mm if is_pad else 14.0
    wanted, place_mm = int(draw.integers(1, 4)), np.zeros((0, 2))
    for _ in range(80):
        tried = draw.uniform(-room_mm, room_mm)
        if len(place_mm) < wanted and np.all(np.linalg.norm(place_mm - tried, axis=1) > apart_mm):
            place_mm = np.vstack([place_mm, tried])
    bodies = []
    for at_mm in place_mm:
        shape = body_shape(draw, float(draw.uniform(1.5 if is_pad else 2.5, 6.0)), is_pad=is_pad)
        share = draw.uniform(0.04, 0.25) if is_pad else draw.uniform(0.2, 0.8)
        start_s = float(draw.uniform(0.3, 1.0))
        motion = {
            "kind": "press",
            "at_mm": at_mm.tolist(),
            "depth_mm": float(share * thickness_mm) * (0.5 if is_pad and "punch" in shape["kind"] else 1.0),
            "start_s": start_s,
            "end_s": start_s + 1.0,
            "ramp_s": 0.3,
        }
        bodies.append({"shape": shape, "friction": float(draw.choice([0.0, 0.0, 1.0])), "motions": [motion]})
    return bodies


def scene_of(
    draw: np.random.Generator,
    name: str,
    sensor: dict[str, Any],
    bodies: list[dict[str, Any]],
    *,
    seconds: float,
    solid: dict[str, float],
) -> dict[str, Any]:
    """A scene of these bodies, in light and with faults that are sampled at random."""
    is_dark = sensor["markers"]["polarity"] == "dark"
    return {
        "schema": 1,
        "name": name,
        "seconds": seconds,
        "fps": FPS,
        "seed": int(draw.integers(2**31)),
        "sensor": "sensor.toml",
        "solid": solid,
        "light": {
            "ground": 190.0 if is_dark else 40.0,
            "dot": 50.0 if is_dark else 200.0,
            "read_noise": 1.5,
            "shot_noise": 0.02,
            "vignetting": float(draw.uniform(0.0, 0.4)),
            "tilt_x": float(draw.uniform(-0.2, 0.2)),
        },
        "faults": {"missing": int(draw.integers(0, 4)), "dust": int(draw.integers(0, 4))},
        "bodies": bodies,
    }


def manytouch(*arguments: str, folder: Path) -> None:
    """Run a command; if it fails, its message ends this program."""
    done = subprocess.run(
        [sys.executable, "-m", "manytouch", *arguments],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        sys.exit(f"manytouch {' '.join(arguments)} in {folder} failed:\n{done.stderr or done.stdout}")


def sensor_and_scene(number: int, kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Contents of the sensor file and the scene file with this number.

    `kind`: sheet, pad, moving, moving-pad, long or layouts.
    """
    name = f"{kind}-{number}"
    if kind == "moving-pad":
        draw = np.random.default_rng(MOVING_PAD_SEED + number)
        sensor = pad_sensor(draw, name)
        bodies = moving_pad_bodies(draw, sensor)
        return sensor, scene_of(draw, name, sensor, bodies, seconds=SECONDS, solid={"step_mm": 0.3})
    if kind in {"moving", "long", "layouts"}:
        draw = np.random.default_rng(MOVING_SEED + number)
        sensor = moving_sensor(draw, name)
        bodies = moving_bodies(draw, sensor, are_long=kind == "long")
        solid = {"step_mm": 1.5, "element_mm": max(1.8, float(sensor["sheet"]["size_mm"][0]) / 44.0)}
        scene = scene_of(draw, name, sensor, bodies, seconds=MOVING_SECONDS, solid=solid)
        return (with_layout(number, sensor) if kind == "layouts" else sensor), scene
    is_pad = kind == "pad"
    draw = np.random.default_rng((PAD_SEED if is_pad else SHEET_SEED) + number)
    sensor = pad_sensor(draw, name) if is_pad else sheet_sensor(draw, name)
    bodies = still_bodies(draw, sensor, is_pad=is_pad)
    element_mm = max(2.0, float(sensor["sheet"]["size_mm"][0]) / 26.0)
    solid = {"step_mm": 0.3} if is_pad else {"step_mm": 1.5, "element_mm": element_mm}
    return sensor, scene_of(draw, name, sensor, bodies, seconds=SECONDS, solid=solid)


def errors_of(
    number: int, out: Path, kind: str, *, is_drawn: bool
) -> tuple[MethodErrors, list[tuple[float, float, float]]]:
    """Errors of the scene with this number, which is simulated unless it is there.

    Returns:
        The usual ones, and those of every contact (`errors_of_every_contact`).
    """
    sensor, scene = sensor_and_scene(number, kind)
    name = str(scene["name"])
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "sensor.toml").write_text(tomlkit.dumps(sensor), encoding="utf-8")
    (folder / "scene.toml").write_text(tomlkit.dumps(scene), encoding="utf-8")
    if not (folder / "simulated" / "truth" / "markers.parquet").exists():
        manytouch("simulate", "scene.toml", "--out", "simulated", folder=folder)
    sensor_file, results = "simulated/sensor.toml", "results"
    if is_drawn:
        sensor_file, results = "drawn.toml", "results-drawn"
        with_errors = pad_sensor_with_errors if "pad" in kind else sensor_with_errors
        drawn = tomlkit.dumps(with_errors(number, sensor))
        (folder / sensor_file).write_text(drawn, encoding="utf-8")
    given = ("--sensor", sensor_file, "--fps", f"{FPS:g}")
    manytouch("process", "simulated/frames", *given, "--out", results, folder=folder)
    sheet = sensor["sheet"]
    thickness_mm = float(sheet["thickness_mm"])
    kinds = [f"{body['shape']['kind']} {depth_of(body) / thickness_mm:.2f}" for body in scene["bodies"]]
    print(
        f"{sensor['name']}: {sheet['size_mm'][0]:.0f} x {sheet['size_mm'][1]:.0f} x {thickness_mm:.1f} mm, "
        f"{dots_of(sensor['markers'])}; "
        f"depths in thicknesses: {', '.join(kinds)}"
    )
    truth, result = load_truth(folder / "simulated" / "truth"), load_result(folder / results / "frames")
    errors, every = compare(truth, result), errors_of_every_contact(truth, result)
    print("   ", summary_of(errors))
    print("   ", summary_of_every(every), flush=True)
    return errors, every


def dots_of(markers: dict[str, Any]) -> str:
    """Number and pitch of the dots."""
    if "rest_mm" in markers:
        return f"{len(markers['rest_mm'])} dots"
    pitch_mm = " x ".join(f"{each:.1f}" for each in np.atleast_1d(markers["pitch_mm"]))
    return f"{markers['columns']} x {markers['rows']} dots, pitch {pitch_mm} mm"


def errors_of_every_contact(
    truth: EvaluatedRecording, result: EvaluatedRecording
) -> list[tuple[float, float, float]]:
    """Errors of the contacts of all frames with `LEAST_SHARE` of their largest force, however light.

    Returns:
        For each: error of its force over its deviation, of its force over the true one, and of its depth
        over the true one; NaN where it was not found.
    """
    true, found = truth.contacts, result.contacts
    rows: list[tuple[float, float, float]] = []
    for frame in np.unique(true.frame):
        own, other = np.flatnonzero(true.frame == frame), np.flatnonzero(found.frame == frame)
        away_mm = np.linalg.norm(true.centre_mm[own][:, None] - found.centre_mm[other], axis=2)
        pairs = {int(own[a]): int(other[b]) for a, b in assigned(away_mm, GATE_MM)}
        for row in own:
            largest_N = true.normal_force_N[true.id == true.id[row]].max()
            if true.normal_force_N[row] < LEAST_SHARE * largest_N:
                continue
            if row not in pairs:
                rows.append((np.nan, np.nan, np.nan))
                continue
            pair = pairs[row]
            off_N = float(found.normal_force_N[pair] - true.normal_force_N[row])
            rows.append(
                (
                    off_N / float(found.normal_force_std_N[pair]),
                    off_N / float(true.normal_force_N[row]),
                    float(found.depth_mm[pair] / true.depth_mm[row]) - 1.0,
                )
            )
    return rows


def summary_of_every(rows: list[tuple[float, float, float]]) -> str:
    """The errors of every contact in a line."""
    stds, force, depth = np.array(rows).reshape(-1, 3).T
    is_found = np.isfinite(force)
    if not is_found.any():
        return f"every contact, however light: none of {len(rows)} found"
    low, middle, high = 100.0 * np.nanquantile(force, [0.1, 0.5, 0.9])
    covered = 100.0 * np.mean(np.abs(stds[is_found]) <= 1.96)
    return (
        f"every contact, however light: {100.0 * is_found.mean():.0f} % of {len(rows)} found, error of force "
        f"{middle:+.1f} % (80 %: {low:+.0f} to {high:+.0f}), {covered:.0f} % within their 95 % intervals, "
        f"of depth {100.0 * np.nanmedian(depth):+.1f} %"
    )


def depth_of(body: dict[str, Any]) -> float:
    """Largest depth of a body, in mm."""
    motion = body["motions"][0]
    deepest_mm = motion["depth_mm"] if "depth_mm" in motion else max(point[3] for point in motion["points"])
    return float(deepest_mm)


def summary_of(errors: MethodErrors) -> str:
    """The main figures in a line."""
    found = figures(errors)
    dots, contacts, force = found["detection"], found["contacts"], found["force"]
    return (
        f"dots found {dots['found_percent']:.1f} %, false {dots['false_percent']:.1f} %; "
        f"precision {contacts['precision_percent']:.0f} %, recall {contacts['recall_percent']:.0f} %, "
        f"position {contacts['position_median_mm']:.2f} mm (95 %: {contacts['position_p95_mm']:.2f}), "
        f"force {force['normal_median_percent']:.1f} % (95 %: {force['normal_p95_percent']:.1f}, "
        f"bias {force['normal_bias_percent']:+.1f}), depth RMSE {found['depth']['rmse_median_mm']:.4f} mm"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of all scenes")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--scenes", type=int, default=6, help="number of scenes")
    parser.add_argument("--pads", action="store_true", help="bonded pads instead of clamped sheets")
    parser.add_argument(
        "--moving", action="store_true", help="bodies that slide, roll and turn; sheets are larger"
    )
    parser.add_argument("--long", action="store_true", help="--moving with many cylinders and bars")
    parser.add_argument("--layouts", action="store_true", help="--moving with other arrangements of the dots")
    parser.add_argument("--drawn", action="store_true", help="sensor files with the errors of a careful user")
    given = parser.parse_args()
    if given.pads + given.long + given.layouts > 1:
        parser.error("--pads, --long and --layouts were given together: give one of them")
    numbers = range(given.first, given.first + given.scenes)
    chosen = "-".join([*["moving"] * given.moving, *["pad"] * given.pads]) or "sheet"
    chosen = "long" if given.long else "layouts" if given.layouts else chosen
    found = [errors_of(number, given.out, chosen, is_drawn=given.drawn) for number in numbers]
    errors = [each for each, _ in found]
    print(f"all {len(errors)} scenes: {summary_of(pooled(errors, 'all'))}")
    print("   ", summary_of_every([row for _, rows in found for row in rows]))
    coverage = figures(pooled(errors, "all"))["coverage"]
    for estimate in ("position", "depth", "force"):
        rows = coverage[estimate]
        if rows is None:
            print(f"    {estimate}: too few contacts to state how many are within their 95 % intervals")
        else:
            share = 100.0 * rows["coverage_95"]
            print(f"    {estimate}: {share:.0f} % of {rows['contacts']} contacts within 95 %")


if __name__ == "__main__":
    main()
