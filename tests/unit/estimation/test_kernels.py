"""Compiled loops that estimators share, against plain numpy."""

import numpy as np

from manytouch.estimation.kernels import (
    lengths_without_view,
    neighbour_agreement,
    solve_damped,
)


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


def test_damped_equations_are_solved() -> None:
    random = np.random.default_rng(3)
    root, right = random.normal(size=(6, 6)), random.normal(size=6)
    matrix = root @ root.T + 0.1 * np.eye(6)
    expected = np.linalg.solve(matrix + 0.3 * np.diag(np.diag(matrix)), right)
    np.testing.assert_allclose(solve_damped(np.tril(matrix), 0.3, right), expected, rtol=1e-9)
    assert np.isnan(solve_damped(-matrix, 0.0, right)).any()


def test_lengths_do_not_contain_the_motion_of_the_view() -> None:
    random = np.random.default_rng(4)
    view, is_seen = random.normal(size=(2, 80, 8)), random.random(80) > 0.1
    moved = (view @ random.normal(size=8)).T + random.normal(0.0, 0.01, (80, 2))
    touched = np.arange(12)
    moved[touched] += 1.0
    moved[~is_seen] = 0.0
    weight, size = is_seen.astype(np.float64), np.zeros(80)
    for _ in range(5):
        weighted = view * weight[:, None]
        gram = np.einsum("amp,amq->pq", weighted, view) + 1e-9 * 80 * np.eye(8)
        motion = np.linalg.solve(gram, np.einsum("amp,ma->p", weighted, moved))
        size = np.linalg.norm(moved - (view @ motion).T, axis=1)
        scale = 3.0 * np.median(size[is_seen]) + 1e-3
        weight = np.where(is_seen & (size < scale), (1.0 - (size / scale) ** 2) ** 2, 0.0)
    found = lengths_without_view(view, moved, is_seen, 5, 3.0)
    np.testing.assert_allclose(found, size, atol=1e-9)
    np.testing.assert_allclose(found[touched][is_seen[touched]], np.sqrt(2.0), atol=0.1)
