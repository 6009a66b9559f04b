"""Few dots on a transparent skin through a fisheye lens, before a scene that moves."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from manytouch.calibration import sensor_from_rest
from manytouch.calibration.rest.assumed_sensor import sensor_from_dots
from manytouch.calibration.sparse_dots import find_sparse_dots
from manytouch.errors import LayoutError
from manytouch.session import pipeline_for
from manytouch.values import Frame
from moving_scene import DOTS_PX, HEIGHT_PX, WIDTH_PX, picture


def test_dots_before_a_moving_scene_are_found_and_followed() -> None:
    frames = [picture(frame) for frame in range(0, 240, 4)]
    spread = frames[::4]
    found = find_sparse_dots(spread, None)
    assert found is not None
    polarity, dots = found
    assert polarity == "dark"
    sensor = sensor_from_dots(dots, name="skin", width_px=WIDTH_PX, height_px=HEIGHT_PX, polarity=polarity)
    assert sensor.layout is not None
    layout = replace(sensor.layout, is_before_scene=True)
    sensor = replace(sensor, layout=layout)
    rest_px = layout.rest_px
    assert rest_px is not None
    distance = np.linalg.norm(rest_px[:, None] - DOTS_PX, axis=2)
    known = ~layout.is_missing
    assert known.sum() >= 22
    assert distance[known].min(axis=1).max() < 1.5
    own = distance.argmin(axis=1)
    readings = list(pipeline_for("perimeter").run(frames, sensor))
    seen = np.array([reading.grid.is_seen for reading in readings])[:, known]
    assert seen.mean() > 0.97
    for reading in readings:
        grid = reading.grid
        off = np.linalg.norm(grid.position_px - DOTS_PX[own], axis=1)[grid.is_seen]
        assert off.max() < 0.3 * 55.0  # none swapped
        assert np.median(off) < 0.5
    assert sum(bool(reading.contacts.touching) for reading in readings) <= 0.02 * len(readings)


@pytest.mark.parametrize(("things", "is_live"), [(0, False), (4, False), (5, False), (2, True)])
def test_what_looks_like_a_dot_and_is_not_on_the_lattice_is_no_marker(things: int, is_live: bool) -> None:
    """It moves later, which a live source does not show at its start."""
    frames = [picture(frame, things=things) for frame in range(240)]
    spread = None if is_live else (lambda: frames[::15])
    sensor = sensor_from_rest(frames[:15], name="skin", spread=spread)
    layout = sensor.layout
    assert layout is not None
    assert layout.rest_px is not None
    assert layout.is_before_scene
    known_px = layout.rest_px[~layout.is_missing]
    assert 22 <= len(known_px) <= len(DOTS_PX)
    assert np.linalg.norm(known_px[:, None] - DOTS_PX, axis=2).min(axis=1).max() < 1.5


def test_a_scene_without_dots_has_none() -> None:
    frames = [picture(frame, has_dots=False) for frame in range(0, 160, 10)]
    assert find_sparse_dots(frames, None) is None
    with pytest.raises(LayoutError):
        sensor_from_rest(frames[:15], name="nothing")


def test_random_dots_are_no_lattice() -> None:
    random = np.random.default_rng(3)
    image = np.full((HEIGHT_PX, WIDTH_PX), 200, dtype=np.uint8)
    for x, y in random.uniform([10, 10], [310, 230], (30, 2)):
        cv2.circle(image, (round(16 * x), round(16 * y)), 16 * 5, 40, -1, cv2.LINE_AA, 4)
    assert find_sparse_dots([Frame(index=0, timestamp_ns=0, camera="x", image=image)], None) is None
