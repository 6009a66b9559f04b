"""What `process` makes of pictures of a clamped sheet of which nothing is known."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import manytouch
from manytouch.sources.simulated import simulated_source
from results import rows_of

PITCH_MM, PITCH_PX = 4.0, 20.0
STEP = 4  # of the frames that are processed


def test_five_fingers_without_a_sensor_file(tmp_path: Path) -> None:
    """Nothing states the scale, so that places are compared in the image, and depths in pitches."""
    simulator = simulated_source("fingers", width_px=640).simulator
    shown = range(0, 290, STEP)
    for number, index in enumerate(shown):
        cv2.imwrite(str(tmp_path / f"{number:04d}.png"), simulator.frame(index).image)
    folder = manytouch.process(str(tmp_path), out=tmp_path / "results", fps=30.0 / STEP)
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["method"] == "mechanics"
    assert not [sentence for sentence in summary["warnings"] if "clamped sheet" in sentence]
    rows = [row for row in rows_of(folder / "contacts.csv") if row["phase"] != "end"]
    away_px, depth_error, missed, false = [], [], 0, 0
    for number, index in enumerate(shown):
        found = [row for row in rows if int(row["frame"]) == number]
        place_px = np.array([[float(row["x_px"]), float(row["y_px"])] for row in found]).reshape(-1, 2)
        touching = simulator.truth(index).contacts.touching
        taken = set()
        for contact in touching:
            distance_px = np.linalg.norm(place_px - contact.centre_px, axis=1)
            nearest = int(np.argmin(distance_px)) if found else -1
            if nearest < 0 or distance_px[nearest] > 0.75 * PITCH_PX:
                missed += 1
                continue
            taken.add(nearest)
            away_px.append(distance_px[nearest])
            depth_error.append(float(found[nearest]["depth_pitch"]) * PITCH_MM / contact.depth_mm - 1.0)
        false += len(found) - len(taken)
    assert len(away_px) > 100
    assert missed <= 0.05 * len(away_px)
    assert false <= 0.05 * len(away_px)
    assert np.median(away_px) < 0.1 * PITCH_PX
    assert abs(np.median(depth_error)) < 0.05
    assert np.percentile(np.abs(depth_error), 80) < 0.1


@pytest.mark.parametrize("region", [manytouch.Roi(0, 0, 640, 270), manytouch.Roi(140, 80, 360, 200)])
def test_a_region_that_shows_a_part_of_the_sheet(tmp_path: Path, region: manytouch.Roi) -> None:
    """The sheet goes on around the region, and fingers press it there, some of them on its border."""
    simulator = simulated_source("fingers", width_px=640).simulator
    shown = range(0, 290, STEP)
    for number, index in enumerate(shown):
        cv2.imwrite(str(tmp_path / f"{number:04d}.png"), simulator.frame(index).image)
    folder = manytouch.process(str(tmp_path), out=tmp_path / "results", fps=30.0 / STEP, roi_px=region)
    rows = [row for row in rows_of(folder / "contacts.csv") if row["phase"] != "end"]
    found = missed = false = 0
    for number, index in enumerate(shown):
        own_px = [[float(row["x_px"]), float(row["y_px"])] for row in rows if int(row["frame"]) == number]
        true_px = [contact.centre_px for contact in simulator.truth(index).contacts.touching]
        both = np.array(own_px).reshape(-1, 1, 2), np.array(true_px).reshape(1, -1, 2)
        is_near = np.linalg.norm(both[0] - both[1], axis=2) < 0.75 * PITCH_PX
        false += int((~is_near.any(axis=1)).sum())
        inside_px = both[1][0] - [region.x_px, region.y_px]
        left_px = np.minimum(inside_px, [region.width_px, region.height_px] - inside_px)
        is_shown = (left_px > 0.5 * PITCH_PX).all(axis=1)
        found += int((is_near.any(axis=0) & is_shown).sum())
        missed += int((~is_near.any(axis=0) & is_shown).sum())
    assert found > 30
    assert missed <= 0.1 * found
    assert false <= 0.1 * found
