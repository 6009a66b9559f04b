"""A sheet whose sensor is turned: its weight acts otherwise than at rest, and is no contact."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bent_sheets import bent, grid_of, sensor_of
from layouts import lattice_layout
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.body_force_estimator import (
    BodyForceEstimator,
    nodal_forces_mm2,
)
from manytouch.estimation.mechanics.inversion.iterate import balance
from manytouch.estimation.mechanics.inversion.sheet_model import NominalSheet
from manytouch.estimation.mechanics.inversion.sheet_shape import BodyForce
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.fem.elements.material import NeoHooke
from manytouch.simulation.fem.loading import Loading, press
from manytouch.simulation.fem.sheet import SheetModel, sheet_solver
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Contacts, Sensor, Sheet, TrackedGrid
from manytouch.values.arrays import read_only
from straight import straight_camera

NOISE_PX = 0.01
DENSITY_KG_M3 = 1200.0
PRESSED_MM = np.array([-15.0, 10.0])
UPSIDE_DOWN_G = (0.3, -0.2, -1.9)


@cache
def soft_sensor(young_MPa: float | None = 0.5) -> Sensor:
    """120 x 90 mm and 2.5 mm thick, slack: it sags .4 mm under its weight."""
    return Sensor(
        name="soft",
        camera=straight_camera(800, 600, focal_px=800.0, distance_mm=150.0),
        layout=lattice_layout(17, 23, 5.0),
        sheet=Sheet(
            size_mm=np.array([120.0, 90.0]),
            thickness_mm=2.5,
            young_MPa=young_MPa,
            poisson=0.45,
            pretension_N_per_mm=None if young_MPa is None else 0.01,
            density_kg_m3=DENSITY_KG_M3,
        ),
        centre_noise_px=NOISE_PX,
    )


@cache
def shape_mm(acceleration_g: tuple[float, float, float], force_N: float = 0.0) -> np.ndarray:
    """Coefficients under a body force, and under a force on a pitch around `PRESSED_MM`."""
    model = NominalSheet()(soft_sensor(), 0.02)
    load = np.tensordot(np.array(acceleration_g), nodal_forces_mm2(model), 1)
    if force_N:
        assert model.young_MPa is not None
        place_mm = PRESSED_MM + 1.5 * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
        load = load + model.patch.load(
            place_mm, np.tile([0.0, 0.0, -0.25 * force_N / model.young_MPa], (4, 1))
        )
    found = equilibrium(model.shell, load)
    assert found.status == "ok"
    return read_only(found.coefficient_mm)


def turned(share: float) -> tuple[float, float, float]:
    x, y, z = (round(share * each, 3) for each in UPSIDE_DOWN_G)
    return x, y, z


TURN = [turned(share) for share in (0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0)]


def estimator_of(**body_force: float) -> MechanicsEstimator:
    estimator = MechanicsEstimator()
    fit = estimator.gauss_newton
    fit = replace(fit, body_force=replace(fit.body_force, **body_force))
    return replace(estimator, gauss_newton=fit)


def steps(
    shapes: list[np.ndarray], *, sensor: Sensor | None = None, **body_force: float
) -> Iterator[tuple[MechanicsState, Contacts]]:
    """State and contacts after each of some frames, with parameters of the estimate of a body force."""
    estimator = estimator_of(**body_force)
    state = estimator.start(sensor or soft_sensor())
    for seed, each in enumerate(shapes):
        grid = grid_of(state.model, each, noise_px=NOISE_PX, seed=seed)
        state, _, contacts = estimator.step(state, grid)
        yield state, contacts


def test_the_weight_of_a_turned_sheet_is_no_contact() -> None:
    shapes = [shape_mm(each) for each in TURN]
    assert any(contacts.touching for _, contacts in steps(shapes, std_g=0.0))
    *_, (state, contacts) = steps(shapes)
    assert not contacts.touching
    body_force = state.shape.body_force
    assert body_force is not None
    assert body_force.acceleration_g == pytest.approx(UPSIDE_DOWN_G, abs=0.25)
    off_g = body_force.acceleration_g - UPSIDE_DOWN_G
    assert off_g @ np.linalg.solve(body_force.covariance_g2, off_g) < 11.3  # 99 % of chi-squared


@pytest.mark.parametrize("force_N", [0.05, 0.4])
def test_a_press_on_a_turned_sheet_has_its_force(force_N: float) -> None:
    pressed = [shape_mm(turned(1.0), force_N * share) for share in (0.5, 1.0, 1.0, 1.0)]
    *_, (_, contacts) = steps([shape_mm(each) for each in TURN] + pressed)
    (contact,) = contacts.touching
    assert contact.centre_mm == pytest.approx(PRESSED_MM, abs=1.5)
    assert -contact.force_N[2] == pytest.approx(force_N, rel=0.1)
    assert abs(-contact.force_N[2] - force_N) < 2.0 * contact.std("normal_force")


def test_the_force_is_that_of_the_press_while_the_sensor_is_turned_back() -> None:
    shapes = [shape_mm(each) for each in TURN]
    shapes += [shape_mm(turned(1.0), force_N) for force_N in (0.2, 0.4, 0.4)]
    shapes += [shape_mm(turned(share), 0.4) for share in (0.75, 0.5, 0.25, 0.0, 0.0, 0.0)]
    *_, (state, contacts) = steps(shapes)
    (contact,) = contacts.touching
    assert -contact.force_N[2] == pytest.approx(0.4, rel=0.1)
    assert state.shape.body_force is not None
    assert np.abs(state.shape.body_force.acceleration_g).max() < 0.4


def test_weight_that_pulls_the_sheet_is_found_without_a_contact() -> None:
    up = [shape_mm((0.0, 0.0, share)) for share in (0.0, 0.0, 0.5, 1.0, 1.5, 1.9, 1.9)]
    *_, (state, contacts) = steps(up)
    assert not contacts.touching
    assert state.shape.body_force is not None
    assert state.shape.body_force.acceleration_g[2] == pytest.approx(1.9, abs=0.25)


@pytest.mark.parametrize("force_N", [0.006, 0.01, 0.1])
def test_a_press_is_no_body_force(force_N: float) -> None:
    rest = [shape_mm((0.0, 0.0, 0.0))] * 2
    growing = [shape_mm((0.0, 0.0, 0.0), force_N * share) for share in (0.25, 0.5, 0.75, 1.0, 1.0)]
    found = list(steps(rest + growing))
    assert all(state.shape.body_force is None for state, _ in found)
    assert len(found[-1][1].touching) == 1


@pytest.mark.parametrize(("thickness_mm", "young_MPa", "force_mm2"), [(6.0, 0.1, 0.06), (3.0, 0.2, 0.03)])
def test_light_presses_all_over_a_soft_sheet_are_no_body_force(
    thickness_mm: float, young_MPa: float, force_mm2: float
) -> None:
    """A body force would explain most of their forces."""
    sensor = sensor_of(thickness_mm=thickness_mm, young_MPa=young_MPa, pretension_N_per_mm=0.01)
    model = NominalSheet()(sensor, 0.02)
    places_mm = ((-18.0, -8.0), (-18.0, 8.0), (3.0, 8.0), (14.0, -8.0))
    forces_mm2 = force_mm2 * np.array([1.0, 1.2, 1.4, 1.6])
    presses = [(*place, force) for place, force in zip(places_mm, forces_mm2.tolist(), strict=True)]
    shape = bent(model, *presses)
    found = list(steps([np.zeros_like(shape)] * 2 + [shape] * 3, sensor=sensor))
    assert all(state.shape.body_force is None for state, _ in found)
    assert found[-1][1].touching


def test_a_body_force_does_not_begin_under_a_contact_that_has_lasted() -> None:
    """Its forces are those of an object, whatever else would explain them."""
    shapes = [shape_mm(each) for each in TURN]
    for most_s, begins in ((0.5, True), (-1.0, False)):
        *_, (state, contacts) = steps(shapes, most_s=most_s)
        assert (state.shape.body_force is not None) == begins
        assert bool(contacts.touching) != begins


def test_the_cost_at_rest_is_a_mean_of_the_frames_that_are_at_rest() -> None:
    estimator, cost = BodyForceEstimator(rest_share=0.5, most_rest_growth=1.3), float("nan")
    means = [cost := estimator.rest_cost(cost, each) for each in (4.0, 2.0, 3.6, 4.5, 1.0)]
    assert means == [4.0, 3.0, 3.3, 3.3, 2.15]


@pytest.mark.parametrize(("rest_share", "is_found"), [(0.0, False), (0.4, True)])
def test_what_the_noise_of_forces_costs_at_rest_does_not_count(rest_share: float, is_found: bool) -> None:
    """With a body force of which an untouched sheet shows nine tenths of what is asked."""
    *_, (state, _) = steps([shape_mm(turned(share)) for share in (0.0, 0.0, 0.2)], std_g=0.0)
    model, posterior, shape = state.model, state.posterior, state.shape
    assert posterior is not None
    balance_mm2 = balance(model, shape.slope, shape.force_mm2)
    cost = float(np.vdot(posterior.weight * balance_mm2, balance_mm2))

    def found(least_share: float, rest_cost: float) -> bool:
        estimator = BodyForceEstimator(least_gain=0.1, least_share=least_share, pull_force=np.inf)
        first = estimator.first(model, posterior, shape, balance_mm2, rest_cost=rest_cost, is_touched=False)
        return first is not None

    shares = np.linspace(0.0, 2.0, 2001)
    share = max(each for each in shares.tolist() if found(each, 0.0))
    assert 0.02 < share < 1.9
    assert found(share / 0.9, rest_share * cost) == is_found


def test_without_a_modulus_no_body_force_is_estimated() -> None:
    for state, _ in steps([shape_mm(each) for each in TURN], sensor=soft_sensor(None)):
        assert state.shape.body_force is None


def test_the_weight_of_a_turned_solid_is_no_contact() -> None:
    """Its shape is that of 3-D elements, which hang already at rest."""
    sensor, down, up = soft_sensor(), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
    sheet, layout = sensor.sheet, sensor.layout
    assert sheet is not None
    assert layout is not None
    model = SheetModel(
        size_mm=(120.0, 90.0),
        thickness_mm=sheet.thickness_mm,
        material=NeoHooke(young_MPa=0.5, poisson=0.45, density_kg_m3=DENSITY_KG_M3),
        pretension_N_per_mm=0.01,
        element_mm=10.0,
    )
    above_mm = np.tile([0.0, 0.0, -5.0], (5, 1))
    loading = Loading(touches=(press(Sphere(radius_mm=3.0), thickness_mm=2.5, path_mm=above_mm),))
    solver, states = sheet_solver(model), []
    state = solver.start(loading)
    for step, gravity in enumerate((up, up, (0.0, 0.7, 0.7), (0.0, 1.0, 0.0), down)):
        state = replace(solver, gravity=gravity).step(state, loading, step)
        states.append(condense(state, loading))
    time_s = np.array([0.0, 0.2, 0.4, 0.6, 0.8])
    scene = SolidScene(name="turned", time_s=time_s, states=tuple(states), duration_s=0.8)
    simulator = Simulator(sensor=sensor, scene=scene)
    grids = [simulator.truth(number).grid for number in range(simulator.frame_count)]
    given = replace(sensor, layout=replace(layout, rest_px=grids[0].position_px))

    def contact_frames(std_g: float) -> int:
        estimator = estimator_of(std_g=std_g)
        current, count = estimator.start(given), 0
        for seed, grid in enumerate([*grids, *[grids[-1]] * 8]):
            current, _, contacts = estimator.step(current, noisy(grid, seed))
            count += len(contacts.touching) > 0
        return count

    assert contact_frames(0.0) > 10
    assert contact_frames(1.0) <= 2


def noisy(grid: TrackedGrid, seed: int) -> TrackedGrid:
    chance = np.random.default_rng(seed)
    return replace(
        grid,
        position_px=read_only(grid.position_px + chance.normal(0.0, NOISE_PX, grid.position_px.shape)),
        covariance_px2=read_only(np.tile(NOISE_PX**2 * np.eye(2), (len(grid.is_seen), 1, 1))),
    )


def test_what_is_expected_of_a_body_force_depends_on_the_time_and_not_on_the_frame_rate() -> None:
    known = BodyForce(
        acceleration_g=np.array([0.5, 0.0, -1.0]), covariance_g2=0.01 * np.eye(3), force_mm2=np.ones((4, 3))
    )
    estimator = BodyForceEstimator()
    once = estimator.expected(known, 0.2)
    twice = estimator.expected(estimator.expected(known, 0.05), 0.15)
    for name in ("acceleration_g", "covariance_g2", "force_mm2"):
        np.testing.assert_allclose(getattr(once, name), getattr(twice, name))
    assert estimator.expected(None, 0.2) is None


@pytest.mark.parametrize(("fps", "begins"), [(30.0, False), (120.0, True)])
def test_how_long_a_contact_lasts_before_a_body_force_is_a_time(fps: float, begins: bool) -> None:
    """Forces that stand for the weight have been contacts for 18 frames: 0.6 s or 0.15 s."""
    fixed, turns = estimator_of(std_g=0.0), estimator_of()
    state, model = fixed.start(soft_sensor()), NominalSheet()(soft_sensor(), 0.02)
    for number in range(20):
        shape = shape_mm(turned(0.0 if number < 2 else 0.5))
        grid = grid_of(model, shape, noise_px=NOISE_PX, seed=number)
        grid = replace(grid, timestamp_ns=round(1e9 * number / fps))
        state, _, _ = (turns if number == 19 else fixed).step(state, grid)
    assert (state.shape.body_force is not None) == begins
