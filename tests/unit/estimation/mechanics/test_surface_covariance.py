"""Deviations of marker images that all frames have in common."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation.mechanics.surface_covariance import MarkerNoise
from manytouch.simulation.demo_sensor import demo_sensor


def test_rest_positions_of_few_frames_widen_the_deviation_by_the_noise_of_their_mean() -> None:
    noise, sensor = MarkerNoise(), replace(demo_sensor(640), centre_noise_px=0.3)
    of_model = noise.unexplained_std_px(20.0)
    assert noise.constant_std_px(20.0, sensor) == pytest.approx(of_model)
    for frames in (1, 4, 15, 24):
        found = noise.constant_std_px(20.0, replace(sensor, provenance={"rest_frames": frames}))
        excess = max(0.0, 1.0 / frames - 1.0 / 15.0)
        assert found == pytest.approx(np.hypot(of_model, 0.3 * excess**0.5))
    listed = replace(sensor, provenance={"still_frames": [0, 1, 2, 5]})
    assert listed.rest_frames == 4
