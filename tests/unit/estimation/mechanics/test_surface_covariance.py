"""Weights of the forces around a marker in its covariance."""

import numpy as np

from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.simulation.demo_sensor import demo_sensor


def test_the_weights_of_the_forces_are_gaussians_and_grow_in_number_with_the_markers_only() -> None:
    estimator, sensor = MechanicsEstimator(), demo_sensor(640)
    state = estimator.start(sensor)
    model, proximity = state.model, state.displacement_covariance.proximity
    reach_mm = estimator.surface_error.reach_thickness * model.thickness_mm
    away_mm = np.linalg.norm(model.layout.rest_mm[:, None, :2] - model.patch.place_mm, axis=2)
    np.testing.assert_allclose(
        proximity.toarray(), np.exp(-0.5 * (away_mm / reach_mm) ** 2), rtol=0.0, atol=1e-6
    )
    area_mm2 = np.pi * (6.0 * reach_mm) ** 2
    assert proximity.nnz <= len(model.layout.rest_mm) * area_mm2 / np.prod(model.nodes.element_mm)
