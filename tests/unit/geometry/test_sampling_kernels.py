"""The compiled product of splines against a plain matrix product."""

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline, make_interp_spline

from manytouch.geometry.sampling import Spline
from manytouch.geometry.sampling_kernels import evaluate_at_points, evaluate_on_grid


def spline(knot: np.ndarray, at: np.ndarray) -> Spline:
    """The cubic spline through values at knots, with its four taps at each position."""
    through = make_interp_spline(knot, np.eye(len(knot)), k=3)
    first = np.clip(np.searchsorted(through.t, at, side="right") - 1, 3, len(knot) - 1) - 3
    basis = np.stack([through.__class__(through.t, row, 3)(at) for row in np.eye(len(knot))], axis=1)
    tap = np.take_along_axis(basis, first[:, None] + np.arange(4), axis=1)
    return Spline(solve=np.ascontiguousarray(through.c.T), first=first, tap=tap, whole=through(at))


@pytest.mark.parametrize(("rows", "columns"), [(5, 8), (9, 6)])
def test_the_grid_equals_the_product_of_the_splines(rows: int, columns: int) -> None:
    chance = np.random.default_rng(rows)
    x, y = np.arange(float(columns)), np.arange(float(rows))
    at_x, at_y = chance.uniform(0.0, columns - 1.0, 23), chance.uniform(0.0, rows - 1.0, 17)
    along_x, along_y = spline(x, np.sort(at_x)), spline(y, np.sort(at_y))
    value = chance.normal(0.0, 1.0, rows * columns)
    order = chance.permutation(rows * columns)
    found = evaluate_on_grid(value, order, along_y, along_x)
    lattice = value[order].reshape(rows, columns)
    np.testing.assert_allclose(found, along_y.whole @ lattice @ along_x.whole.T, atol=1e-12)
    expected = RectBivariateSpline(y, x, lattice, kx=3, ky=3)(np.sort(at_y), np.sort(at_x))
    np.testing.assert_allclose(found, expected, atol=1e-10)
    values = chance.normal(0.0, 1.0, (3, rows * columns))
    place = np.column_stack([chance.integers(0, 17, 5), chance.integers(0, 23, 5)])
    grids = [evaluate_on_grid(each, order, along_y, along_x) for each in values]
    expected = [grid[place[:, 0], place[:, 1]] for grid in grids]
    some = evaluate_at_points(values, order, along_y, along_x, place)
    np.testing.assert_allclose(some, expected, atol=1e-12)
