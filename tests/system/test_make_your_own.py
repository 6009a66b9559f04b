"""From a design to its measured accuracy: designed, pressed in 3-D, calibrated, measured."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.calibration.sheet.press_plan import CONTACT_RADIUS_MM, DEPTHS_MM, TIP_RADIUS_MM, places_mm
from manytouch.cli import main
from manytouch.design.accuracy import predicted_accuracy, typical_force_N
from manytouch.design.choose import design_sensor
from manytouch.design.dimensions import Design
from manytouch.design.prototype import Prototype
from manytouch.design.requirements import CameraSpecification, Printer, Requirements
from manytouch.values import Sensor
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor

SOFT = Requirements(
    area_mm=(60.0, 40.0),
    deepest_mm=8.0,
    force_N=(0.2, 4.5),
    separation_mm=8.0,
    camera=CameraSpecification(width_px=1280, height_px=720, hfov_deg=63.7, least_focus_mm=100.0, fps=30.0),
    printer=Printer(nozzle_mm=0.4, bed_mm=(220.0, 220.0, 250.0)),
    marker_height_mm=0.0,
    material="silicone, Shore A 40",
    thickness_mm=3.0,
)
THIN = Requirements(
    area_mm=(50.0, 35.0),
    deepest_mm=8.0,
    force_N=(0.3, 6.0),
    separation_mm=6.0,
    camera=CameraSpecification(width_px=1024, height_px=768, hfov_deg=58.0, least_focus_mm=60.0, fps=30.0),
    material="TPU, Shore A 60",
    thickness_mm=2.0,
)
STIFF = Requirements(
    area_mm=(70.0, 45.0),
    deepest_mm=10.0,
    force_N=(0.5, 12.0),
    separation_mm=10.0,
    camera=CameraSpecification(width_px=1280, height_px=960, hfov_deg=70.0, least_focus_mm=60.0, fps=30.0),
    material="TPU, Shore A 70",
    thickness_mm=4.0,
)
HEAD = """schema = 1
name = "{name}"
seconds = {seconds}
fps = {fps}
sensor = "designed.toml"
[light]
vignetting = 0.25
read_noise = 1.5
shot_noise = 0.02
"""
BODY = """[solid]
element_mm = {element_mm}
step_mm = 3.1
[[bodies]]
shape = {shape}
motions = [
"""
MOTION = (
    '{{ kind = "press", at_mm = [{x}, {y}], depth_mm = {depth}, start_s = {start}, '
    "end_s = {end:.1f}, ramp_s = 0.3 }},\n"
)


def simulated(
    folder: Path,
    name: str,
    places: Sequence[tuple[float, float, float]],
    *,
    fps: float,
    every_s: int,
    first_s: int,
    held_s: float,
) -> None:
    """Press the designed sheet at some places, one after the other."""
    shape = {
        "presses": f'{{ kind = "sphere", radius_mm = {TIP_RADIUS_MM} }}',
        "touches": '{ kind = "sphere", radius_mm = 8.0 }',
    }[name]
    motions = "".join(
        MOTION.format(x=x, y=y, depth=depth, start=start, end=start + held_s)
        for (x, y, depth), start in zip(places, range(first_s, 99, every_s), strict=False)
    )
    sheet = load_sensor(folder / "designed.toml").sheet
    assert sheet is not None
    # wider than thick, elements move the force of a ball near the clamp by a tenth of a millimetre
    element_mm = min(2.5, sheet.thickness_mm)
    head = HEAD.format(name=name, seconds=float(first_s + every_s * len(places)), fps=fps)
    body = BODY.format(shape=shape, element_mm=element_mm)
    (folder / f"{name}.toml").write_text(head + body + motions + "]\n")
    assert main(["simulate", str(folder / f"{name}.toml"), "--out", str(folder / name)]) == 0


def film(folder: Path, name: str, fps: float) -> None:
    images = [cv2.imread(str(path)) for path in sorted((folder / name / "frames").glob("*.png"))]
    size = (images[0].shape[1], images[0].shape[0])
    writer = cv2.VideoWriter(str(folder / f"{name}.avi"), cv2.VideoWriter.fourcc(*"MJPG"), fps, size)
    for image in images:
        writer.write(image)
    writer.release()


def contacts_at(table: Path, time_s: float) -> np.ndarray:
    """(n, 4) x, y, depth and force of the contacts at a time."""
    names = ("x_mm", "y_mm", "depth_mm", "normal_force_N")
    with table.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if abs(float(row["time_s"]) - time_s) < 0.01]
    return np.array([[float(row[name]) for name in names] for row in rows if row["phase"] != "end"])


def calibrated(folder: Path, designed: Sensor) -> None:
    """From the camera alone, an untouched second and the presses of the probing script to sensor.toml."""
    save_sensor(designed, folder / "designed.toml")
    text = (folder / "designed.toml").read_text()
    (folder / "camera.toml").write_text(text[: text.index("[camera.pose]")])
    (folder / "rest.toml").write_text(HEAD.format(name="untouched", seconds=2.0, fps=30.0))
    sheet, layout = designed.sheet, designed.layout
    assert sheet is not None and layout is not None  # noqa: PT018 - a design has both
    words = ["--pitch-mm", f"{layout.pitch_mm[0]:g}", "--thickness-mm", f"{sheet.thickness_mm:g}"]
    words += ["--sheet-mm", f"{sheet.size_mm[0]:g},{sheet.size_mm[1]:g}"]
    words += ["--sensor", str(folder / "camera.toml"), "--out", str(folder / "rested.toml")]
    assert main(["calibrate", "rest", f"sim:{folder / 'rest.toml'}", *words]) == 0
    places = [(x, y, depth) for x, y in places_mm(designed).tolist() for depth in DEPTHS_MM]
    simulated(folder, "presses", places, fps=5.0, every_s=3, first_s=2, held_s=2.6)
    film(folder, "presses", 5.0)
    rows = ["input,time_s,x_mm,y_mm,radius_mm,normal_force_N"]
    for number, (x, y, _) in enumerate(places):
        time_s = 3.4 + 3 * number
        ((*_, force_N),) = contacts_at(folder / "presses/truth/contacts.csv", time_s)
        rows.append(f"presses.avi,{time_s:.1f},{x},{y},{CONTACT_RADIUS_MM},{force_N}")
    (folder / "presses.csv").write_text("\n".join(rows) + "\n")
    words = ["--sensor", str(folder / "rested.toml"), "--out", str(folder / "sensor.toml")]
    assert main(["calibrate", "sheet", str(folder / "presses.csv"), *words]) == 0


def touches_of(found: Design, place_mm: np.ndarray) -> list[tuple[float, float, float]]:
    """x, y and depth about as strong as the prediction's, in all four quarters and near its positions."""
    number = np.arange(len(place_mm))
    sides = np.column_stack([1 - 2 * (number % 2), 1 - 2 * (number // 2 % 2)])
    scale = 1.0 - 0.04 * (number[:, None] % [3, 4])
    there = np.round(sides * (place_mm * scale + 0.4), 1)
    depths = Prototype.of(found.sensor).fingertip_depths_mm(there, typical_force_N(found))
    return [(x, y, depth) for (x, y), depth in zip(there.tolist(), depths, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("requirements", [SOFT, THIN, STIFF], ids=["soft", "thin", "stiff"])
def test_a_design_is_as_accurate_as_it_was_predicted(tmp_path: Path, requirements: Requirements) -> None:
    found = design_sensor(requirements)
    whole = predicted_accuracy(found.sensor, area_mm=requirements.area_mm, force_N=typical_force_N(found))
    predicted, touches = whole.rms, touches_of(found, whole.place_mm)
    calibrated(tmp_path, found.sensor)
    simulated(tmp_path, "touches", touches, fps=10.0, every_s=2, first_s=1, held_s=1.4)
    words = ["--sensor", str(tmp_path / "sensor.toml"), "--method", "mechanics", "--fps", "10"]
    assert main(["process", str(tmp_path / "touches/frames"), *words, "--out", str(tmp_path / "read")]) == 0
    off = []
    for number in range(len(touches)):
        time_s = 2.1 + 2 * number
        (true,) = contacts_at(tmp_path / "touches/truth/contacts.csv", time_s)
        estimated = contacts_at(tmp_path / "read/frames/contacts.csv", time_s)
        estimated = estimated[np.argmin(np.linalg.norm(estimated[:, :2] - true[:2], axis=1))]
        off.append([*(estimated - true)[:3], estimated[3] / true[3] - 1])
    x, y, depth, force = np.sqrt(np.mean(np.square(off), axis=0))
    measured = math.hypot(x, y) / math.sqrt(2), 1e3 * depth, 100 * force
    for name, here, there in zip(("position", "depth", "force"), measured, predicted, strict=True):
        assert there / 1.5 < here < 1.5 * there, f"{name}: measured {measured}, predicted {predicted}"
