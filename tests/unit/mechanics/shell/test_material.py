"""The neo-Hookean sheet in plane stress: how exact its fixed number of Newton steps is."""

import numpy as np
import pytest
from scipy.optimize import brentq

from manytouch.mechanics.shell.material import stress


def exact_stress(stretch: tuple[float, float], poisson: float) -> tuple[np.ndarray, np.ndarray]:
    """(2,) S11 and S22 for principal stretches, and about what they change by a relative unit of y.

    The thickness at which S33 is 0 is found by bracketing.
    """
    mu, bulk = 0.5 / (1.0 + poisson), 1.0 / (3.0 * (1.0 - 2.0 * poisson))
    c1, c2 = stretch[0] ** 2, stretch[1] ** 2

    def across(root: float) -> float:
        return 2.0 * mu * root**6 / (3.0 * c1 * c2) - mu * (c1 + c2) / 3.0 + bulk * (root**8 - root**5)

    root = brentq(across, 0.3, 3.0, xtol=1e-15, rtol=1e-15)
    m, by_area = mu / root**2, root**6 / (c1 * c2) / np.array([c1, c2])
    return m * (1.0 - by_area), m * (2.0 + 4.0 * by_area)


@pytest.mark.parametrize(
    ("limit", "least_poisson", "tolerance"), [(1.5, 0.0, 1e-6), (2.0, 0.0, 6e-3), (2.0, 0.45, 1e-3)]
)
def test_five_newton_steps_are_exact_for_the_stretches_that_occur(
    limit: float, least_poisson: float, tolerance: float
) -> None:
    for poisson in np.linspace(least_poisson, 0.499, 6):
        mu, bulk = 0.5 / (1.0 + poisson), 1.0 / (3.0 * (1.0 - 2.0 * poisson))
        for first in np.geomspace(1.0 / limit, limit, 9):
            for second in np.geomspace(1.0 / limit, limit, 9):
                exact, by_root = exact_stress((first, second), poisson)
                found = stress(0.5 * (first**2 - 1.0), 0.5 * (second**2 - 1.0), 0.0, mu, bulk)
                assert np.all(np.abs(found[:2] - exact) < tolerance * by_root)
