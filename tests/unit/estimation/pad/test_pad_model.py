"""The motion of the image by a camera that turns, and contacts while it does."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bonded_pad import pad_sensor, seen_px
from layouts import grid_at
from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.patch_kernels import SHAPE
from manytouch.geometry.camera import cam_from_sheet, project, ray
from manytouch.values import Camera, Contacts, Sensor

ESTIMATE = PadEstimator()
NOISE_PX = 0.004
TURN_RAD = (5e-3, -2e-3)
"""About x and y; .21 px at the corners of the pad, without what a shift, a growth and a rotation explain."""
WIDE_LENS = np.array([-0.15, 0.02, 0.0, 0.0, 0.0])


def turned(camera: Camera, turn_rad: np.ndarray) -> Camera:
    """The camera after it has turned about its own axes (3,), at the same place."""
    rotation, translation_mm = cam_from_sheet(camera)
    by, _ = cv2.Rodrigues(-turn_rad)
    vector, _ = cv2.Rodrigues(by @ rotation)
    return replace(camera, rotation_vector=vector.ravel(), translation_mm=by @ translation_mm)


def tilted_px(position_px: np.ndarray, camera: Camera) -> np.ndarray:
    """Images (m, 2) of a camera in its nominal pose after it has turned by `TURN_RAD`, without the shift."""
    place = np.column_stack([ray(camera, position_px), np.ones(len(position_px))])
    after = turned(replace(camera, translation_mm=np.zeros(3)), np.array([*TURN_RAD, 0.0]))
    moved_px = project(after, place)
    return np.asarray(moved_px - (moved_px - position_px).mean(axis=0))


def pressed_px(state: PadState) -> np.ndarray:
    """(m, 2) images of the markers under a contact at x = 1.3 mm, y = -0.7 mm."""
    shape = np.array([1.3, -0.7, 0.9, 0.1, 0.8])
    column = ESTIMATE.fitter.images(state.model, shape[None, :SHAPE]).column[0]
    return np.asarray(state.model.rest_px + (np.array([1.0, 0.15, -0.05, 0.1, 0.0]) @ column).reshape(-1, 2))


def contacts_of(state: PadState, *images: np.ndarray) -> Contacts:
    """Contacts after frames with these images (m, 2) and noise."""
    for seed, position_px in enumerate(images):
        grid = grid_at(position_px, std_px=NOISE_PX, noise_px=NOISE_PX, seed=seed)
        state, _, contacts = ESTIMATE.step(state, grid)
    return contacts


@pytest.mark.parametrize("distortion", [np.zeros(5), WIDE_LENS])
@pytest.mark.parametrize("pose", [(0.0, 0.0), (0.2, -0.1)])
def test_a_camera_that_turns_moves_the_image_as_the_model_says(
    distortion: np.ndarray, pose: tuple[float, float]
) -> None:
    """Every small turn is a sum of the motions, also through a window, a lens and from the side."""
    sensor = pad_sensor()
    camera = replace(sensor.camera, distortion=distortion)
    camera = turned(camera, np.array([*pose, 0.0]))
    sensor = replace(sensor, camera=camera)
    motion = ESTIMATE.nominal_pad(sensor).motion
    others = motion[:4]
    for axis, own in zip(np.eye(3)[:2], motion[4:], strict=True):
        turns: list[Sensor] = [replace(sensor, camera=turned(camera, step * axis)) for step in (1e-3, -1e-3)]
        slope_px = (seen_px(turns[0]) - seen_px(turns[1])).ravel() / 2e-3
        size = np.linalg.norm(others) * np.linalg.norm(own)
        np.testing.assert_allclose(others @ own, 0.0, atol=1e-6 * size)
        share, *_ = np.linalg.lstsq(others.T, slope_px, rcond=None)
        np.testing.assert_allclose(own, slope_px - share @ others, atol=1e-3 * np.abs(own).max())


def test_a_camera_that_turns_shows_no_contact(pad_state: PadState) -> None:
    rest_px = pad_state.model.rest_px
    assert not contacts_of(pad_state, *3 * [rest_px]).touching
    tilted = tilted_px(rest_px, pad_state.model.camera)
    assert np.abs(tilted - rest_px).max() > 10.0 * NOISE_PX
    assert not contacts_of(pad_state, rest_px, *3 * [tilted]).touching


def test_a_contact_is_the_same_where_the_camera_has_turned(pad_state: PadState) -> None:
    held_px = pressed_px(pad_state)
    (was,) = contacts_of(pad_state, *3 * [held_px]).touching
    tilted = tilted_px(held_px, pad_state.model.camera)
    (found,) = contacts_of(pad_state, *3 * [held_px], *4 * [tilted]).touching
    np.testing.assert_allclose(found.force_N, was.force_N, atol=-0.06 * was.force_N[2])
    np.testing.assert_allclose(found.centre_mm, was.centre_mm, atol=0.05)
