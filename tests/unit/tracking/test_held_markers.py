"""Compressed video is noticed by markers that stay exactly where they were."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float64

from flat_sensor import detections_of, flat_sensor
from manytouch.tracking.held_markers import HeldMarkers, HeldMarkersState
from manytouch.tracking.tracker import MarkerTracker
from manytouch.values.arrays import read_only

COLUMNS, ROWS, PITCH_PX = 14, 10, 30.0
STD_PX = 0.01
PLACE = np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)), axis=-1).reshape(-1, 2) * PITCH_PX + 60.0
COUNT = len(PLACE)
HELD = HeldMarkers()

Images = Float64[np.ndarray, "m 2"]


def covariances() -> Float64[np.ndarray, "m 2 2"]:
    return np.tile(STD_PX**2 * np.eye(2), (COUNT, 1, 1))


def after(frames: list[Images], *, is_predicted: bool = False) -> HeldMarkersState:
    state = HELD.start(COUNT)
    for each_px in frames:
        state = HELD.step(state, each_px.copy(), covariances(), is_predicted=is_predicted)
        read_only(state.position_px)
    return state


def own_pictures(count: int, seed: int) -> list[Images]:
    random = np.random.default_rng(seed)
    return [PLACE + random.normal(0.0, STD_PX, PLACE.shape) for _ in range(count)]


def compressed(count: int, seed: int) -> list[Images]:
    """In each frame seven of ten dots are displaced anew, and the others stay where they were."""
    random = np.random.default_rng(seed)
    frames = own_pictures(1, seed)
    for own_px in own_pictures(count - 1, seed + 1):
        is_new = random.random(COUNT) > 0.3
        frames.append(np.where(is_new[:, None], own_px, frames[-1]))
    return frames


def test_pictures_of_their_own_with_noise_are_not_compressed() -> None:
    state = after(own_pictures(60, 1))
    assert not state.is_compressed
    assert 0.0 < state.share < 0.02


def test_markers_that_stay_exactly_where_they_were_show_that_a_video_is_compressed() -> None:
    frames = compressed(31, 1)
    state = after(frames)
    assert state.is_compressed
    later = after([*frames, *own_pictures(60, 5)])
    assert later.is_compressed


def test_the_covariances_of_compressed_video_contain_its_errors() -> None:
    state = after(compressed(31, 1))
    covariance_px2 = covariances()
    HELD.step(state, PLACE.copy(), covariance_px2)
    np.testing.assert_allclose(
        covariance_px2, np.tile((STD_PX**2 + HELD.std_px**2) * np.eye(2), (COUNT, 1, 1))
    )
    untouched_px2 = covariances()
    HELD.step(HELD.start(COUNT), PLACE.copy(), untouched_px2)
    np.testing.assert_array_equal(untouched_px2, covariances())


def test_markers_that_are_not_seen_do_not_count() -> None:
    frames = compressed(31, 1)
    for k, each_px in enumerate(frames):
        each_px[k % 2 :: 2] = np.nan
    assert after(frames).share == 0.0
    few = compressed(31, 1)
    for each_px in few:
        each_px[40:] = np.nan
    assert after(few[:3]).share == pytest.approx(after(compressed(31, 1)[:3]).share, rel=0.3)
    nothing = [np.full(PLACE.shape, np.nan)] * 20
    assert not after(nothing).is_compressed


def test_markers_that_the_border_cuts_do_not_count() -> None:
    """Their deviations are of several pixels, so that they always stay within a tenth of them."""
    is_cut = PLACE[:, 0] == PLACE[:, 0].min()
    covariance_px2 = np.where(is_cut[:, None, None], 10.0 * np.eye(2), covariances())
    state = HELD.start(COUNT)
    for position_px in own_pictures(40, seed=5):
        state = HELD.step(state, position_px, covariance_px2)
    assert not state.is_compressed


def test_the_same_picture_again_does_not_show_that_a_video_is_compressed() -> None:
    own = own_pictures(20, 2)
    twice = [each_px for each_px in own for _ in range(3)]
    assert not after(twice).is_compressed
    held = [np.where(PLACE[:, :1] > 260.0, each_px, own[0]) for each_px in own]
    assert after([*twice, *held]).is_compressed


def test_markers_that_nothing_moves_in_pictures_without_noise_do_not_show_that_a_video_is_compressed() -> (
    None
):
    frames = [PLACE] * (HELD.noiseless_frames + 1)
    for k in range(20):
        pressed = PLACE.copy()
        pressed[:30] += 0.1 * k
        frames.append(pressed)
    assert not after(frames).is_compressed
    assert after(frames[2:]).is_compressed


def test_pictures_that_a_codec_predicted_and_that_stay_the_same_show_that_a_video_is_compressed() -> None:
    at_rest = [PLACE] * (HELD.noiseless_frames + 1)
    frames = [*at_rest, *compressed(31, 1)]
    assert not after(frames).is_compressed
    assert after(at_rest, is_predicted=True).is_compressed
    assert after(frames, is_predicted=True).is_compressed
    twice = [each_px for each_px in own_pictures(60, 1) for _ in range(2)]
    assert not after(twice, is_predicted=True).is_compressed
    assert not after(own_pictures(60, 1), is_predicted=True).is_compressed


def test_a_second_frame_in_which_most_markers_stay_does_not_show_that_a_video_is_compressed() -> None:
    settled = np.where(np.arange(COUNT)[:, None] % 10 == 0, PLACE + 0.002, PLACE)
    assert not after([PLACE, *[settled] * 20]).is_compressed
    pressed = PLACE + 0.5 * np.arange(20)[:, None, None]
    assert not after([PLACE, *[settled] * (1 + HELD.noiseless_frames), *pressed]).is_compressed


@pytest.mark.parametrize("is_predicted", [False, True])
def test_a_tracker_notices_pictures_that_a_codec_keeps(*, is_predicted: bool) -> None:
    sensor = flat_sensor(
        PLACE, width_px=600, height_px=500, pitch_px=PITCH_PX, radius_px=6.0, row_column=None, polarity="dark"
    )
    tracker = MarkerTracker()
    state = tracker.start(sensor)
    dots = replace(detections_of(PLACE, std_px=STD_PX, area_px2=100.0), is_predicted=is_predicted)
    for _ in range(HELD.noiseless_frames + 1):
        state, grid = tracker.step(state, dots)
    assert grid.is_compressed == is_predicted


@pytest.mark.parametrize("is_compressed", [False, True])
def test_a_tracker_notices_compressed_video(*, is_compressed: bool) -> None:
    sensor = flat_sensor(
        PLACE, width_px=600, height_px=500, pitch_px=PITCH_PX, radius_px=6.0, row_column=None, polarity="dark"
    )
    tracker = MarkerTracker()
    state = tracker.start(sensor)
    for each_px in compressed(25, 3) if is_compressed else own_pictures(25, 3):
        state, grid = tracker.step(state, detections_of(each_px, std_px=STD_PX, area_px2=100.0))
        assert grid.is_seen.all()
    assert grid.is_compressed == is_compressed
    excess_px2 = grid.covariance_px2[0] - STD_PX**2 * np.eye(2)
    np.testing.assert_allclose(excess_px2, is_compressed * HELD.std_px**2 * np.eye(2), atol=1e-12)
    state, nothing = tracker.step(state, detections_of(np.zeros((0, 2)), std_px=STD_PX, area_px2=100.0))
    assert nothing.is_compressed == is_compressed
