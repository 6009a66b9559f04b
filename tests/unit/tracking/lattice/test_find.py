"""Rows and columns of unordered dots, in any view."""

import numpy as np
import pytest

from manytouch.tracking.lattice.find import find_lattice, predict_positions


def lattice_px(rows=7, columns=11, pitch=(40.0, 31.0)):
    row, column = np.indices((rows, columns))
    return np.column_stack([column.ravel() * pitch[0], row.ravel() * pitch[1]]) + np.array([60.0, 45.0])


def warped(points, *, angle=0.0, perspective=0.0, shear=0.0, barrel=0.0):
    centre = points.mean(axis=0)
    p = (points - centre) / np.ptp(points, axis=0).max()
    p = p @ np.array([[1.0, 0.0], [shear, 1.0]])
    p = p @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    p = p / (1.0 + perspective * p[:, :1])
    p = p * (1.0 - barrel * (p**2).sum(axis=1, keepdims=True))
    return p * np.ptp(points, axis=0).max() + [400.0, 300.0]


def assert_same_lattice(place, expected):
    """Places agree up to a change of the lattice's basis and origin."""
    design = np.column_stack([expected, np.ones(len(expected))])
    change, residual, *_ = np.linalg.lstsq(design, place, rcond=None)
    np.testing.assert_allclose(design @ change, place, atol=1e-6)
    assert abs(abs(np.linalg.det(change[:2])) - 1.0) < 1e-6
    assert residual is not None


WARPS = [
    {},
    {"angle": 0.4},
    {"angle": np.pi / 4},
    {"perspective": 0.5},
    {"shear": 0.6},
    {"barrel": 0.35},
    {"angle": -1.1, "perspective": 0.3, "shear": 0.3, "barrel": 0.1},
]


@pytest.mark.parametrize("warp", WARPS)
def test_every_dot_gets_its_row_and_column(warp):
    rows, columns = 7, 11
    points = warped(lattice_px(rows, columns), **warp)
    rng = np.random.default_rng(4)
    order = rng.permutation(len(points))
    found = find_lattice(points[order] + rng.normal(0.0, 0.3, points.shape))
    assert found is not None
    assert found.is_member.all()
    assert not found.is_closed
    expected = np.argwhere(np.ones((rows, columns)))[order]
    assert_same_lattice(found.place, expected)


def test_missing_and_false_dots_do_not_shift_the_others():
    rng = np.random.default_rng(7)
    points = warped(lattice_px(9, 13), angle=0.2, perspective=0.2)
    expected = np.argwhere(np.ones((9, 13)))
    kept = rng.random(len(points)) > 0.15
    cell = rng.choice(np.flatnonzero((expected[:, 0] < 8) & (expected[:, 1] < 12)), 12, replace=False)
    false = 0.5 * (points[cell] + points[cell + 14]) + rng.normal(0.0, 1.0, (12, 2))
    dots = np.concatenate([points[kept], false])
    found = find_lattice(dots)
    assert found is not None
    true = np.arange(len(dots)) < kept.sum()
    assert found.is_member[true].mean() > 0.97
    member = true & found.is_member
    assert_same_lattice(found.place[member], expected[kept][member[true]])
    assert found.is_member[~true].sum() == 0


def test_a_squeezed_row_stays_a_row():
    points = lattice_px(8, 10, pitch=(17.0, 17.0))
    points[points[:, 1] > points[30, 1], 1] -= 6.0
    found = find_lattice(warped(points, angle=0.5, perspective=0.4))
    assert found is not None
    assert found.is_member.all()
    assert_same_lattice(found.place, np.argwhere(np.ones((8, 10))))


def test_rings_are_closed():
    ring, spoke = np.indices((6, 16))
    radius, angle = 60.0 + 25.0 * ring.ravel(), spoke.ravel() * 2 * np.pi / 16
    points = np.column_stack([radius * np.cos(angle) + 320.0, radius * np.sin(angle) + 240.0])
    found = find_lattice(points)
    assert found is None or found.is_closed or found.is_member.mean() < 0.6


def test_too_few_dots_are_not_a_lattice():
    assert find_lattice(np.array([[0.0, 0.0], [5.0, 1.0], [2.0, 8.0]])) is None


@pytest.mark.parametrize("share_empty", [0.0, 0.3, 0.8, 1.0])
def test_predicted_positions_are_medians_over_what_the_neighbours_predict(share_empty: float) -> None:
    random = np.random.default_rng(4)
    position = random.normal(size=(7, 5, 2))
    position[random.random((7, 5)) < share_empty] = np.nan

    found, support = predict_positions(position)

    wide = np.pad(position, ((2, 2), (2, 2), (0, 0)), constant_values=np.nan)
    for row, column in np.ndindex(7, 5):
        here = wide[row : row + 5, column : column + 5]
        along = [
            2.0 * here[2 + r, 2 + c] - here[2 + 2 * r, 2 + 2 * c]
            for r, c in ((0, 1), (0, -1), (1, 0), (-1, 0))
        ]
        corner = [here[2 + r, 2] + here[2, 2 + c] - here[2 + r, 2 + c] for r in (-1, 1) for c in (-1, 1)]
        known = [each for each in along + corner if np.isfinite(each[0])]
        assert support[row, column] == len(known)
        expected = np.median(known, axis=0) if known else np.full(2, np.nan)
        assert np.array_equal(found[row, column], expected, equal_nan=True)
