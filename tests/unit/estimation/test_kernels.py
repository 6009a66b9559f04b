"""Compiled loops that estimators share, against plain numpy."""

import numpy as np

from manytouch.estimation.kernels import median_where, neighbour_agreement


def test_weights_of_vectors_by_their_neighbours() -> None:
    random = np.random.default_rng(2)
    vector, std = random.normal(0.0, 1.0, (60, 2)), random.uniform(0.1, 0.3, 60)
    is_seen = random.random(60) > 0.3
    neighbour = random.integers(60, size=(60, 5))
    expected = np.zeros(60)
    for m in np.flatnonzero(is_seen):
        near = neighbour[m][is_seen[neighbour[m]]]
        if len(near) < 3:
            expected[m] = 1.0
            continue
        middle = np.median(vector[near], axis=0)
        scale = 3.0 * std[m] + 1.5 * np.median(np.linalg.norm(vector[near] - middle, axis=1))
        distance = np.linalg.norm(vector[m] - middle) / scale
        expected[m] = max(1.0 - distance**2, 0.0) ** 2
    found = neighbour_agreement(vector, std, is_seen, neighbour, 3.0, 1.5)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert len(set(np.round(found, 6))) > 10


def test_the_median_of_known_values() -> None:
    value = np.array([5.0, np.nan, 1.0, 2.0])
    assert median_where(value, np.isfinite(value)) == 2.0
