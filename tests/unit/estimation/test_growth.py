"""How dots grow: the witness of contacts that is local."""

import numpy as np
import pytest

from manytouch.estimation.growth import DotGrowth
from manytouch.estimation.load import LoadModel
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.simulation.sensor import demo_sensor
from manytouch.values import Sensor, TrackedGrid

ROWS, COLUMNS = 5, 7
PLANE_MM = np.stack(np.meshgrid(np.arange(COLUMNS) * 4.0, np.arange(ROWS) * 4.0), axis=-1).reshape(-1, 2)
NEIGHBOURS = nearest_neighbours(PLANE_MM)


def grid(area_px2: np.ndarray | None, variance_px2: float = 1e-4) -> TrackedGrid:
    markers = len(PLANE_MM)
    seen = np.ones(markers, dtype=np.bool_) if area_px2 is None else np.isfinite(area_px2)
    covariance = np.where(seen[:, None, None], variance_px2 * np.eye(2), np.nan)
    return TrackedGrid(
        position_px=np.where(seen[:, None], PLANE_MM * 10.0, np.nan),
        covariance_px2=covariance,
        is_seen=seen,
        frames_unseen=np.where(seen, 0, 1).astype(np.int64),
        area_px2=area_px2,
    )


def test_growth_is_the_change_of_the_logarithm() -> None:
    rest = np.log(np.linspace(100.0, 200.0, len(PLANE_MM)))
    growth = DotGrowth()(grid(np.exp(rest + 0.07)), rest, NEIGHBOURS)
    np.testing.assert_allclose(growth, 0.07)


def test_a_glint_is_not_believed() -> None:
    rest = np.zeros(len(PLANE_MM))
    growth = DotGrowth(limit=0.4)(grid(np.full(len(PLANE_MM), np.exp(-2.0))), rest, NEIGHBOURS)
    np.testing.assert_allclose(growth, -0.4)


def test_an_unseen_dot_grows_like_its_neighbours() -> None:
    area = np.full(len(PLANE_MM), 100.0 * np.exp(0.1))
    area[17] = np.nan
    growth = DotGrowth()(grid(area), np.full(len(PLANE_MM), np.log(100.0)), NEIGHBOURS)
    np.testing.assert_allclose(growth, 0.1)


def test_without_areas_there_is_no_growth() -> None:
    assert DotGrowth()(grid(None), np.zeros(len(PLANE_MM)), NEIGHBOURS) is None
    assert DotGrowth().std(grid(None)) is None


def test_noise_of_a_growth_is_that_of_a_noisy_outline() -> None:
    rng = np.random.default_rng(1)
    radius, angle = 9.0, np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    outline = radius + rng.normal(0.0, 0.2, (4000, 60))
    area = 0.5 * (outline**2).mean(axis=1) * 2.0 * np.pi
    centre_x = 2.0 * np.pi * (outline**3 * np.cos(angle)).mean(axis=1) / 3.0 / area
    seen = grid(np.full(len(PLANE_MM), np.pi * radius**2), variance_px2=float(centre_x.var()))
    assert DotGrowth().std(seen) == pytest.approx(np.log(area).std(), rel=0.05)


def test_rest_is_the_mean_of_the_first_frames_and_then_drifts_slowly() -> None:
    grow = DotGrowth(settle=0.01)
    rest = np.full(len(PLANE_MM), np.nan)
    for frame, area in enumerate((100.0, 121.0)):
        rest = grow.at_rest(grid(np.full(len(PLANE_MM), area)), rest, frame)
    np.testing.assert_allclose(rest, np.log(110.0))
    later = grow.at_rest(grid(np.full(len(PLANE_MM), 220.0)), rest, 5000)
    np.testing.assert_allclose(later - rest, 0.01 * np.log(2.0))


def test_a_dot_that_is_hidden_keeps_its_rest() -> None:
    area = np.full(len(PLANE_MM), 100.0)
    area[3] = np.nan
    rest = DotGrowth().at_rest(grid(area), np.full(len(PLANE_MM), np.log(80.0)), 3)
    assert rest[3] == pytest.approx(np.log(80.0))
    assert rest[4] > np.log(80.0)


