"""Maps against shapes and forces of which all is known."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.shell import Shell
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.maps import SheetMaps
from manytouch.values import SheetSpline, Surface

SIZE_MM, YOUNG_MPA, THICKNESS_MM = (120.0, 80.0), 2.0, 3.0
PATCH = SplinePatch(size_mm=SIZE_MM, elements=(30, 20))
LAYOUT = demo_sensor(320).layout
X_MM, Y_MM = np.linspace(-58, 58, 233), np.linspace(-38, 38, 153)


def surface_of(
    displacement_mm: np.ndarray, spline: SheetSpline | None = None, *, std_mm: float = 0.1
) -> Surface:
    covariance = np.tile(std_mm**2 * np.eye(3), (len(displacement_mm), 1, 1))
    return Surface(
        position_mm=LAYOUT.rest_mm + displacement_mm,
        displacement_mm=displacement_mm,
        covariance_mm2=covariance,
        spline=spline,
    )


def spline_of(*, force_N: np.ndarray | None = None, coefficient_mm: np.ndarray | None = None) -> SheetSpline:
    over_E = np.zeros((PATCH.node_count, 3))
    if force_N is not None:
        over_E[:, 2] = force_N / YOUNG_MPA
    still = np.zeros((PATCH.node_count, 3))
    return SheetSpline(
        size_mm=SIZE_MM,
        centre_mm=(0.0, 0.0),
        elements=(30, 20),
        is_clamped=True,
        thickness_mm=THICKNESS_MM,
        poisson=0.45,
        coefficient_mm=still if coefficient_mm is None else coefficient_mm,
        force_over_E_mm2=over_E,
        young_MPa=YOUNG_MPA,
    )


@pytest.fixture(scope="module")
def maps() -> SheetMaps:
    return SheetMaps(LAYOUT, X_MM, Y_MM)


def test_pressure_adds_up_to_the_force_and_peaks_where_it_presses(maps: SheetMaps) -> None:
    force_N = PATCH.load(np.array([[-20.0, 10.0]]), np.array([-3.0]))
    found = maps.pressure_kPa(surface_of(np.zeros_like(LAYOUT.rest_mm), spline_of(force_N=force_N)))
    assert found is not None
    total_N = np.trapezoid(np.trapezoid(found, X_MM, axis=1), Y_MM) * 1e-3
    assert total_N == pytest.approx(3.0, rel=0.01)
    row, column = np.unravel_index(int(found.argmax()), found.shape)
    assert abs(X_MM[column] + 20.0) < 1.0
    assert abs(Y_MM[row] - 10.0) < 1.0


def test_without_a_modulus_or_forces_there_is_no_pressure(maps: SheetMaps) -> None:
    still = np.zeros_like(LAYOUT.rest_mm)
    assert maps.pressure_kPa(surface_of(still, replace(spline_of(), young_MPa=None))) is None
    assert maps.pressure_kPa(surface_of(still)) is None


def test_a_spline_is_sampled_itself_and_not_between_the_markers(maps: SheetMaps) -> None:
    """A dent as narrow as the pitch, which values at the markers do not tell."""
    coefficient_mm = np.zeros((PATCH.node_count, 3))
    middle = np.argmin(np.hypot(*(PATCH.place_mm - (2.0, 2.0)).T))
    coefficient_mm[middle, 2] = -1.5
    spline = spline_of(coefficient_mm=coefficient_mm)
    shell = Shell(patch=PATCH, thickness_mm=THICKNESS_MM, poisson=0.45)
    at_markers = Face(shell=shell, point_mm=np.ascontiguousarray(LAYOUT.rest_mm[:, :2]))
    surface = surface_of(at_markers.displacement(coefficient_mm), spline)
    column, row = int(np.argmin(np.abs(X_MM - 2.0))), int(np.argmin(np.abs(Y_MM - 2.0)))
    there = Face(shell=shell, point_mm=np.array([[X_MM[column], Y_MM[row]]]))
    depth = maps.depth(surface)
    assert depth[row, column] == pytest.approx(-there.displacement(coefficient_mm)[0, 2], abs=1e-12)
    lower = surface.displacement_mm - [0.0, 0.0, 0.25]
    np.testing.assert_allclose(maps.depth(replace(surface, displacement_mm=lower)), depth + 0.25, atol=1e-9)
    between = maps.depth(replace(surface, spline=None))
    assert np.nanmax(np.abs(between - depth)) > 0.005, "the test would not tell the two apart"


def test_strain_of_a_stretched_and_tilted_sheet(maps: SheetMaps) -> None:
    x, y = LAYOUT.rest_mm[:, 0], LAYOUT.rest_mm[:, 1]
    moved = np.column_stack([0.1 * x, 0.02 * y, -0.3 * x])
    found = maps.strain(surface_of(moved))
    np.testing.assert_allclose(found[10:-10, 10:-10], 0.1 + 0.5 * (0.1**2 + 0.3**2), rtol=1e-6)
    sheared = np.column_stack([0.2 * y, 0.0 * x, 0.0 * x])
    xx, yy, xy = 0.0, 0.5 * 0.2**2, 0.5 * 0.2
    largest = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    np.testing.assert_allclose(maps.strain(surface_of(sheared))[10:-10, 10:-10], largest, rtol=1e-6)


def test_turning_is_no_strain(maps: SheetMaps) -> None:
    x, y = LAYOUT.rest_mm[:, 0], LAYOUT.rest_mm[:, 1]
    turn = 0.3
    moved = np.column_stack(
        [x * (np.cos(turn) - 1) - y * np.sin(turn), x * np.sin(turn) + y * (np.cos(turn) - 1), 0.0 * x]
    )
    assert np.nanmax(np.abs(maps.strain(surface_of(moved))[10:-10, 10:-10])) < 1e-9


def test_the_deviation_is_that_of_the_markers_around(maps: SheetMaps) -> None:
    std = maps.depth_std(surface_of(np.zeros_like(LAYOUT.rest_mm), std_mm=0.2))
    np.testing.assert_allclose(std[~np.isnan(std)], 0.2, rtol=0.02)
