"""The surface by inverse distance weighting against its formula, and where it is not known."""

from dataclasses import replace

import numpy as np
import pytest

from layouts import lattice_layout
from manytouch.errors import ManytouchError
from manytouch.geometry.surface_sampling import sampler_at, sampler_on
from manytouch.values import Interpolation, Surface

LAYOUT = lattice_layout(5, 7, np.array([4.0, 4.0]))
COUNT = len(LAYOUT.rest_mm)
LOW_MM, HIGH_MM = LAYOUT.rest_mm[:, :2].min(axis=0), LAYOUT.rest_mm[:, :2].max(axis=0)


def surface_of(depth_mm: np.ndarray, **named: float) -> Surface:
    displacement_mm = np.column_stack([0.1 * depth_mm, np.zeros(COUNT), -depth_mm])
    return Surface(
        position_mm=LAYOUT.rest_mm + displacement_mm,
        displacement_mm=displacement_mm,
        covariance_mm2=np.tile(0.01 * np.eye(3), (COUNT, 1, 1)),
        layout=LAYOUT,
        interpolation=Interpolation(kind="idw", **named),
    )


def plain(at_mm: np.ndarray, value: np.ndarray, *, radius_mm: float, power: float) -> float:
    """Table 2 of the paper at one point."""
    away = np.hypot(*(LAYOUT.rest_mm[:, :2] - at_mm).T)
    use = (away <= radius_mm) & np.isfinite(value)
    weight = np.maximum(away[use], 1e-6 * radius_mm) ** -power
    return float((weight * value[use]).sum() / weight.sum())


def test_points_of_the_plane_follow_the_formula_and_others_are_linear_between_them() -> None:
    depth_mm = np.random.default_rng(2).uniform(0, 5, COUNT)
    surface = surface_of(depth_mm, iterations=9, search_radius_pitch=2.0, power=3.0)
    x_mm, y_mm = np.linspace(LOW_MM, HIGH_MM, 9).T
    at_points = sampler_on(LAYOUT, np.ascontiguousarray(x_mm), np.ascontiguousarray(y_mm)).depth(surface)
    formula = [[plain(np.array([x, y]), depth_mm, radius_mm=8.0, power=3.0) for x in x_mm] for y in y_mm]
    np.testing.assert_allclose(at_points, formula, atol=1e-9)
    between_mm = np.array([[0.25 * x_mm[3] + 0.75 * x_mm[4], 0.5 * y_mm[6] + 0.5 * y_mm[7]]])
    shares = 0.5 * (at_points[6] + at_points[7])
    expected = 0.25 * shares[3] + 0.75 * shares[4]
    assert sampler_at(LAYOUT, between_mm).depth(surface) == pytest.approx(expected, abs=1e-9)
    moved = sampler_at(LAYOUT, between_mm).displacement(surface)
    np.testing.assert_allclose(moved, [[0.1 * expected, 0.0, -expected]], atol=1e-9)
    assert sampler_at(LAYOUT, between_mm).depth_std(surface) == pytest.approx(0.1)


def test_nothing_is_known_outside_the_markers_or_beyond_the_search_radius() -> None:
    depth_mm = np.full(COUNT, 2.0)
    depth_mm[: COUNT // 2] = np.nan
    point_mm = np.array([HIGH_MM, HIGH_MM + np.array([0.5, 0.0]), LOW_MM, HIGH_MM - [0.01, 0.01]])
    found = sampler_at(LAYOUT, point_mm).depth(surface_of(depth_mm, search_radius_pitch=1.0))
    np.testing.assert_array_equal(found, [2.0, np.nan, np.nan, 2.0])


def test_each_surface_is_evaluated_by_its_own_interpolation() -> None:
    depth_mm = np.zeros(COUNT)
    depth_mm[COUNT // 2] = 3.0
    idw = surface_of(depth_mm)
    sampler = sampler_at(LAYOUT, np.array([[1.7, 0.4]]))
    spline = replace(idw, interpolation=Interpolation())
    first, second = sampler.depth(idw), sampler.depth(spline)
    assert abs(first - second).item() > 0.1
    np.testing.assert_array_equal(sampler.depth(idw), first)
    coarse = surface_of(depth_mm, iterations=4)
    assert sampler.depth(coarse) != pytest.approx(first)


def test_strain_is_known_up_to_the_edge_of_the_plane() -> None:
    surface = surface_of(np.zeros(COUNT))
    stretched = np.column_stack([0.1 * LAYOUT.rest_mm[:, 0], np.zeros((COUNT, 2))])
    strain = sampler_at(LAYOUT, np.array([HIGH_MM, [0.0, 0.0]])).strain(
        replace(surface, displacement_mm=stretched)
    )
    assert np.isfinite(strain).all()


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"iterations": 1}, "number of iterations is 1: give a number from 2 to 300"),
        ({"iterations": 10**6}, "from 2 to 300"),
        ({"search_radius_pitch": 100.0}, "search radius in pitches is 100"),
        ({"power": float("nan")}, "power of the distance"),
    ],
)
def test_numbers_beyond_their_limits_are_refused(numbers: dict[str, float], words: str) -> None:
    with pytest.raises(ManytouchError, match=words):
        Interpolation(kind="idw", **numbers)
