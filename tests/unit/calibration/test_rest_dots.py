"""The frames of a sheet that moves which are taken as its rest."""

import numpy as np
import pytest

from flat_sensor import detections_of, rectangle_px
from manytouch.calibration.rest_dots import merge_rest_dots

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
