"""Error of the model in the images of markers on a pad."""

import numpy as np
import pytest

from manytouch.estimation.pad.estimator import PadState
from manytouch.estimation.pad.image_error import ImageError


def test_a_marker_at_rest_among_moving_ones_has_their_error(pad_state: PadState) -> None:
    model, error = pad_state.model, ImageError()
    weights, noise_px2 = error.weights(model), np.full(len(model.rest_px), 0.02**2)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    place_mm = model.layout.rest_mm[:, :2]
    away_mm = np.linalg.norm(place_mm - place_mm.mean(axis=0), axis=1)
    middle, corner = int(away_mm.argmin()), int(away_mm.argmax())
    moved_px2 = np.full(len(place_mm), 4.0)
    everywhere = error(model, weights, moved_px2, noise_px2)
    moved_px2[middle] = 0.0
    still = error(model, weights, moved_px2, noise_px2)
    assert 0.7 * everywhere[middle] < still[middle] < everywhere[middle]
    moved_px2[:] = 0.0
    moved_px2[middle] = 4.0
    alone = error(model, weights, moved_px2, noise_px2)
    at_rest = error(model, weights, np.zeros(len(place_mm)), noise_px2)
    assert alone[middle] > 2.0 * at_rest[middle]
    assert alone[corner] < 0.3 * alone[middle]


def test_the_error_grows_with_the_motion_and_is_that_of_the_share(pad_state: PadState) -> None:
    model, error = pad_state.model, ImageError(std_pitch=(0.0, 0.0), reach=0.0, nominal_reach=0.0)
    share = error.nominal_share if model.shape_is_nominal else error.share
    moved_px2, noise_px2 = np.full((2, len(model.rest_px)), [[9.0], [0.02**2]])
    variance_px2 = error(model, error.weights(model), moved_px2, noise_px2)
    np.testing.assert_allclose(np.sqrt(variance_px2), 3.0 * share)


@pytest.mark.parametrize(("noise_pitch", "still_pitch"), [(2e-5, 1e-4), (3e-4, 3e-4), (2e-3, 5e-4)])
def test_the_error_where_nothing_moves_is_as_large_as_the_noise(
    pad_state: PadState, noise_pitch: float, still_pitch: float
) -> None:
    model, error = pad_state.model, ImageError(reach=0.0, nominal_reach=0.0)
    still_px2, noise_px2 = np.full((2, len(model.rest_px)), [[0.0], [(noise_pitch * model.pitch_px) ** 2]])
    variance_px2 = error(model, error.weights(model), still_px2, noise_px2)
    np.testing.assert_allclose(np.sqrt(variance_px2), still_pitch * model.pitch_px)