def test_the_climb_ends_where_dots_have_grown_most_but_not_far_away() -> None:
    sensor = demo_sensor()
    assert sensor.layout is not None
    rest_mm = sensor.layout.rest_mm[:, :2]
    top_mm = np.array([6.0, -5.0])
    growth = 0.2 * np.exp(-0.5 * ((rest_mm - top_mm) ** 2).sum(axis=1) / 5.0**2)
    grow = DotGrowth(climbs=40)
    start_mm = top_mm + np.array([[3.0, 2.0], [-2.0, 4.0]])
    np.testing.assert_allclose(
        grow.summit(start_mm, growth, sensor.layout, rest_mm), np.tile(top_mm, (2, 1)), atol=0.4
    )
    far_mm = top_mm[None] + np.array([[30.0, 0.0]])
    moved_mm = grow.summit(far_mm, growth, sensor.layout, rest_mm) - far_mm
    assert np.linalg.norm(moved_mm) <= grow.climb_pitch * 4.0 + 1e-9


def known_load(sensor: Sensor, at_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacements and growths of a smooth hollow: u = r w/d - l grad w, g = 2 w/d - l lap w."""
    assert sensor.layout is not None
    assert sensor.sheet is not None
    rest = sensor.layout.rest_mm[:, :2]
    distance, lever, width = sensor.camera.translation_mm[2], 0.5 * sensor.sheet.thickness_mm, 7.0
    off = rest - at_mm
    depth = 2.0 * np.exp(-0.5 * (off**2).sum(axis=1) / width**2)
    slope = -off / width**2 * depth[:, None]
    bend = ((off**2).sum(axis=1) / width**4 - 2.0 / width**2) * depth
    return rest * (depth / distance)[:, None] - lever * slope, 2.0 * depth / distance - lever * bend


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_both_witnesses_put_a_load_in_its_place(share: float) -> None:
    sensor = demo_sensor()
    assert sensor.layout is not None
    at_mm = np.array([13.0, -9.0])
    shift, growth = known_load(sensor, at_mm)
    chart = LoadModel(growth_share=share)(sensor, sensor.layout.rest_mm[:, :2])
    load = chart.load(chart.joined(chart.shift_modes(shift), growth))
    row, column = np.unravel_index(np.argmax(load), load.shape)
    np.testing.assert_allclose([chart.x_mm[column], chart.y_mm[row]], at_mm, atol=1.5)


def test_the_load_is_linear_in_what_is_seen() -> None:
    sensor = demo_sensor()
    assert sensor.layout is not None
    chart = LoadModel()(sensor, sensor.layout.rest_mm[:, :2])
    one, other = (known_load(sensor, np.array(at)) for at in ([13.0, -9.0], [-20.0, 5.0]))
    both = chart.joined(chart.shift_modes(one[0] + other[0]), one[1] + other[1])
    apart = sum(chart.joined(chart.shift_modes(shift), growth) for shift, growth in (one, other))
    np.testing.assert_allclose(both, apart, rtol=1e-4, atol=1e-6)


def test_predicted_noise_of_the_load_is_the_observed_one() -> None:
    sensor = demo_sensor()
    assert sensor.layout is not None
    chart = LoadModel(growth_share=0.4)(sensor, sensor.layout.rest_mm[:, :2])
    rng = np.random.default_rng(3)
    at_mm = np.array([[5.0, 5.0], [-40.0, 20.0]])
    loads = [
        chart.load_at(
            at_mm,
            chart.joined(chart.shift_modes(rng.normal(0.0, 0.02, (600, 2))), rng.normal(0.0, 0.01, 600)),
        )
        for _ in range(400)
    ]
    np.testing.assert_allclose(
        np.std(loads, axis=0), chart.load_std(at_mm, chart.noise(0.02, 0.01)), rtol=0.15
    )
