"""Standard deviations of strain and pressure against the scatter of many noisy frames of one sheet."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from layouts import grid_at
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.posterior_samples import PosteriorSamples
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.solutions import Solutions
from manytouch.evaluation.suite.suite import cases
from manytouch.geometry.camera import project
from manytouch.geometry.surface_sampling import sampler_on
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.render.dot_ellipses import dot_ellipses, outlines
from manytouch.sinks.display_grid import display_grid
from manytouch.values import TrackedGrid
from manytouch.values.arrays import read_only

SENSOR = demo_sensor(1280)
NOISE_PX = 0.15
FRAMES = 16


def noisy_grid(model, shape_mm: np.ndarray, seed: int) -> TrackedGrid:
    centre_px = project(model.camera, model.layout.rest_mm) + model.dots.displacement_px(shape_mm)
    return grid_at(centre_px, std_px=NOISE_PX, noise_px=NOISE_PX, seed=seed)


def test_strain_and_pressure_scatter_by_their_deviations() -> None:
    estimate, draw = MechanicsEstimator(), PosteriorSamples(SENSOR)
    state = estimate.start(SENSOR)
    model = state.model
    disc_mm = np.stack(np.meshgrid(*[np.linspace(-3.0, 3.0, 7)] * 2), axis=-1).reshape(-1, 2)
    disc_mm = disc_mm[(disc_mm**2).sum(axis=1) < 9.0] + [10.0, 5.0]
    each_mm2 = np.tile([0.0, 0.0, -0.5 / len(disc_mm)], (len(disc_mm), 1))
    pressed = equilibrium(model.shell, model.patch.load(disc_mm, each_mm2)).coefficient_mm
    for seed in range(6):
        state, surface, _ = estimate.step(state, noisy_grid(model, pressed, 1000 + seed))
    x_mm, y_mm = np.linspace(-2.0, 22.0, 25), np.linspace(-7.0, 17.0, 25)
    sampler = sampler_on(model.layout, x_mm, y_mm)
    posterior = draw(surface, noisy_grid(model, pressed, 0))
    assert len(posterior) == draw.draws
    model_std = sampler.strain_std(surface, (surface.spline,))
    strain_std = np.sqrt(sampler.strain_std(surface, posterior) ** 2 - model_std**2)
    pressure_std = sampler.pressure_std_kPa(surface, posterior)
    found = []
    for seed in range(FRAMES):
        _, other, _ = estimate.step(state, noisy_grid(model, pressed, seed))
        found.append((sampler.strain(other), sampler.pressure_kPa(other)))
    for claimed, values in zip((strain_std, pressure_std), zip(*found, strict=True), strict=True):
        scatter = np.std(values, axis=0)
        # The posterior contains the uncertainty of the prior as well as the noise.
        assert 0.4 < np.sqrt(np.mean((scatter / claimed) ** 2)) < 1.15


def test_the_same_surface_has_the_same_deviations_and_noise_makes_them_grow() -> None:
    draw, estimate = PosteriorSamples(SENSOR), MechanicsEstimator()
    state = estimate.start(SENSOR)
    still = np.zeros((state.model.patch.node_count, 3))
    grid = noisy_grid(state.model, still, 0)
    _, surface, _ = estimate.step(state, grid)
    sampler = sampler_on(state.model.layout, np.linspace(-20, 20, 21), np.linspace(-10, 10, 11))
    one, other = (sampler.strain_std(surface, draw(surface, grid)) for _ in range(2))
    np.testing.assert_array_equal(one, other)
    noisier = replace(grid, covariance_px2=read_only(16.0 * grid.covariance_px2))
    assert np.median(sampler.strain_std(surface, draw(surface, noisier)) / one) > 1.5
    assert draw(replace(surface, spline=None), grid) == ()
    assert np.isnan(sampler.strain_std(replace(surface, spline=None), ())).all()


@pytest.mark.parametrize("share", [0.5, pytest.param(1.0, marks=pytest.mark.slow)])
def test_the_strain_of_a_solid_lies_within_its_deviations(share: float, tmp_path: Path) -> None:
    """On that share, in the middle, of the length and of the width of the display."""
    (case,) = (case for case in cases(("nominal",), quick=True, tuning=True) if len(case.touches) == 2)
    states = Solutions(folder=tmp_path).known(case)
    assert states is not None
    sensor, estimate = given_sensor(case), MechanicsEstimator()
    assert sensor.layout is not None
    edge_mm = outlines(sensor.layout.rest_mm, sensor.layout.radius_mm)
    draw, state = PosteriorSamples(sensor), estimate.start(sensor)
    shown = display_grid(sensor.layout)
    x_mm, y_mm = (
        all_mm[np.abs(all_mm - np.mean(all_mm)) <= share * (all_mm[-1] - np.mean(all_mm))]
        for all_mm in (shown.x_mm, shown.y_mm)
    )
    sampler = sampler_on(sensor.layout, x_mm, y_mm)
    for seed, solid in enumerate(states):
        moved_mm = solid.displacement_mm(np.ascontiguousarray(edge_mm.reshape(-1, 3)[:, :2]))
        centre_px, _ = dot_ellipses(sensor.camera, edge_mm + moved_mm.reshape(edge_mm.shape))
        centre_px += np.random.default_rng(seed).normal(0.0, 0.03, centre_px.shape)
        count = len(centre_px)
        grid = TrackedGrid(
            position_px=read_only(centre_px),
            covariance_px2=read_only(np.tile(0.03**2 * np.eye(2), (count, 1, 1))),
            is_seen=read_only(np.ones(count, dtype=bool)),
            frames_unseen=read_only(np.zeros(count, dtype=np.int64)),
        )
        state, surface, _ = estimate.step(state, grid)
    place_mm = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    _, gradient = states[-1].camera_side(np.ascontiguousarray(place_mm))
    green = 0.5 * (np.einsum("mki,mkj->mij", gradient, gradient) - np.eye(2))
    true = np.linalg.eigvalsh(green)[:, 1].reshape(len(y_mm), len(x_mm))
    z = (sampler.strain(surface) - true) / sampler.strain_std(surface, draw(surface, grid))
    known, near = np.isfinite(z), true > 0.3 * np.nanmax(true)
    assert np.mean(np.abs(z[known]) < 1.96) > 0.85
    assert np.mean(np.abs(z[known & near]) < 1.96) > 0.75
    assert np.sqrt(np.mean(z[known & near] ** 2)) > 0.4
