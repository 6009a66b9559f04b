"""The spline patch: what bicubic splines reproduce, in both orientations and with both boundaries."""

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from patches import PATCHES, bent


@pytest.fixture(params=list(PATCHES))
def patch(request: pytest.FixtureRequest) -> SplinePatch:
    return PATCHES[request.param]


@pytest.fixture
def bent_mm(patch: SplinePatch) -> np.ndarray:
    return bent(patch)


def points_of(patch: SplinePatch, count: int = 40) -> np.ndarray:
    share = np.random.default_rng(1).uniform(0.02, 0.98, (count, 2))
    return patch.corner_mm + share * np.array(patch.size_mm)


def test_the_short_side_runs_fastest(patch: SplinePatch) -> None:
    assert patch.shape[0] >= patch.shape[1]
    step = np.abs(patch.place_mm[1] - patch.place_mm[0])
    assert step[patch.axes[1]] > 0.0
    assert step[patch.axes[0]] == 0.0


def test_coefficients_at_greville_points_give_linear_fields_back() -> None:
    for patch in (
        SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary="soft", centre_mm=(3.0, 1.0)),
        SplinePatch(size_mm=(30.0, 40.0), elements=(7, 9), boundary="soft", centre_mm=(3.0, 1.0)),
    ):
        point = points_of(patch)
        at = patch.at(point)
        np.testing.assert_allclose(at.field(patch.place_mm), point, atol=1e-12)
        x, y = patch.place_mm[:, :1], patch.place_mm[:, 1:]
        np.testing.assert_allclose((at.dx * x[at.node, 0]).sum(axis=1), 1.0, atol=1e-12)
        np.testing.assert_allclose((at.dy * x[at.node, 0]).sum(axis=1), 0.0, atol=1e-12)
        np.testing.assert_allclose((at.dy * y[at.node, 0]).sum(axis=1), 1.0, atol=1e-12)


def test_derivatives_are_those_of_the_field(patch: SplinePatch, bent_mm: np.ndarray) -> None:
    point, h = points_of(patch), 1e-4
    at, w = patch.at(point), bent_mm[:, 2:]
    along_x, along_y = np.array([h, 0.0]), np.array([0.0, h])

    def field(shift: np.ndarray) -> np.ndarray:
        return patch.at(point + shift).field(w)[:, 0]

    middle = field(np.zeros(2))
    value = w[at.node, 0]
    for table, expected, within in (
        (at.dx, (field(along_x) - field(-along_x)) / (2 * h), 1e-6),
        (at.dy, (field(along_y) - field(-along_y)) / (2 * h), 1e-6),
        (at.dxx, (field(along_x) - 2 * middle + field(-along_x)) / h**2, 1e-4),
        (at.dyy, (field(along_y) - 2 * middle + field(-along_y)) / h**2, 1e-4),
        (
            at.dxy,
            (
                field(along_x + along_y)
                - field(along_x - along_y)
                - field(along_y - along_x)
                + field(-along_x - along_y)
            )
            / (4 * h**2),
            1e-4,
        ),
    ):
        np.testing.assert_allclose((table * value).sum(axis=1), expected, atol=within)


def test_a_clamped_outline_neither_moves_nor_turns() -> None:
    patch = SplinePatch(size_mm=(48.0, 36.0), elements=(11, 8))
    moved = np.random.default_rng(2).normal(size=(patch.node_count, 3)) * patch.is_free
    y = np.linspace(-18.0, 18.0, 9)
    at = patch.at(np.column_stack([np.full(9, 24.0), y]))
    np.testing.assert_allclose(at.field(moved), 0.0, atol=1e-12)
    np.testing.assert_allclose((at.dx * moved[at.node, 2]).sum(axis=1), 0.0, atol=1e-12)
    assert np.abs((at.dx * moved[at.node, 0]).sum(axis=1)).max() > 0.1


def test_loads_keep_their_sum_and_centroid(patch: SplinePatch) -> None:
    inner = np.array(patch.centre_mm) + np.random.default_rng(3).uniform(-6.0, 6.0, (20, 2))
    weight = np.linspace(0.5, 2.0, 20)
    nodal = patch.load(inner, weight)
    assert nodal.sum() == pytest.approx(weight.sum())
    np.testing.assert_allclose(nodal @ patch.place_mm, weight @ inner, rtol=1e-12, atol=1e-11)


def test_areas_sum_up_to_the_patch(patch: SplinePatch) -> None:
    if patch.boundary == "soft":
        assert patch.area_mm2.sum() == pytest.approx(np.prod(patch.size_mm))
    else:
        assert patch.area_mm2.sum() < np.prod(patch.size_mm)


def test_invalid_patches_raise() -> None:
    with pytest.raises(ValueError, match="4 elements or more"):
        SplinePatch(size_mm=(10.0, 10.0), elements=(3, 8))
    with pytest.raises(ValueError, match="must be positive"):
        SplinePatch(size_mm=(10.0, 0.0), elements=(8, 8))
