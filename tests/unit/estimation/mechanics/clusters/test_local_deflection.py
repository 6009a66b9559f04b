"""The dent that elements cannot show, against scipy's interpolation of the same table."""

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from manytouch.estimation.mechanics.clusters.local_deflection import missing_depth

RANDOM = np.random.default_rng(0)
TABLE_PER_MM = RANDOM.normal(size=(3, 3, 21, 21))


def expected(force_at: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(m,) depth of one unit force: from a knot the table is mirrored beyond the middle of an element."""
    inside = force_at % 1.0
    sign = np.where(inside > 0.5, -1.0, 1.0)
    offset = np.where(inside > 0.5, 1.0 - inside, inside)
    axes = (np.linspace(0.0, 0.5, 3),) * 2 + (np.linspace(-2.5, 2.5, 21),) * 2
    table = RegularGridInterpolator(axes, TABLE_PER_MM, bounds_error=False, fill_value=0.0)
    away = (place - force_at) * sign
    return np.asarray(table(np.column_stack([np.tile(offset, (len(place), 1)), away])))


@pytest.mark.parametrize("seed", range(3))
def test_depths_are_interpolated(seed: int) -> None:
    random = np.random.default_rng(seed)
    force_at, force_mm2 = random.uniform(3.0, 6.0, (4, 2)), random.uniform(0.1, 1.0, 4)
    place = random.uniform(0.0, 9.0, (50, 2))
    found = missing_depth(force_at, force_mm2, place, TABLE_PER_MM)
    each = np.array([expected(at, place) for at in force_at])
    np.testing.assert_allclose(found, force_mm2 @ each, atol=1e-12)
    assert np.abs(found).max() > 0.1
