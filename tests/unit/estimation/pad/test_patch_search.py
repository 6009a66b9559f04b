"""Profiles of pressure that are chosen for a press of the suite: a flat punch that sticks."""

import numpy as np
import pytest

from layouts import grid_at
from manytouch.estimation.pad.estimator import PadEstimator
from manytouch.evaluation.suite.pads.cases import pads
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.evaluation.suite.pads.recording import pad_states
from manytouch.evaluation.suite.sensors import exact_sensor
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator


def test_a_punch_that_sticks_is_not_taken_for_a_weak_ring() -> None:
    """A ring under shear that points outwards has nearly the same images, with half the force."""
    (case,) = (each for each in pads("pads") if each.name == "flat-punch-3-mm-sticking")
    sensor = exact_sensor(true_pad(case, width_px=320, centre_noise_px=0.02))
    markers, _ = pad_states(case)[0]
    scene = SolidScene(name="press", time_s=np.array([0.0, 1.0]), states=(markers, markers), duration_s=1.0)
    position_px = Simulator(sensor=sensor, scene=scene).truth(0).grid.position_px
    estimate = PadEstimator()
    started = estimate.start(sensor)
    for seed in range(12):
        _, _, contacts = estimate.step(started, grid_at(position_px, noise_px=0.02, seed=seed))
        (found,) = contacts.touching
        assert found.force_N[2] == pytest.approx(markers.contacts[0].force_N[2], rel=0.25)
