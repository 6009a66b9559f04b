"""Deviations of marker images that all frames have in common."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation.mechanics.marker_noise import MarkerNoise
from manytouch.simulation.demo_sensor import demo_sensor


def test_rest_positions_of_few_frames_widen_the_deviation_by_the_noise_of_their_mean() -> None:
    noise, sensor = MarkerNoise(), replace(demo_sensor(640), centre_noise_px=0.3)
    of_model = noise.unexplained_std_px(20.0, 1.3)
    assert noise.constant_std_px(20.0, 1.3, sensor) == pytest.approx(of_model)
    for frames in (1, 4, 15, 24):
        found = noise.constant_std_px(20.0, 1.3, replace(sensor, provenance={"rest_frames": frames}))
        excess = max(0.0, 1.0 / frames - 1.0 / 15.0)
        assert found == pytest.approx(np.hypot(of_model, 0.3 * excess**0.5))
    listed = replace(sensor, provenance={"still_frames": [0, 1, 2, 5]})
    assert listed.rest_frames == 4


def test_what_the_model_does_not_explain_grows_with_the_pitch_up_to_some_thicknesses() -> None:
    noise = MarkerNoise()
    fine, limit, coarse = (noise.unexplained_std_px(10.0 * pitch, pitch) for pitch in (1.0, 2.0, 5.0))
    assert limit == pytest.approx(2.0 * fine)
    assert coarse == pytest.approx(limit)
