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

WIDTH_PX, HEIGHT_PX = 320, 240
ROWS, COLUMNS = 4, 6
FOCAL_PX, PITCH_RAD = 115.0, 0.6
CENTRE_PX = np.array([160.0, 118.0])


def dots_px() -> np.ndarray:
    """(24, 2) centres of an even lattice of directions through an equidistant fisheye lens."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    offset = np.column_stack([column - (COLUMNS - 1) / 2, row - (ROWS - 1) / 2]) * PITCH_RAD
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    jitter = np.random.default_rng(1).normal(0.0, 1.2, offset.shape)
    return CENTRE_PX + FOCAL_PX * offset / length * np.arctan(length) + jitter


DOTS_PX = dots_px()
RADIUS_PX = 4.5 - 0.012 * np.linalg.norm(DOTS_PX - CENTRE_PX, axis=1)


def scene(frame: int) -> np.ndarray:
    """Blurred boards and dark things in front of a wall; half of them move."""
    random = np.random.default_rng(7)
    image = np.full((HEIGHT_PX, WIDTH_PX), 150.0, dtype=np.float32)
    for thing in range(30):
        x, y = random.uniform([0, 0], [WIDTH_PX, HEIGHT_PX])
        size, grey, turn = random.uniform(20, 70, 2), random.uniform(40, 250), random.uniform(0, 180)
        way = (thing % 2) * 0.8 * frame
        place = (float((x + way) % WIDTH_PX), float((y + 0.4 * way) % HEIGHT_PX))
        box = cv2.boxPoints((place, (float(size[0]), float(size[1])), float(turn)))
        cv2.fillPoly(image, [box.astype(np.int32)], grey)
    return cv2.GaussianBlur(image, (0, 0), 2.5)


def picture(frame: int, *, has_dots: bool = True) -> Frame:
    image = scene(frame)
    if has_dots:
        for (x, y), radius in zip(DOTS_PX, RADIUS_PX, strict=True):
            cv2.circle(image, (round(16 * x), round(16 * y)), round(16 * radius), 25.0, -1, cv2.LINE_AA, 4)
    for x, y, length in ((40, 60, 9), (215, 180, 14)):  # glints
        cv2.line(image, (x, y), (x + 3, y + length), 255.0, 2)
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    image *= np.clip(1.55 - np.hypot(x - 160, y - 120) / 240.0, 0.25, 1.0)  # dark corners
    image = cv2.GaussianBlur(image, (0, 0), 0.7)
    image += np.random.default_rng(frame).normal(0.0, 1.5, image.shape)
    whole = cv2.cvtColor(np.clip(image, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    return Frame(index=frame, timestamp_ns=frame * 40_000_000, camera="skin", image=whole)


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
