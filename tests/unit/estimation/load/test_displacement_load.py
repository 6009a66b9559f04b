"""The estimate of loads: that of the Gaussian process, and finest_affordable_wavelength for many markers."""

import gc
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from layouts import grid_at, lattice_layout
from manytouch.estimation.load.cosine_series import (
    best_linear_estimate,
    cosine_products,
    finest_affordable_wavelength,
    wave_numbers,
)
from manytouch.estimation.load.displacement_load import LoadModel
from manytouch.estimation.perimeter.estimator import PerimeterEstimator
from manytouch.geometry.camera import project
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Sensor


def lattice(rows: int, columns: int) -> Sensor:
    """The demo sensor with another lattice over the same 120 x 80 mm."""
    return replace(
        demo_sensor(), layout=lattice_layout(rows, columns, (116.0 / (columns - 1), 76.0 / (rows - 1)))
    )


@pytest.mark.parametrize(("count", "parts"), [(7, 2), (1100, 1)])
def test_the_estimate_is_that_from_the_covariance_of_all_observations(count: int, parts: int):
    """Equation 2.25 of Rasmussen and Williams, which needs a matrix as large as the observations are many."""
    random = np.random.default_rng(4)
    design = random.normal(size=(parts, count, 31))
    error = random.uniform(0.1, 4.0, count)
    smooth = random.uniform(0.2, 1.0, 12)
    estimate, spread = best_linear_estimate(lambda at: design[:, at], error, smooth)
    observed = design.reshape(-1, 31)
    covariance = observed @ observed.T + np.diag(np.tile(error, parts) ** 2)
    expected = smooth[:, None] ** 2 * np.linalg.solve(covariance, observed[:, :12]).T
    np.testing.assert_allclose(estimate, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(spread, expected @ expected.T, rtol=1e-9, atol=1e-12 * np.abs(spread).max())


def test_the_map_is_that_of_the_model_as_it_is_written():
    """The displacements' estimate from first principles, with every covariance formed."""
    sensor = lattice(5, 8)
    assert sensor.layout is not None
    assert sensor.sheet is not None
    model, pitch_mm = LoadModel(), np.sqrt(np.prod(sensor.layout.pitch_mm))
    rest = sensor.layout.rest_mm[:, :2] / pitch_mm
    load_map = model(sensor, sensor.layout.rest_mm[:, :2])
    distance, lever = sensor.camera.translation_mm[2] / pitch_mm, sensor.sheet.thickness_mm / pitch_mm / 2
    waves_xy = load_map.wave_x, load_map.wave_y
    square = (load_map.wave_x[:, None] ** 2 + load_map.wave_y**2).ravel()
    smooth = np.exp(-0.25 * model.fingertip**2 * square)
    hollow = smooth / (square + model.decay**-2)
    at = rest - load_map.low
    arm, plain = rest / distance, cosine_products(at, *waves_xy)
    load = [
        (arm[:, k, None] * plain - lever * cosine_products(at, *waves_xy, k == 0, k == 1)) * hollow
        for k in range(2)
    ]
    covariance = np.vstack(load) @ np.vstack(load).T
    tangential = (plain * hollow) @ (plain * hollow).T
    covariance += np.kron(np.eye(2), tangential) + model.model_error**2 * np.eye(2 * len(rest))
    x, y = rest.T
    none, one = np.zeros(len(rest)), np.ones(len(rest))
    motions = [
        (model.shift, one, none),
        (model.shift, none, one),
        (model.angle_rad, -y, x),
        (model.zoom, x, y),
        (model.tilt, x * x / distance, x * y / distance),
        (model.tilt, x * y / distance, y * y / distance),
    ]
    for size, along_x, along_y in motions:
        motion = size * np.concatenate([along_x, along_y])
        covariance += np.outer(motion, motion)
    expected = smooth[:, None] ** 2 * np.linalg.solve(covariance, np.vstack(load)).T
    scale = np.abs(expected).max()
    np.testing.assert_allclose(load_map.estimate, expected, rtol=1e-4, atol=1e-6 * scale)


def test_series_get_coarser_only_where_they_are_too_many():
    size, pitch = np.array([44.0, 29.0]), np.array([1.0, 1.0])
    assert finest_affordable_wavelength(size, pitch, 4.0, 420) == 4.0
    coarser = finest_affordable_wavelength(3.0 * size, pitch, 4.0, 420)
    wave_x, wave_y = wave_numbers(3.0 * size, pitch, coarser)
    assert 300 < len(wave_x) * len(wave_y) <= 420


def test_a_thousand_markers_keep_all_products():
    load_map = LoadModel()(lattice(26, 40), lattice(26, 40).layout.rest_mm[:, :2])
    every = LoadModel(most_products=10**6)(lattice(26, 40), lattice(26, 40).layout.rest_mm[:, :2])
    assert load_map.estimate.shape == every.estimate.shape


def test_ten_thousand_markers_start_in_little_memory():
    sensor = lattice(80, 125)
    tracemalloc.start()
    state = PerimeterEstimator().start(sensor)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(state.geometry.layout.rest_mm) == 10_000
    assert peak < 400e6  # 800e6 for a matrix of all pairs of markers, whose solution takes minutes


def test_steps_at_a_thousand_markers_keep_no_memory():
    sensor = lattice(26, 40)
    assert sensor.layout is not None
    rest_mm = sensor.layout.rest_mm
    area_px2 = np.full(len(rest_mm), 80.0)
    estimate = PerimeterEstimator()
    state = estimate.start(sensor)

    def run(frames: int) -> None:
        nonlocal state
        for frame in range(frames):
            offset = rest_mm[:, :2] - [10.0 * np.sin(frame / 5), 4.0]
            hollow = 3.0 * np.exp(-(offset**2).sum(axis=1) / 72.0)
            moved = np.column_stack([hollow[:, None] * offset / 24.0, -hollow])
            position = project(sensor.camera, rest_mm + moved)
            grid = grid_at(position, std_px=0.03, noise_px=0.03, seed=frame, area_px2=area_px2)
            state, _, contacts = estimate.step(state, grid)
        assert len(contacts.touching) == 1

    run(10)
    tracemalloc.start()
    run(40)  # fills the caches of numpy for small objects
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    run(30)
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    # One array of the markers kept per frame would be 30 x 8 kB.
    assert grown < 25_000
