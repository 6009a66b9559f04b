"""Dots that the survey finds in real recordings, counted by hand."""

import csv
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from layouts import marker_layout
from manytouch.detection import DotSearch, Survey, survey
from manytouch.sources import open_source
from manytouch.values import Frame, Roi, Sensor
from straight import straight_camera

SETS = ("worachit", "worachit_unmoved", "gsrobotics", "vts4_left", "vts4_right")
PICTURES = ("fots_1.png", "gs_tracking_debug.png", "simtacls_bot.jpg")
OTHER_PICTURES = ("fots_0.png", "simtacls_up.jpg")


def rows_by(path: Path, key: str) -> dict[str, dict[str, str]]:
    lines = (line for line in path.read_text().splitlines() if not line.startswith("#"))
    return {row[key]: row for row in csv.DictReader(lines)}


def sensor_of(found: object, shape: tuple[int, ...]) -> Sensor:
    """A camera that looks straight at a sheet on which one pixel is one millimetre."""
    height, width = shape[:2]
    centre_px = found.detections.centre_px
    camera = straight_camera(
        width, height, focal_px=float(width), distance_mm=float(width), principal_px=(0.0, 0.0)
    )
    layout = marker_layout(
        centre_px,
        radius_mm=np.sqrt(found.detections.area_px2 / np.pi),
        polarity=found.appearance.polarity,
        colour_weights=found.appearance.colour_weights,
    )
    return Sensor(name="straight", camera=camera, layout=layout)


@cache
def survey_first_frame(recordings: Path, name: str) -> tuple[dict[str, str], Roi | None, Frame, Survey]:
    """The expected row, the region of interest, the first frame and its survey."""
    row = rows_by(recordings / "expected.csv", "set")[name]
    roi_px = Roi(*map(int, row["roi"].split(","))) if row["roi"] else None
    first = next(iter(open_source(str(recordings / row["input"]))))
    return row, roi_px, first, survey([first], roi_px=roi_px)


@pytest.mark.parametrize("name", SETS)
def test_first_frame_of_a_recording(recordings: Path, name: str) -> None:
    row, _, _, found = survey_first_frame(recordings, name)
    assert found.appearance.polarity == row["polarity"]
    assert int(row["markers_min"]) <= len(found.detections.centre_px) <= int(row["markers_max"])


@pytest.mark.parametrize(
    "name", [*PICTURES, *(pytest.param(name, marks=pytest.mark.slow) for name in OTHER_PICTURES)]
)
def test_single_picture(recordings: Path, name: str) -> None:
    row = rows_by(recordings / "single" / "counts.csv", "file")[name]
    image = cv2.imread(str(recordings / "single" / name))
    frame = Frame(index=0, timestamp_ns=0, camera=name, image=image)
    found = survey([frame])
    assert int(row["min"]) <= len(found.detections.centre_px) <= int(row["max"])
    if found.appearance.colour_weights is None:
        assert found.appearance.polarity == row["polarity"]


@pytest.mark.parametrize("name", SETS)
def test_search_finds_what_the_survey_found(recordings: Path, name: str) -> None:
    _, roi_px, first, found = survey_first_frame(recordings, name)
    search = DotSearch(roi_px=roi_px)
    state = search.start(sensor_of(found, first.image.shape))
    for expected_px in (None, found.detections.centre_px):
        state, again = search.step(state, first, expected_px)
        distance = np.linalg.norm(again.centre_px[:, None] - found.detections.centre_px[None], axis=2)
        assert (distance.min(axis=0) < 2.0).mean() > 0.95
        assert again.status == "ok"
