"""Two cameras on one sheet: contacts at the seam of the views are as good as those elsewhere."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch import Ball, prepare, process, read_results, save_sensor, simulate_contacts
from manytouch.simulation.demo_sensor import skin_sensor
from manytouch.sources.simulated import simulated_source
from results import rows_of

MOST_WORSE = 1.2
NEAR_MM = 20.0
REST_FRAMES = 4
MIDDLE_MM, SEAM_MM = (-54.0, -49.5), (-4.5, 0.0, 4.5)


def rms(errors: list[np.ndarray]) -> float:
    assert len(errors) > 0
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def near(rest_mm: np.ndarray, centre_mm: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rest_mm[:, :2] - centre_mm, axis=1) < NEAR_MM


@pytest.mark.slow
def test_pictures_of_two_cameras_give_one_contact_across_the_seam_without_more_error(tmp_path: Path) -> None:
    sensor = skin_sensor(1280)
    save_sensor(sensor, tmp_path / "skin.toml")
    places_mm = [*[None] * REST_FRAMES, *MIDDLE_MM, None, *SEAM_MM]
    presses = [
        [] if x_mm is None else [Ball(x_mm=x_mm, y_mm=3.0, depth_mm=3.0, radius_mm=8.0)] for x_mm in places_mm
    ]
    for view in sensor.camera.views:
        (tmp_path / view.name).mkdir()
    for number, image in enumerate(simulate_contacts(sensor, presses, output="image")):
        for view in sensor.camera.views:
            x, _, width, height = view.roi_px
            cv2.imwrite(str(tmp_path / view.name / f"{number:03d}.png"), image[:height, x : x + width])
    truths = simulate_contacts(sensor, presses, output="reading")

    text = f"views:{tmp_path / 'left'},{tmp_path / 'right'}"
    folder = process(text, out=tmp_path / "out", sensor=tmp_path / "skin.toml", fps=30.0)

    assert folder.name == "left-right"
    rows = [row for row in rows_of(folder / "contacts.csv") if row["phase"] != "end"]
    assert [int(row["frame"]) for row in rows] == [n for n, x_mm in enumerate(places_mm) if x_mm is not None]
    depth_mm = read_results(folder).markers["depth_mm"].to_numpy().reshape(len(places_mm), -1)
    errors: dict[tuple[float, ...], list[np.ndarray]] = {MIDDLE_MM: [], SEAM_MM: []}
    ids: dict[tuple[float, ...], set[str]] = {MIDDLE_MM: set(), SEAM_MM: set()}
    for row in rows:
        number = int(row["frame"])
        where = SEAM_MM if places_mm[number] in SEAM_MM else MIDDLE_MM
        surface, (true,) = truths[number].surface, truths[number].contacts.touching
        assert np.hypot(float(row["x_mm"]) - true.centre_mm[0], float(row["y_mm"]) - true.centre_mm[1]) < 0.3
        assert float(row["normal_force_N"]) == pytest.approx(-true.force_N[2], rel=0.1)
        shown_px = np.array([float(row["x_px"]), float(row["y_px"])])
        assert np.linalg.norm(shown_px - true.centre_px) < 4.0
        chosen = near(surface.position_mm, true.centre_mm)
        errors[where].append((depth_mm[number] + surface.displacement_mm[:, 2])[chosen])
        ids[where].add(row["contact"])
    assert [len(each) for each in ids.values()] == [1, 1]
    assert rms(errors[SEAM_MM]) <= MOST_WORSE * rms(errors[MIDDLE_MM])
    assert rms(errors[MIDDLE_MM]) < 0.03


@pytest.mark.slow
def test_at_1440p_a_ball_slides_across_the_seam_of_a_solid_sheet_without_more_error() -> None:
    source = simulated_source("skin", width_px=2560)
    job, errors, ids = prepare(source), {"middle": [], "seam": []}, set()
    assert (source.width_px, source.height_px) == (5120, 1440)
    for reading in job.readings():
        truth = source.truth(reading.frame.index)
        sliding = [contact for contact in truth.contacts.touching if contact.centre_mm[1] < 0.0]
        if not sliding or sliding[0].depth_mm < 2.5:
            continue
        (true,) = sliding
        found = [contact for contact in reading.contacts.touching if contact.centre_mm[1] < 0.0]
        assert len(found) == 1, f"frame {reading.frame.index}"
        ids.add(found[0].id)
        chosen = near(truth.surface.position_mm, true.centre_mm)
        error = (reading.surface.displacement_mm - truth.surface.displacement_mm)[chosen, 2]
        x_mm = abs(float(true.centre_mm[0]))
        if x_mm < 10.0 or x_mm > 40.0:
            errors["seam" if x_mm < 10.0 else "middle"].append(error)
    assert len(ids) == 1
    assert rms(errors["seam"]) <= MOST_WORSE * rms(errors["middle"])
