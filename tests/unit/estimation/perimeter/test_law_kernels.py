"""The compiled loops of the paper's depth against plain numpy."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.law import PerimeterLaw, perimeter_law, perimeters
from manytouch.estimation.perimeter.law_inputs import LawErrors
from manytouch.estimation.perimeter.law_kernels import (
    add_depth_variances,
    law_displacements,
    law_error_variances,
    surface_at_markers,
)
from manytouch.geometry.neighbours import lattice_cells, triangle_cells

ROWS, COLUMNS, DISTANCE = 5, 7, 80.0
ROW_COLUMN = np.column_stack(np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)).astype(np.int64)
AXIS = np.array([1.5, -2.0])


def random_law(seed: int, *, has_lattice: bool) -> PerimeterLaw:
    rest = ROW_COLUMN[:, ::-1] * [4.0, 5.0] + np.random.default_rng(seed).normal(
        0.0, 0.3, (len(ROW_COLUMN), 2)
    )
    return perimeter_law(
        lattice_cells(ROW_COLUMN) if has_lattice else triangle_cells(rest), rest, AXIS, DISTANCE
    )


def random_covariances(random: np.random.Generator, count: int) -> np.ndarray:
    root = random.normal(0.0, 0.03, (count, 2, 2))
    return root @ root.transpose(0, 2, 1)


def plain_displacements(
    law: PerimeterLaw, plane: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, ...]:
    """The law with its whole Jacobian of (3 m, 2 m)."""
    count, cells = len(plane), law.cells
    perimeter, along = perimeters(plane[cells.corner])
    ratio = law.rest_perimeter_mm / perimeter
    slope = np.zeros((len(ratio), count, 2))
    for k in range(4):
        np.add.at(slope, (np.arange(len(ratio)), cells.corner[:, k]), along[:, k])
    slope *= (DISTANCE * ratio / perimeter)[:, None, None]
    depth, slope_m = np.zeros(count), np.zeros((count, count, 2))
    np.add.at(depth, cells.marker, cells.share * (DISTANCE * (1.0 - ratio))[cells.cell])
    np.add.at(slope_m, cells.marker, cells.share[:, None, None] * slope[cells.cell])
    ray = (plane - AXIS) / DISTANCE
    jacobian = np.zeros((count, 3, count, 2))
    jacobian[:, 2] = -slope_m
    jacobian[:, :2] = -ray[:, :, None, None] * slope_m[:, None]
    for m in range(count):
        jacobian[m, :2, m] += (1.0 - depth[m] / DISTANCE) * np.eye(2)
    displacement = np.column_stack([AXIS + (1.0 - depth / DISTANCE)[:, None] * (plane - AXIS), -depth])
    displacement[:, :2] -= law.rest_mm
    return displacement, np.einsum("mink,nkl,mjnl->mij", jacobian, covariance, jacobian)


@pytest.mark.parametrize("has_lattice", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_displacements_and_covariances(seed: int, has_lattice: bool) -> None:
    law, random = random_law(seed, has_lattice=has_lattice), np.random.default_rng(seed)
    plane = law.rest_mm + random.normal(0.0, 0.2, law.rest_mm.shape)
    covariance = random_covariances(random, len(plane))
    found = law_displacements(plane, law.rays, law.lists, covariance)
    expected = plain_displacements(law, plane, covariance)
    has_cell = np.isin(np.arange(len(plane)), law.cells.marker)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one[has_cell], other[has_cell], rtol=1e-9, atol=1e-12)
        assert np.isnan(one[~has_cell][:, -1]).all()


def random_errors(random: np.random.Generator, count: int) -> LawErrors:
    return LawErrors(
        neighbour=random.integers(count, size=(6, count)).astype(np.int32),
        slope=random.normal(0.0, 0.3, (6, count)),
        curvature=random.uniform(0.0, 0.3, (6, count)),
        noise_factor=1.5,
        spill=4.0,
        scale_std=0.1,
    )


def plain_errors(depth: np.ndarray, variance: np.ndarray, errors: LawErrors) -> np.ndarray:
    rise = depth[errors.neighbour] - depth
    total = np.zeros(len(depth))
    for weight in (errors.slope, errors.curvature):
        feigned = (weight**2 * variance[errors.neighbour]).sum(axis=0) + weight.sum(axis=0) ** 2 * variance
        total += np.maximum((weight * rise).sum(axis=0) ** 2 - errors.noise_factor * feigned, 0.0)
    shown = 0.5 * (depth**2 + (depth[errors.neighbour] ** 2).mean(axis=0))
    shown = shown + errors.spill * np.nanmean(depth**2)
    limited = total * shown / (np.sqrt(total) + np.sqrt(shown)) ** 2
    return limited + (errors.scale_std * depth) ** 2


@pytest.mark.parametrize("seed", range(3))
def test_errors_of_the_law(seed: int) -> None:
    random = np.random.default_rng(seed)
    depth, variance = random.normal(0.0, 2.0, 40), random.uniform(0.0, 0.1, 40)
    depth[3] = np.nan
    errors = random_errors(random, 40)
    found, expected = law_error_variances(depth, variance, errors), plain_errors(depth, variance, errors)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.isnan(found).any()


def test_the_surface_is_the_law_without_the_motion_of_the_view() -> None:
    law, random = random_law(1, has_lattice=True), np.random.default_rng(1)
    count = len(law.rest_mm)
    displacement, covariance = random.normal(0.0, 0.2, (count, 2)), random_covariances(random, count)
    view, errors = np.array([0.7, -0.3, 0.02]), random_errors(random, count)
    turn = np.array([[np.cos(0.02), -np.sin(0.02)], [np.sin(0.02), np.cos(0.02)]])
    plane = displacement - view[:2] + 2.0 * law.rest_mm - law.rest_mm @ turn.T
    expected, expected_mm2 = law_displacements(plane, law.rays, law.lists, covariance)
    error = plain_errors(-expected[:, 2], expected_mm2[:, 2, 2], errors)
    ray = np.column_stack([(law.rest_mm - AXIS) / DISTANCE, np.ones(count)])
    widened = expected_mm2.copy()
    add_depth_variances(widened, error, law.rays)
    np.testing.assert_allclose(
        widened, expected_mm2 + error[:, None, None] * ray[:, :, None] * ray[:, None], atol=1e-9
    )
    found, found_mm2 = surface_at_markers(displacement, view, law.rays, law.lists, covariance, errors)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(found_mm2, widened, rtol=1e-7, atol=1e-12)
