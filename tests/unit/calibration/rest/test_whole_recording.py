"""The rest of recordings that do not begin untouched."""

from dataclasses import replace

import numpy as np
import pytest

import clips
from flat_sensor import detections_of, flat_sensor, rectangle_px
from layouts import grid_at, rows_and_columns
from manytouch.calibration import sensor_from_rest
from manytouch.calibration.rest.assumed_sensor import sensor_from_dots
from manytouch.calibration.rest.local_bulge import START_IS_REST
from manytouch.calibration.rest.whole_recording import (
    RestDoubt,
    SettledRest,
    settle_rest,
    with_doubt_of_start,
    with_unrelated_pictures,
)
from manytouch.calibration.rest_dots import merge_rest_dots
from manytouch.session.commands.tare import tare_sensor
from manytouch.values import Frame, Sensor

PITCH_PX = 44.0
REST_PX = rectangle_px(5, 7, (PITCH_PX, PITCH_PX), (28.0, 32.0))
NOISE_PX = 0.04


def pressed(at_px: tuple[float, float], most_px: float) -> np.ndarray:
    """(m, 2) displacement of a gel that is squeezed outward and dragged a little."""
    offset = (REST_PX - at_px) / 60.0
    spread = np.exp(0.5 - 0.5 * (offset**2).sum(axis=1, keepdims=True))
    return most_px * spread * (offset + np.array([0.2, 0.1]))


FREE = np.zeros_like(REST_PX)
GRIP = pressed((130.0, 100.0), 8.0)
FAINT = pressed((280.0, 40.0), 2.5)


def settled(
    arrangements: list[tuple[np.ndarray, int]], begins: np.ndarray, *, noise_px: float = NOISE_PX
) -> SettledRest:
    """The rest after a recording of arrangements for so many frames each; the first one defines it."""
    sensor = flat_sensor(
        REST_PX, width_px=320, height_px=240, pitch_px=PITCH_PX, row_column=rows_and_columns(5, 7)
    )
    assert sensor.layout is not None
    sensor = replace(sensor, layout=replace(sensor.layout, rest_px=REST_PX + begins))
    moved = [each for each, frames in arrangements for _ in range(frames)]
    grids = [grid_at(REST_PX + each, noise_px=noise_px, seed=k) for k, each in enumerate(moved)]
    return settle_rest(sensor, grids, range(len(grids)))


def error_px(sensor: Sensor) -> float:
    assert sensor.layout is not None
    assert sensor.layout.rest_px is not None
    return float(np.abs(sensor.layout.rest_px - REST_PX).max())


@pytest.mark.parametrize("touch", [GRIP, FAINT])
def test_a_recording_that_begins_pressed_has_the_rest_that_follows(touch: np.ndarray) -> None:
    """Also where the touch lasts longer than anything else."""
    found = settled([(touch, 60), (FREE, 25), (0.7 * GRIP, 10), (FREE, 15)], touch)
    assert error_px(found.sensor) < 4.0 * NOISE_PX
    assert set(found.still_frames) <= {*range(60, 85), *range(95, 110)}
    assert found.doubt is None
    assert not found.sensor.rest_is_doubtful


@pytest.mark.parametrize("touch", [pytest.param(GRIP, marks=pytest.mark.slow), FAINT], ids=["grip", "faint"])
def test_a_touch_that_is_never_interrupted_is_pressed_because_it_spreads(touch: np.ndarray) -> None:
    assert error_px(settled([(touch, 60), (FREE, 25)], touch).sensor) < 4.0 * NOISE_PX
    assert error_px(settled([(FREE, 25), (touch, 60)], FREE).sensor) < 4.0 * NOISE_PX


def test_what_a_soft_sheet_keeps_of_a_press_does_not_change_the_rest_at_the_start() -> None:
    crept = 0.1 * np.roll(GRIP, 1, axis=1) * [1.0, -1.0]  # turned: it neither spreads nor contracts
    found = settled([(FREE, 15), (GRIP, 20), (crept, 60)], FREE)
    assert error_px(found.sensor) == 0.0
    assert found.still_frames == ()
    assert found.doubt is None


def test_a_moment_of_a_slow_press_is_no_rest() -> None:
    """In three frames the markers of one place have contracted, as under a finger that drags them."""
    found = settled([(FREE, 6), (-0.5 * GRIP, 3), (0.1 * GRIP, 14)], FREE)
    assert error_px(found.sensor) < 4.0 * NOISE_PX
    assert found.doubt is None


def test_what_is_seen_once_is_no_rest_where_the_sheet_came_back_again_and_again() -> None:
    """In five frames the markers of one place have contracted, as those of a membrane may under a press."""
    crept = 0.1 * np.roll(GRIP, 1, axis=1) * [1.0, -1.0]
    once, press = (-0.5 * GRIP, 5), (GRIP, 4)
    found = settled([(FREE, 5), press, (FREE, 4), once, (crept, 24)], FREE)
    assert error_px(found.sensor) < 4.0 * NOISE_PX
    assert found.doubt is None


def test_a_weak_press_during_which_the_camera_moves_is_no_rest() -> None:
    """It moves markers by less than what counts as motion, and its frames are between those of both views."""
    weak, moved = 0.04 * GRIP, np.array([1.5, 0.0])
    found = settled([(GRIP, 6), (FREE, 14), (weak, 6), (weak + moved, 6), (FREE + moved, 14)], GRIP)
    assert found.sensor.layout is not None
    assert found.sensor.layout.rest_px is not None
    away_px = found.sensor.layout.rest_px - REST_PX
    np.testing.assert_allclose(away_px, np.median(away_px, axis=0) + FREE, atol=1.5 * NOISE_PX)


