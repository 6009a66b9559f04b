"""The pressure map against the forces that it comes from."""

import numpy as np
import pytest

from manytouch.mechanics.patch import SplinePatch
from manytouch.sinks.viewer.pressure import PressureMap
from manytouch.values import SheetSpline

SIZE_MM, YOUNG_MPA = (120.0, 80.0), 2.0
PATCH = SplinePatch(size_mm=SIZE_MM, elements=(30, 20))


def spline_of(force_N: np.ndarray, young_MPa: float | None = YOUNG_MPA) -> SheetSpline:
    over_E = np.zeros((PATCH.node_count, 3))
    over_E[:, 2] = force_N / YOUNG_MPA
    return SheetSpline(
        size_mm=SIZE_MM,
        centre_mm=(0.0, 0.0),
        elements=(30, 20),
        is_clamped=True,
        thickness_mm=3.0,
        poisson=0.45,
        coefficient_mm=np.zeros((PATCH.node_count, 3)),
        force_over_E_mm2=over_E,
        young_MPa=young_MPa,
    )


def test_its_integral_is_the_force_and_its_peak_is_where_it_presses() -> None:
    at_mm = np.array([[-20.0, 10.0]])
    force_N = PATCH.load(at_mm, np.array([-3.0]))
    x_mm, y_mm = np.linspace(-60, 60, 241), np.linspace(-40, 40, 161)
    found = PressureMap(x_mm, y_mm)(spline_of(force_N))
    assert found is not None
    total_N = np.trapezoid(np.trapezoid(found, x_mm, axis=1), y_mm) * 1e-3
    assert total_N == pytest.approx(3.0, rel=0.01)
    row, column = np.unravel_index(int(found.argmax()), found.shape)
    assert abs(x_mm[column] + 20.0) < 1.0
    assert abs(y_mm[row] - 10.0) < 1.0


def test_without_a_modulus_there_is_no_pressure() -> None:
    grid = np.linspace(-10.0, 10.0, 5)
    assert PressureMap(grid, grid)(spline_of(np.zeros(PATCH.node_count), None)) is None
