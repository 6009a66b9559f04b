"""Values anywhere on the sheet: constants, planes, smoothness, gaps and the edge."""

import numpy as np
import pytest

from layouts import lattice_layout, marker_layout
from manytouch.geometry.sampling import sampling_at, sampling_on
from manytouch.values import Layout

CHANCE = np.random.default_rng(7)


def layout(place_mm: np.ndarray, row_column: np.ndarray | None, pitch_mm: tuple[float, float]) -> Layout:
    return marker_layout(place_mm, row_column=row_column, pitch_mm=pitch_mm)


def lattice(rows: int = 6, columns: int = 9) -> Layout:
    return lattice_layout(rows, columns, (4.0, 5.0))


def uneven() -> Layout:
    """A lattice as it is measured: no marker lies quite where it should."""
    whole = lattice()
    place = whole.rest_mm[:, :2] + CHANCE.normal(0, 0.3, (len(whole.rest_mm), 2))
    return layout(place, whole.row_column, (4.0, 5.0))


def rings() -> Layout:
    place = [[0.0, 0.0]]
    for ring in range(1, 6):
        angle = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        place += (4.0 * ring * np.column_stack([np.cos(angle), np.sin(angle)])).tolist()
    return layout(np.array(place), None, (4.0, 4.0))


LAYOUTS = pytest.mark.parametrize("some", [lattice(), uneven(), rings()], ids=["lattice", "uneven", "rings"])


@LAYOUTS
def test_planes_come_back_exactly_also_beyond_the_outer_markers(some: Layout):
    place = some.rest_mm[:, :2]
    x, y = np.linspace(-18, 18, 31), np.linspace(-14, 14, 23)
    sampling = sampling_on(some, x, y)
    expected = 3.0 + 0.5 * x - 0.25 * y[:, None]
    found = sampling(3.0 + place @ [0.5, -0.25])
    inside = np.isfinite(found)
    assert inside.mean() > 0.6
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-9)


@LAYOUTS
def test_weights_sum_to_one_and_points_agree_with_the_grid(some: Layout):
    value = CHANCE.normal(size=len(some.rest_mm))
    x, y = np.linspace(-15, 15, 8), np.linspace(-11, 11, 5)
    point = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = sampling_at(some, point)
    np.testing.assert_allclose(points.weight.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(points(value), sampling_on(some, x, y)(value).ravel(), atol=1e-9)
    std = np.full(len(value), 0.1)
    np.testing.assert_allclose(points.std(std), sampling_on(some, x, y).std(std).ravel(), atol=1e-9)


@LAYOUTS
def test_far_outside_is_not_known(some: Layout):
    far = np.array([[60.0, 0.0], [0.0, -40.0]])
    assert np.isnan(sampling_at(some, far)(np.ones(len(some.rest_mm)))).all()
    x, y = np.array([0.0, 60.0]), np.array([0.0, 1.0, 2.0])
    assert np.isnan(sampling_on(some, x, y)(np.ones(len(some.rest_mm)))[:, 1]).all()


def test_a_lattice_goes_through_its_values_and_is_smooth():
    some = lattice()
    value = np.sin(some.rest_mm[:, 0] / 8.0) * np.cos(some.rest_mm[:, 1] / 9.0)
    np.testing.assert_allclose(sampling_at(some, some.rest_mm[:, :2])(value), value, atol=1e-12)
    x, y = np.linspace(-16, 16, 200), np.linspace(-12, 12, 120)
    found = sampling_on(some, x, y)(value)
    np.testing.assert_allclose(found, np.sin(x / 8.0) * np.cos(y / 9.0)[:, None], atol=0.02)


@LAYOUTS
def test_samples_are_continuous(some: Layout):
    value = CHANCE.normal(size=len(some.rest_mm))
    along = np.column_stack([np.linspace(-12, 12, 4001), np.full(4001, 1.3)])
    found = sampling_at(some, along)(value)
    assert np.abs(np.diff(found)).max() < 0.03


@LAYOUTS
def test_missing_values_are_gaps_where_they_are_missing_only(some: Layout):
    value = np.ones(len(some.rest_mm))
    lost = int(np.argmin(np.linalg.norm(some.rest_mm[:, :2] - [2.0, 3.0], axis=1)))
    value[lost] = np.nan
    found = sampling_at(some, np.array([some.rest_mm[lost, :2], [-10.0, -6.0]]))(value)
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(1.0)
    nothing = sampling_at(some, some.rest_mm[:3, :2])(np.full(len(value), np.nan))
    assert np.isnan(nothing).all()


@LAYOUTS
def test_the_deviation_is_that_of_many_trials(some: Layout):
    point = np.array([[1.1, 2.2], [-6.3, 4.0], [9.9, -7.7]])
    std = CHANCE.uniform(0.5, 2.0, len(some.rest_mm))
    sampling = sampling_at(some, point)
    trials = np.array([sampling(CHANCE.normal(0, std)) for _ in range(3000)])
    np.testing.assert_allclose(trials.std(axis=0), sampling.std(std), rtol=0.08)


@LAYOUTS
@pytest.mark.parametrize("count", [3, 500])
def test_some_points_of_a_grid_are_those_of_the_whole(some: Layout, count: int):
    x_mm, y_mm = np.linspace(-14, 14, 23), np.linspace(-9, 9, 17)
    on = sampling_on(some, x_mm, y_mm)
    chance = np.random.default_rng(3)
    place = np.column_stack([chance.integers(17, size=count), chance.integers(23, size=count)])
    values = chance.normal(size=(3, len(some.rest_mm)))
    for _ in range(2):
        expected = [on(value)[place[:, 0], place[:, 1]] for value in values]
        np.testing.assert_allclose(on.at(values, place), expected, rtol=1e-12, atol=1e-12)
        values[1, len(some.rest_mm) // 2] = np.nan
