"""The paper's depth: exact for a plane, and its covariance is that of many trials."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manytouch.estimation.perimeter.law import perimeter_law, perimeters
from manytouch.geometry.neighbours import lattice_cells, triangle_cells

ROWS, COLUMNS, DISTANCE = 5, 8, 90.0
ROW_COLUMN = np.column_stack(np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)).astype(np.int64)
PLACE = (ROW_COLUMN[:, ::-1] * [4.0, 5.0] - [14.0, 10.0]).astype(np.float64)
EYE = np.array([1.5, -2.0])
LAWS = pytest.mark.parametrize(
    "law",
    [
        perimeter_law(lattice_cells(ROW_COLUMN), PLACE, EYE, DISTANCE),
        perimeter_law(triangle_cells(PLACE + 0.3 * np.sin(PLACE[:, ::-1])), PLACE, EYE, DISTANCE),
    ],
    ids=["quads", "triangles"],
)
NOISE = 0.02**2 * np.array([[1.0, 0.3], [0.3, 0.6]]) * np.ones((len(PLACE), 1, 1))


def on_plane(point_mm: np.ndarray) -> np.ndarray:
    """Where the rays of points of the sheet meet its plane at rest."""
    return EYE + (point_mm[:, :2] - EYE) * (DISTANCE / (DISTANCE + point_mm[:, 2:]))


@LAWS
@pytest.mark.parametrize("z", [-7.0, -0.5, 0.0, 3.0])
def test_the_depth_of_a_plane_that_comes_nearer_is_exact(law, z: float):
    point = np.column_stack([PLACE, np.full(len(PLACE), z)])
    displacement, _ = law(on_plane(point), NOISE)
    np.testing.assert_allclose(displacement, [[0.0, 0.0, z]] * len(PLACE), atol=1e-9)


@LAWS
def test_a_rotation_in_the_plane_has_depth_zero(law):
    turn = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    displacement, _ = law(PLACE @ turn.T + [3.0, 1.0], NOISE)
    np.testing.assert_allclose(displacement[:, 2], 0.0, atol=1e-9)


@LAWS
def test_a_stretch_is_measured_as_depth(law):
    displacement, _ = law(1.01 * PLACE, NOISE)
    np.testing.assert_allclose(-displacement[:, 2], DISTANCE * (1 - 1 / 1.01), rtol=1e-9)


@LAWS
def test_the_covariance_is_that_of_many_trials(law):
    random = np.random.default_rng(5)
    point = np.column_stack([PLACE, -3.0 * np.exp(-(PLACE**2).sum(axis=1) / 100.0)])
    middle = on_plane(point)
    _, covariance = law(middle, NOISE)
    root = np.linalg.cholesky(NOISE[0])
    trials = np.array([law(middle + random.normal(size=PLACE.shape) @ root.T, NOISE)[0] for _ in range(2500)])
    off = trials - trials.mean(axis=0)
    observed = np.einsum("tmi,tmj->mij", off, off) / len(trials)
    scale = np.sqrt(np.einsum("mii->mi", covariance))
    ratio = (observed - covariance) / (scale[:, :, None] * scale[:, None, :])
    assert np.abs(ratio).max() < 0.15


def test_the_derivative_of_the_perimeter_is_its_finite_difference():
    corner = np.random.default_rng(2).uniform(0, 5, (6, 4, 2))
    corner[3, 3] = corner[3, 2]
    _, along = perimeters(corner)
    step = 1e-6
    for k in range(3):
        for axis in range(2):
            moved = corner.copy()
            moved[:, k, axis] += step
            if k == 2:
                moved[3, 3, axis] += step
            found = (perimeters(moved)[0] - perimeters(corner)[0]) / step
            expected = along[:, k, axis] + (np.arange(6) == 3) * (k == 2) * along[:, 3, axis]
            np.testing.assert_allclose(found, expected, atol=1e-5)


@settings(max_examples=25, deadline=None)
@given(
    angle=st.floats(-np.pi, np.pi),
    is_mirrored=st.booleans(),
    scale=st.floats(0.1, 10.0),
    seed=st.integers(0, 99),
)
def test_a_rotated_mirrored_or_scaled_sheet_has_such_displacements(
    angle: float, is_mirrored: bool, scale: float, seed: int
) -> None:
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]]) * [1.0, -1.0 if is_mirrored else 1.0]
    plane = PLACE + np.random.default_rng(seed).normal(0.0, 0.2, PLACE.shape)
    cells = lattice_cells(ROW_COLUMN)
    one, one_mm2 = perimeter_law(cells, PLACE, EYE, DISTANCE)(plane, NOISE)
    law = perimeter_law(cells, scale * PLACE @ turn.T, scale * turn @ EYE, scale * DISTANCE)
    other, other_mm2 = law(scale * plane @ turn.T, scale**2 * turn @ NOISE @ turn.T)
    whole = np.eye(3)
    whole[:2, :2] = turn
    np.testing.assert_allclose(other, scale * one @ whole.T, atol=1e-9 * scale)
    np.testing.assert_allclose(other_mm2, scale**2 * whole @ one_mm2 @ whole.T, atol=1e-12 * scale**2)
