"""The frames of a sheet that moves which are taken as its rest."""

import numpy as np
import pytest

from flat_sensor import detections_of, rectangle_px
from manytouch.calibration.rest_dots import merge_rest_dots, rest_arrangements

REST = rectangle_px(7, 9, first_px=(50.0, 60.0))


def pressed(depth_px, middle_px=(210.0, 180.0), width_px=60.0):
    """The dots of a sheet that is pressed at one place."""
    away = REST - middle_px
    bell = np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / width_px**2)
    return REST + depth_px * bell * away / width_px


def frames_of(depths_px, *, glints=0, seed=0):
    rng = np.random.default_rng(seed)
    glint_px = rng.uniform((440.0, 40.0), (560.0, 320.0), (glints, 2))  # next to the sheet, in all frames
    found = []
    for depth_px in depths_px:
        dots = pressed(depth_px) + rng.normal(0.0, 0.05, REST.shape)
        found.append(detections_of(np.concatenate([dots, glint_px])))
    return found


@pytest.mark.parametrize("least", [0, 4, 11])
@pytest.mark.parametrize("glints", [0, 20])
def test_of_frames_that_all_differ_the_least_pressed_one_is_rest(least, glints):
    depths_px = 6.0 + 3.0 * np.abs(np.arange(12) - least)
    depths_px[least] = 0.0
    assert merge_rest_dots(frames_of(depths_px, glints=glints)).frames == (least,)


@pytest.mark.parametrize("pressed_frames", [4, 8])
def test_frames_that_agree_are_rest_although_others_are_more_evenly_spaced(pressed_frames):
    """What is printed may be uneven; the first of the frames that agree are rest."""
    depths_px = [12.0] * pressed_frames + [0.0, 3.0, 6.0, 9.0]
    assert merge_rest_dots(frames_of(depths_px)).frames == tuple(range(pressed_frames))


@pytest.mark.parametrize("untouched", [3, 6])
def test_frames_in_which_a_press_begins_at_one_place_are_no_rest(untouched):
    """Nearly all dots stay where they are; those at the press move by a fortieth of their spacing."""
    depths_px = [0.0] * untouched + [0.5, 1.0] + [1.5] * (12 - untouched)
    found = merge_rest_dots(frames_of(depths_px))
    assert found.frames == tuple(range(untouched))
    assert np.abs(found.centre_px - REST).max() < 0.12


def test_frames_of_a_light_press_are_no_rest_where_the_noise_is_lower():
    """No dot moves by more than a two-hundredth of the spacing."""
    rng = np.random.default_rng(4)
    depths_px = [0.0] * 5 + [0.15, 0.25] + [0.3] * 8
    frames = [detections_of(pressed(each) + rng.normal(0.0, 0.01, REST.shape)) for each in depths_px]
    found = merge_rest_dots(frames)
    assert found.frames == tuple(range(5))
    assert np.abs(found.centre_px - REST).max() < 0.03


def test_a_dot_that_is_seen_in_other_frames_only_is_not_lost():
    rng = np.random.default_rng(4)
    depths_px = [0.0] * 5 + [0.15, 0.25] + [0.3] * 8
    shown = [pressed(each) + rng.normal(0.0, 0.01, REST.shape) for each in depths_px]
    frames = [detections_of(each if k >= 5 else each[1:]) for k, each in enumerate(shown)]
    found = merge_rest_dots(frames)
    assert found.frames == tuple(range(5))
    assert len(found.centre_px) == len(REST)
    assert np.abs(found.centre_px - REST[0]).max(axis=1).min() < 0.5


@pytest.mark.parametrize("noise_px", [0.05, 0.2])
def test_noise_and_a_camera_that_shakes_leave_no_frame_out(noise_px):
    rng = np.random.default_rng(2)
    shaken = [REST + rng.normal(0.0, 0.1, 2) + rng.normal(0.0, noise_px, REST.shape) for _ in range(15)]
    assert merge_rest_dots([detections_of(each) for each in shaken]).frames == tuple(range(15))


def test_groups_of_frames_are_listed_the_most_probable_rest_first():
    rest, held = [0.0] * 3, [20.0] * 9
    first, second = rest_arrangements(frames_of(rest + held + [8.0]))
    assert first.frames == tuple(range(3, 12))
    assert second.frames == tuple(range(3))
