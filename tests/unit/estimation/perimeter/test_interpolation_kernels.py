"""The compiled interpolation of unseen markers against plain numpy."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.interpolation_kernels import interpolate_unseen
from manytouch.estimation.perimeter.surface_inputs import InterpolationRule
from manytouch.geometry.neighbours import nearest_neighbours


def plain_interpolation(
    displacement: np.ndarray, covariance: np.ndarray, is_seen: np.ndarray, rule: InterpolationRule
) -> tuple[np.ndarray, np.ndarray]:
    displacement = np.where(is_seen[:, None], displacement, 0.0)
    covariance = np.where(is_seen[:, None, None], covariance, rule.unknown_std**2 * np.eye(2))
    known = is_seen.copy()
    for _ in range(rule.rounds):
        rim = np.flatnonzero(~known & known[rule.neighbour].any(axis=1))
        for m in rim:
            near = rule.neighbour[m][known[rule.neighbour[m]]]
            weight = rule.distance[m][known[rule.neighbour[m]]] ** -2.0
            weight /= weight.sum()
            displacement[m] = weight @ displacement[near]
            off = displacement[near] - displacement[m]
            each = covariance[near] + rule.spread * off[:, :, None] * off[:, None]
            covariance[m] = np.einsum("k,kij->ij", weight, each) + rule.floor**2 * np.eye(2)
        known[rim] = True
    return displacement, covariance


@pytest.mark.parametrize("rounds", [1, 3, 32])
@pytest.mark.parametrize("seen_share", [0.0, 0.1, 0.7])
def test_displacements_and_covariances(seen_share: float, rounds: int) -> None:
    random = np.random.default_rng(rounds)
    place = random.uniform(0.0, 20.0, (80, 2))
    neighbours = nearest_neighbours(place)
    rule = InterpolationRule(neighbours.index, neighbours.distance, 1.3, 0.02, 1.1, rounds)
    root = random.normal(0.0, 0.1, (80, 2, 2))
    is_seen = random.random(80) < seen_share
    given = random.normal(0.0, 1.0, (80, 2)), root @ root.transpose(0, 2, 1)
    found = interpolate_unseen(*given, is_seen, rule)
    for one, other in zip(found, plain_interpolation(*given, is_seen, rule), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)