@pytest.mark.parametrize("begins", [FREE, 0.02 * GRIP], ids=["untouched", "touched"])
def test_a_light_press_is_no_rest_where_the_noise_is_lower(begins: np.ndarray) -> None:
    """It moves markers by less than what counts as motion, and lasts longer than the rest."""
    light = 0.02 * GRIP
    found = settled([(begins, 9), (light, 40), (GRIP, 12), (FREE, 12)], begins, noise_px=0.004)
    assert error_px(found.sensor) < 0.02
    assert found.doubt is None


def test_a_sheet_that_never_rests_makes_the_rest_doubtful() -> None:
    found = settled([(share * GRIP, 1) for share in np.linspace(0.0, 6.0, 60)], FREE)
    assert found.doubt is RestDoubt.NEVER_STILL
    assert found.sensor.rest_is_doubtful
    assert "tare" in found.sensor.assumptions[-1]
    tared = tare_sensor(found.sensor, [grid_at(REST_PX)] * 3)
    assert tared is not None
    assert not tared.rest_is_doubtful


def test_two_arrangements_as_common_as_each_other_are_a_doubt() -> None:
    turned = 0.5 * np.roll(GRIP, 1, axis=1) * [1.0, -1.0]
    found = settled([(FREE, 30), (turned, 30)], FREE)
    assert found.doubt is RestDoubt.EQUALLY_COMMON
    assert found.sensor.rest_is_doubtful


@pytest.mark.parametrize(
    ("press", "frames", "reason"),
    [
        (0.0, 15, None),
        (0.5, 15, RestDoubt.UNEVEN_START),
        (0.0, 40, RestDoubt.MOVED_START),
        (0.5, 40, RestDoubt.MOVED_START),
    ],
)
def test_a_start_with_moving_or_uneven_markers_is_a_doubt(
    press: float, frames: int, reason: RestDoubt | None
) -> None:
    """The sensor is found in 15 frames without motion."""
    grid_px = rectangle_px(10, 12, (45.0, 35.0), (60.0, 40.0))
    away = grid_px - grid_px[65]
    bell = np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / 70.0**2)
    still = merge_rest_dots([detections_of(grid_px + press * bell * away)] * 15)
    sensor = sensor_from_dots(still, name="live", width_px=640, height_px=420, polarity="dark")
    found = with_doubt_of_start(sensor, frames)
    assert found.rest_is_doubtful == (reason is not None)
    assert [each for each in RestDoubt if each.value in "".join(found.assumptions)] == [reason] * (
        reason is not None
    )


def test_a_gel_that_creeps_at_the_start_is_still_there() -> None:
    """It moves by less than sheets that nobody touches, and by more than noise: fewer frames are the rest."""
    grid_px, random = rectangle_px(10, 12, (45.0, 35.0), (60.0, 40.0)), np.random.default_rng(3)
    bell = np.exp(-0.5 * ((grid_px - grid_px[65]) ** 2).sum(axis=1, keepdims=True) / 70.0**2)
    crept = [
        grid_px + 0.15 * share * bell + random.normal(0.0, 0.003, grid_px.shape)
        for share in np.linspace(0.0, 1.0, 15)
    ]
    still = merge_rest_dots([detections_of(each) for each in crept])
    assert len(still.frames) < 12
    assert still.unmoved == 15
    sensor = sensor_from_dots(still, name="live", width_px=640, height_px=420, polarity="dark")
    assert not with_doubt_of_start(sensor, 15).rest_is_doubtful


def test_pictures_of_different_sheets_in_a_folder_are_stated() -> None:
    def frame(index: int, image: np.ndarray) -> Frame:
        return Frame(index=index, timestamp_ns=index * 10**9, camera="folder", image=image)

    alike = [frame(k, clips.picture(seed=k)) for k in range(8)]
    sensor = sensor_from_rest(alike[:1], name="folder")
    assert with_unrelated_pictures(sensor, alike) is sensor
    random = np.random.default_rng(2)
    others = [frame(8 + k, random.integers(0, 256, alike[0].image.shape, dtype=np.uint8)) for k in range(10)]
    stated = with_unrelated_pictures(sensor, [alike[0], *others])
    assert "Only 1 of 11 pictures" in stated.assumptions[-1]


def test_the_rest_of_the_recording_replaces_what_was_assumed_of_its_start() -> None:
    """Otherwise one sentence states the start as rest, and another one later frames."""
    grid_px = rectangle_px(10, 12, (45.0, 35.0), (60.0, 40.0))
    away = grid_px - grid_px[65]
    press = 0.5 * np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / 70.0**2) * away
    sensor = sensor_from_dots(
        merge_rest_dots([detections_of(grid_px + press)] * 5),
        name="pressed",
        width_px=640,
        height_px=420,
        polarity="dark",
    )
    assert any(each.endswith(START_IS_REST) for each in sensor.assumptions)
    for later_px, is_touched in ((0.0 * press, False), (0.7 * press, True)):
        moved = [press] * 20 + [later_px] * 60
        grids = [grid_at(grid_px + each, noise_px=NOISE_PX, seed=k) for k, each in enumerate(moved)]
        found = settle_rest(sensor, grids, range(len(grids)))
        assert found.still_frames
        (sentence,) = (each for each in found.sensor.assumptions if "rest" in each)
        assert f"of the frames {min(found.still_frames)} to" in sentence
        assert ("or the sheet was touched" in sentence) == is_touched
