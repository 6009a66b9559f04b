"""The inversion on sheets that are deformed by its own mechanics: tests the algebra, not the accuracy."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bent_sheets import COLUMNS, PITCH_MM, ROWS, YOUNG_MPA, bent, grid_of, sensor_of
from displaced_dots import Unaware, displaced_dots
from manytouch.errors import LayoutError, SensorError
from manytouch.estimation import MechanicsEstimator, PerimeterEstimator
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
from manytouch.mechanics.markers.images import Face
from manytouch.values import ESTIMATES, Sensor, TrackedGrid
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.assumed_sheet import assumed_sheet
from same_bits import assert_same_bits

ESTIMATE = MechanicsEstimator()


def without(grid: TrackedGrid, lost: np.ndarray) -> TrackedGrid:
    return replace(
        grid,
        is_seen=read_only(grid.is_seen & ~lost),
        position_px=read_only(np.where(lost[:, None], np.nan, grid.position_px)),
        covariance_px2=read_only(np.where(lost[:, None, None], np.nan, grid.covariance_px2)),
    )


@pytest.fixture(scope="module")
def model() -> InversionModel:
    return started().model


@pytest.fixture(scope="module")
def shape(model: InversionModel) -> np.ndarray:
    return bent(model, (-12.0, -6.0, 0.6), (10.0, 5.0, 0.9))


@cache
def started() -> MechanicsState:
    return ESTIMATE.start(sensor_of())


def read(grids: list[TrackedGrid], sensor: Sensor | None = None):
    state = started() if sensor is None else ESTIMATE.start(sensor)
    for grid in grids:
        state, surface, contacts = ESTIMATE.step(state, grid)
    return state, surface, contacts


def test_centre_force_and_depth_of_two_presses(model: InversionModel, shape: np.ndarray) -> None:
    _, surface, contacts = read([grid_of(model, shape, seed=k) for k in range(4)])
    assert surface.status == contacts.status == "ok"
    true_mm = model.dots.displacement_mm(shape)
    assert np.sqrt(np.mean((surface.displacement_mm - true_mm)[:, 2] ** 2)) < 0.01
    first, second = sorted(contacts.touching, key=lambda contact: contact.centre_mm[0])
    for contact, (x, y, press) in ((first, (-12.0, -6.0, 0.6)), (second, (10.0, 5.0, 0.9))):
        np.testing.assert_allclose(contact.centre_mm, [x, y], atol=0.3)
        assert contact.normal_force_over_E_mm2 == pytest.approx(press, rel=0.06)
        assert -contact.force_N[2] == pytest.approx(press * YOUNG_MPA, rel=0.06)
        (there_mm,) = Face(shell=model.shell, point_mm=np.array([[x, y]])).displacement(shape)
        assert contact.depth_mm == pytest.approx(-there_mm[2], abs=0.08)
        assert 0.0 < contact.std("x") < 1.0
        assert 0.0 < contact.std("normal_force") < 0.3 * press * YOUNG_MPA


@pytest.mark.parametrize(("press", "within"), [(0.1, 0.03), (0.3, 0.02), (1.0, 0.02), (2.5, 0.03)])
def test_the_force_of_faint_and_of_strong_presses(model: InversionModel, press: float, within: float) -> None:
    """The sparse prior, which makes the forces on the nodes too small, does not change that of a contact."""
    x, y = -5.0, 3.0
    flat, pressed = np.zeros((model.patch.node_count, 3)), bent(model, (x, y, press))
    grids = [grid_of(model, flat, seed=99), *(grid_of(model, pressed, seed=k) for k in range(6))]
    _, surface, contacts = read(grids)
    (contact,) = contacts.touching
    assert contact.normal_force_over_E_mm2 == pytest.approx(press, rel=within)
    np.testing.assert_allclose(contact.centre_mm, [x, y], atol=0.2)
    assert surface.spline is not None
    assert -surface.spline.force_over_E_mm2[:, 2].sum() == pytest.approx(press, rel=0.1)
    (deepest_mm,) = -Face(shell=model.shell, point_mm=np.array([[x, y]])).displacement(pressed)[:, 2]
    assert contact.depth_mm == pytest.approx(deepest_mm, rel=0.04)


def smoothed_area_mm2(radius_mm: float, std_mm: float) -> float:
    """Area of the disc that carries 95 % of an even pressure on a disc after smoothing, by sampling."""
    random = np.random.default_rng(0)
    radius = radius_mm * np.sqrt(random.random(400_000))
    smoothed = random.normal(0.0, std_mm, (2, len(radius)))
    return float(np.pi * np.quantile(np.hypot(radius + smoothed[0], smoothed[1]), 0.95) ** 2)


@pytest.mark.parametrize("press", [0.3, 1.0])
def test_the_region_of_a_pad(model: InversionModel, press: float) -> None:
    pressed = bent(model, (-5.0, 3.0, press), radius_mm=6.0)
    _, _, contacts = read([grid_of(model, pressed, seed=k) for k in range(6)])
    (contact,) = contacts.touching
    assert contact.area_mm2 == pytest.approx(smoothed_area_mm2(6.0, 0.5 * PITCH_MM), rel=0.1)
    assert contact.half_major_mm == pytest.approx(6.0, rel=0.12)
    assert contact.half_minor_mm == pytest.approx(6.0, rel=0.12)
    assert contact.normal_force_over_E_mm2 == pytest.approx(press, rel=0.02)


def moved(grid: TrackedGrid, motion: str) -> TrackedGrid:
    """The grid as a camera sees it that has moved a little: the outermost marker moves by half a pixel."""
    arm_px = grid.position_px - grid.position_px.mean(axis=0)
    reach_px = np.linalg.norm(arm_px, axis=1).max()
    change_px = {
        "shift": np.tile([0.4, -0.3], (len(arm_px), 1)),
        "rotation": 0.5 / reach_px * np.column_stack([-arm_px[:, 1], arm_px[:, 0]]),
        "scale": 0.5 / reach_px * arm_px,
    }[motion]
    return replace(grid, position_px=grid.position_px + change_px)


@pytest.mark.parametrize("motion", ["shift", "rotation", "scale"])
def test_a_small_motion_of_the_camera_is_no_force(model: InversionModel, motion: str) -> None:
    flat, pressed = np.zeros((model.patch.node_count, 3)), bent(model, (8.0, -4.0, 0.3))
    still = [grid_of(model, flat, seed=k) for k in range(4)]
    shaken = [moved(grid_of(model, flat, seed=10 + k), motion) for k in range(6)]
    state, _, _ = read(still)
    found = []
    for grid in shaken:
        state, surface, contacts = ESTIMATE.step(state, grid)
        found += contacts.touching
    assert not found
    assert np.abs(surface.displacement_mm[:, 2]).max() < 0.01
    force = []
    for change in (lambda grid: grid, lambda grid: moved(grid, motion)):
        grids = [change(grid_of(model, pressed, seed=20 + k)) for k in range(6)]
        (contact,) = read([*still, *grids])[2].touching
        force.append(contact.normal_force_over_E_mm2)
    assert force[1] == pytest.approx(force[0], rel=0.03)


@pytest.mark.parametrize("motion", [None, "shift", "scale"])
def test_a_quick_release_leaves_no_depth_and_no_contact(model: InversionModel, motion: str | None) -> None:
    """Also while the camera moves: a release moves the markers along the clamp too, and is no motion."""
    shapes = [np.zeros((model.patch.node_count, 3))]
    shapes += [bent(model, (-12.0, -6.0, press), (10.0, 5.0, 1.5 * press)) for press in (0.6, 0.6, 0.1)]
    grids = [grid_of(model, shapes[k], seed=k) for k in (0, 1, 2, 3, 0, 0)]
    if motion is not None:
        grids[2:] = [moved(grid, motion) for grid in grids[2:]]
    state, _, _ = read(grids[:4])
    for grid in grids[4:]:
        state, surface, contacts = ESTIMATE.step(state, grid)
        assert not contacts.touching
        assert np.abs(surface.displacement_mm[:, 2]).max() < 0.01


@pytest.mark.parametrize("sheet", [{}, {"pretension_N_per_mm": 1.0}, {"thickness_mm": 2.0}])
def test_the_least_force_of_a_contact_is_six_deviations_by_the_usual_noise(sheet: dict[str, float]) -> None:
    state = ESTIMATE.start(sensor_of(**sheet))
    usual_px = ESTIMATE.marker_noise.usual_std_px(state.model_std_px)
    at_rest = bent(state.model, (0.0, 0.0, state.model.nodes.least_force_mm2), radius_mm=0.5 * PITCH_MM)
    moved_px = np.linalg.norm(state.model.dots.displacement_px(at_rest))
    assert moved_px == pytest.approx(6.0 * usual_px, rel=0.05)


def test_the_uncertainty_of_the_stiffness_is_in_that_of_forces(
    model: InversionModel, shape: np.ndarray
) -> None:
    grids = [grid_of(model, shape, seed=k) for k in range(4)]
    exact, doubted = (read(grids, sensor_of(young_std_MPa=std))[2].touching for std in (0.0, 0.2 * YOUNG_MPA))
    for sure, unsure in zip(exact, doubted, strict=True):
        force_N = -sure.force_N[2]
        assert -unsure.force_N[2] == pytest.approx(force_N)
        assert unsure.std("normal_force") == pytest.approx(
            np.hypot(sure.std("normal_force"), 0.2 * force_N), rel=1e-6
        )
        added = unsure.covariance - sure.covariance
        shear, press = ESTIMATES.index("shear_x"), ESTIMATES.index("normal_force")
        assert added[shear, press] == pytest.approx(0.2**2 * sure.force_N[0] * force_N)
        for estimate in ("x", "y", "depth"):
            assert unsure.std(estimate) == sure.std(estimate)


def test_missing_and_wrong_markers_have_little_effect(model: InversionModel, shape: np.ndarray) -> None:
    chance = np.random.default_rng(1)
    lost, wrong = chance.random(ROWS * COLUMNS) < 0.2, chance.random(ROWS * COLUMNS) < 0.03
    grids = []
    for k in range(4):
        grid = grid_of(model, shape, seed=k)
        astray = np.where(wrong[:, None], grid.position_px + np.array([5.0, -5.0]), grid.position_px)
        grids.append(without(replace(grid, position_px=astray), lost))
    _, surface, contacts = read(grids)
    error = (surface.displacement_mm - model.dots.displacement_mm(shape))[:, 2]
    assert wrong.sum() >= 3
    assert np.sqrt(np.mean(error**2)) < 0.02
    assert len(contacts.touching) == 2


def steps(before: list[TrackedGrid], grid: TrackedGrid) -> int:
    """Number of full steps of the last frame."""
    state, _, _ = read(before)
    return ESTIMATE.fit_frame(state, grid).steps


def test_a_steady_sheet_needs_no_full_step_and_a_new_press_some(
    model: InversionModel, shape: np.ndarray
) -> None:
    flat = np.zeros_like(shape)
    at_rest = [grid_of(model, flat, seed=k) for k in range(12)]
    assert steps(at_rest[:1], at_rest[1]) == 0
    assert steps(at_rest, grid_of(model, flat, seed=12)) == 0
    assert 1 <= steps(at_rest[:2], grid_of(model, shape)) <= 2
    state, _, _ = read([*at_rest[:2], *(grid_of(model, shape, seed=k) for k in range(12))])
    first = state.posterior
    assert first is not None
    # A constant shape is reweighted now and then.
    assert 0 < first.reweightings <= ESTIMATE.gauss_newton.max_reweightings


def test_a_moving_press_is_reweighted(model: InversionModel) -> None:
    course = [bent(model, (0.5 * k, 0.3 * k, 0.4)) for k in range(12)]
    grids = [grid_of(model, bent_mm, seed=k) for k, bent_mm in enumerate(course)]
    always_full = replace(ESTIMATE, gauss_newton=replace(ESTIMATE.gauss_newton, max_reweightings=0))
    found, full_steps = [], []
    for estimate in (ESTIMATE, always_full):
        state, taken, centres = estimate.start(sensor_of()), 0, []
        for grid in grids:
            taken += estimate.fit_frame(state, grid).steps
            state, _, contacts = estimate.step(state, grid)
            (contact,) = contacts.touching
            centres.append([*contact.centre_mm, contact.depth_mm, -contact.force_N[2]])
        full_steps.append(taken)
        found.append(centres)
    assert full_steps[0] <= 6
    assert full_steps[1] >= 10
    ours, theirs = np.array(found)
    np.testing.assert_allclose(ours[:, :2], theirs[:, :2], atol=0.1)
    np.testing.assert_allclose(ours[:, 2:], theirs[:, 2:], rtol=0.02)


def test_a_step_with_an_earlier_posterior_is_nearly_a_full_one(
    model: InversionModel, shape: np.ndarray
) -> None:
    state, _, _ = read([grid_of(model, shape, seed=k) for k in range(6)])
    assert state.posterior is not None
    other = grid_of(model, 1.01 * shape, seed=9)
    _, surface, _ = ESTIMATE.step(state, other)
    _, whole, _ = ESTIMATE.step(replace(state, posterior=None), other)
    moved_mm = np.abs(whole.displacement_mm - model.dots.displacement_mm(state.shape.coefficient_mm)).max()
    assert moved_mm > 0.01
    np.testing.assert_allclose(surface.displacement_mm, whole.displacement_mm, atol=0.15 * moved_mm)


def test_a_marker_that_earlier_derivatives_leave_wrong_needs_a_full_step(
    model: InversionModel, shape: np.ndarray
) -> None:
    state, _, _ = read([grid_of(model, shape, seed=k) for k in range(6)])
    assert state.posterior is not None
    grid = grid_of(model, shape, seed=9)
    measured_px = np.array(grid.position_px - state.reference_px)
    information = ESTIMATE.information(state, grid, measured_px)

    def fit(moved_px: np.ndarray) -> int:
        earlier = {"posterior": state.posterior, "posterior_frames": 1}
        return ESTIMATE.gauss_newton(state.model, state.shape, moved_px, information, **earlier).steps

    assert fit(measured_px) == 0
    wrong = int(np.argmin(model.dots.displacement_mm(shape)[:, 2]))
    measured_px[wrong, 0] += 15.0 / np.sqrt(information[wrong, 0, 0])
    assert fit(measured_px) >= 1


@pytest.mark.usefixtures("each_is_computed_again")
def test_interleaved_states_give_the_same_bits_as_separate_ones(
    model: InversionModel, shape: np.ndarray
) -> None:
    courses = [[grid_of(model, bent_mm, seed=k) for k in range(7)] for bent_mm in (shape, 0.4 * shape)]
    separate = []
    for grids in courses:
        state, results = started(), []
        for grid in grids:
            state, *result = ESTIMATE.step(state, grid)
            results.append(result)
        separate.append(results)
    states, interleaved = [started()] * 2, [[], []]
    for pair in zip(*courses, strict=True):
        for number, grid in enumerate(pair):
            states[number], *result = ESTIMATE.step(states[number], grid)
            interleaved[number].append(result)
    assert_same_bits(interleaved, separate)


def test_noise_at_rest_makes_no_contacts(model: InversionModel) -> None:
    flat, state = np.zeros((model.patch.node_count, 3)), started()
    for k in range(30):
        state, _, contacts = ESTIMATE.step(state, grid_of(model, flat, noise_px=0.05, seed=k))
        assert not contacts.touching


def test_dots_that_are_displaced_by_more_than_their_pixels_show_widen_the_deviations(
    model: InversionModel,
) -> None:
    flat = np.zeros((model.patch.node_count, 3))
    frames = displaced_dots(grid_of(model, flat, noise_px=0.005, seed=1), 20, 0.2)
    std_mm = []
    for estimate in (ESTIMATE, replace(ESTIMATE, excess_noise=Unaware())):
        state = estimate.start(sensor_of())
        for grid in frames:
            state, surface, contacts = estimate.step(state, grid)
            assert not contacts.touching
        std_mm.append(np.median(np.sqrt(surface.covariance_mm2[:, 2, 2])))
    assert std_mm[0] > 2.0 * std_mm[1]


def test_the_reference_follows_creep_and_not_a_steady_press(model: InversionModel) -> None:
    flat, pressed = np.zeros((model.patch.node_count, 3)), bent(model, (3.0, -4.0, 0.12))
    state = started()
    for k in range(40):
        crept = grid_of(model, flat, seed=k)
        crept = replace(crept, position_px=crept.position_px + np.array([0.1, 0.0]))
        state, _, contacts = ESTIMATE.step(state, crept)
        assert not contacts.touching
    learnt_px = state.reference_px - state.initial_reference_px
    assert 0.01 < learnt_px[:, 0].mean() < 0.1
    for k in range(60):
        state, _, contacts = ESTIMATE.step(state, grid_of(model, pressed, seed=k))
    np.testing.assert_array_equal(state.reference_px - state.initial_reference_px, learnt_px)
    assert len(contacts.touching) == 1
    assert contacts.touching[0].normal_force_over_E_mm2 == pytest.approx(0.12, rel=0.3)


def test_markers_have_deviations_and_the_surface_a_shape(model: InversionModel, shape: np.ndarray) -> None:
    grid = grid_of(model, shape)
    lost = np.arange(len(grid.is_seen)) == 40
    _, surface, _ = read([grid, grid, without(grid, lost)])
    std_mm = np.sqrt(surface.covariance_mm2[:, 2, 2])
    near = np.linalg.norm(model.layout.rest_mm[:, :2] - [10.0, 5.0], axis=1) < 3.0
    assert (std_mm > 0.0).all()
    assert std_mm[near].min() > 2.0 * np.median(std_mm)
    assert std_mm[40] > 1.5 * std_mm[39]
    spline = surface.spline
    assert spline is not None
    assert spline.young_MPa == YOUNG_MPA
    assert -spline.force_over_E_mm2[:, 2].sum() == pytest.approx(1.5, rel=0.1)


def test_contacts_last_over_a_frame_without_markers(model: InversionModel, shape: np.ndarray) -> None:
    grid = grid_of(model, shape)
    state, _, _ = read([grid, grid])
    state, surface, contacts = ESTIMATE.step(state, without(grid, np.ones(len(grid.is_seen), dtype=bool)))
    assert surface.status == contacts.status == "few_markers"
    assert np.isnan(surface.displacement_mm).all()
    assert len(contacts.touching) == 2
    _, surface, contacts = ESTIMATE.step(state, grid)
    assert surface.status == "ok"
    assert len(contacts.touching) == 2


def test_an_impossible_frame_has_a_status_and_is_forgotten(model: InversionModel, shape: np.ndarray) -> None:
    grid = grid_of(model, shape)
    chance = np.random.default_rng(0)
    torn = replace(grid, position_px=grid.position_px + chance.normal(0, 40.0, grid.position_px.shape))
    state, surface, contacts = read([grid, grid, torn])
    assert surface.status == contacts.status == "not_converged"
    assert np.isnan(surface.displacement_mm).all()
    assert len(contacts.touching) == 2
    for _ in range(4):
        state, surface, contacts = ESTIMATE.step(state, grid)
    assert surface.status == "ok"
    assert [contact.id for contact in contacts.touching] == [0, 1]


def test_contacts_end_if_no_shape_explains_the_frames_for_long(
    model: InversionModel, shape: np.ndarray
) -> None:
    grid = grid_of(model, shape)
    chance = np.random.default_rng(0)
    torn = replace(grid, position_px=grid.position_px + chance.normal(0, 40.0, grid.position_px.shape))
    _, _, contacts = read([grid, grid, *[torn] * 22])
    assert contacts.status == "not_converged"
    assert not contacts.touching


def test_without_stiffness_forces_are_relative() -> None:
    """The pretension is not known either and changes all forces; their ratio remains."""
    sensor = sensor_of(young_MPa=None, pretension_N_per_mm=None)
    model = ESTIMATE.start(sensor).model
    pressed = bent(model, (-12.0, -6.0, 0.3), (10.0, 5.0, 0.6))
    _, _, contacts = read([grid_of(model, pressed)] * 3, sensor)
    strong, weak = sorted(contacts.touching, key=lambda contact: -contact.normal_force_over_E_mm2)
    for contact in (strong, weak):
        assert np.isnan(contact.force_N).all()
        assert np.isnan(contact.std("normal_force"))
    ratio = strong.normal_force_over_E_mm2 / weak.normal_force_over_E_mm2
    assert ratio == pytest.approx(2.0, rel=0.1)


def test_a_sensor_without_enough_markers_is_refused() -> None:
    sensor = sensor_of()
    assert sensor.layout is not None
    with pytest.raises(SensorError, match="calibrate rest"):
        ESTIMATE.start(replace(sensor, layout=None))
    few = replace(
        sensor.layout,
        rest_mm=sensor.layout.rest_mm[:6],
        row_column=None,
        radius_mm=np.ones(6),
        is_missing=np.zeros(6, dtype=bool),
    )
    with pytest.raises(LayoutError, match=r"6 markers.*at least 12"):
        ESTIMATE.start(replace(sensor, layout=few))


def test_a_bonded_pad_is_refused_with_the_methods_that_work() -> None:
    bonded = replace(sensor_of().sheet, boundary="bonded", marker_depth_mm=2.0)
    with pytest.raises(SensorError, match=r"boundary = \"bonded\".*PadEstimator.*perimeter or paper"):
        ESTIMATE.start(replace(sensor_of(), sheet=bonded))
    PerimeterEstimator().start(replace(sensor_of(), sheet=bonded))


def assumed_sensor() -> Sensor:
    """A sensor whose sheet is not known."""
    sensor = sensor_of()
    assert sensor.layout is not None
    return replace(sensor, sheet=assumed_sheet(sensor.layout))


@pytest.mark.parametrize(
    ("thickness_mm", "pretension_N_per_mm"),
    [
        (1.5, 0.6),
        (4.5, 0.0),
        *(
            pytest.param(thickness_mm, pretension_N_per_mm, marks=pytest.mark.slow)
            for thickness_mm, pretension_N_per_mm in ((1.5, 0.0), (3.0, 0.0), (3.0, 0.6), (4.5, 0.6))
        ),
    ],
)
def test_contacts_of_an_assumed_sheet(thickness_mm: float, pretension_N_per_mm: float) -> None:
    """The true outline is 2 mm wider than the assumed one, and the thickness differs by up to a half."""
    true = ESTIMATE.start(sensor_of(thickness_mm=thickness_mm, pretension_N_per_mm=pretension_N_per_mm)).model
    light = bent(true, (0.0, 0.0, 1e-3))
    stiffness_mm = 1e-3 / float(-true.dots.displacement_mm(light)[:, 2].min())
    shape = bent(
        true,
        *((x, y, depth_mm * stiffness_mm) for x, y, depth_mm in ((-12.0, -6.0, 1.0), (10.0, 5.0, 2.0))),
    )
    _, surface, contacts = read([grid_of(true, shape, seed=k) for k in range(6)], assumed_sensor())
    assert surface.status == contacts.status == "ok"
    assert surface.spline is not None
    depth_mm = -true.dots.displacement_mm(shape)[:, 2]
    off_mm = -surface.displacement_mm[:, 2] - depth_mm
    assert np.sqrt(np.mean(off_mm**2)) < 0.12 * depth_mm.max()
    assert np.mean(np.abs(off_mm) < 1.96 * np.sqrt(surface.covariance_mm2[:, 2, 2])) > 0.85
    first, second = sorted(contacts.touching, key=lambda contact: contact.centre_mm[0])
    for contact, (x, y) in ((first, (-12.0, -6.0)), (second, (10.0, 5.0))):
        off_mm = contact.centre_mm - [x, y]
        assert np.linalg.norm(off_mm) < 0.5 * PITCH_MM
        assert (np.abs(off_mm) < 3.0 * np.array([contact.std("x"), contact.std("y")])).all()
        assert np.isnan(contact.force_N).all()


def test_frames_that_an_assumed_sheet_does_not_describe_are_those_of_the_perimeter_method(
    model: InversionModel, shape: np.ndarray
) -> None:
    """Dots of a bonded pad move with the shear of its face only where something touches it."""
    sensor, other = assumed_sensor(), PerimeterEstimator()
    state, other_state = ESTIMATE.start(sensor), other.start(sensor)
    flat = np.zeros((model.patch.node_count, 3))
    place_mm = model.layout.rest_mm[:, :2]
    pull_px = 25.0 * np.exp(-0.5 * ((place_mm - [6.0, 4.0]) ** 2).sum(axis=1) / 6.0**2)
    for frame in range(12):
        grid = grid_of(model, shape if frame in {9, 10, 11} else flat, seed=frame)
        if 3 <= frame < 9:
            grid = replace(grid, position_px=grid.position_px + pull_px[:, None] * [1.0, 0.4])
        state, surface, contacts = ESTIMATE.step(state, grid)
        other_state, expected_surface, expected = other.step(other_state, grid)
        assert surface.status == contacts.status == "ok"
        is_described = surface.spline is not None
        assert is_described == (not 3 <= frame < 9)
        if not is_described:
            np.testing.assert_array_equal(surface.displacement_mm, expected_surface.displacement_mm)
            assert len(contacts.touching) == len(expected.touching)
            for each, twin in zip(contacts.touching, expected.touching, strict=True):
                np.testing.assert_array_equal(each.centre_mm, twin.centre_mm)
                assert np.isnan(each.normal_force_over_E_mm2)
    assert len(contacts.touching) == 2
    blind = without(grid, np.ones(ROWS * COLUMNS, dtype=bool))
    state, surface, contacts = ESTIMATE.step(state, blind)
    assert surface.status == "few_markers"
    assert len(contacts.touching) == 2


def test_contacts_of_frames_that_an_assumed_sheet_does_not_describe_begin_and_end_as_in_perimeter(
    model: InversionModel,
) -> None:
    """Also where they jump, and after they ended, while little moves."""
    sensor, other = assumed_sensor(), PerimeterEstimator()
    state, other_state = ESTIMATE.start(sensor), other.start(sensor)
    flat = np.zeros((model.patch.node_count, 3))
    place_mm, seen = model.layout.rest_mm[:, :2], 0
    for frame in range(30):
        grid = grid_of(model, flat, seed=frame)
        at_mm = [6.0, 4.0] if frame < 9 else [-8.0, -6.0]
        pull_px = 25.0 * np.exp(-0.5 * ((place_mm - at_mm) ** 2).sum(axis=1) / 6.0**2)
        if 3 <= frame < 15 or 20 <= frame < 26:
            grid = replace(grid, position_px=grid.position_px + pull_px[:, None] * [1.0, 0.4])
        state, surface, contacts = ESTIMATE.step(state, grid)
        other_state, _, expected = other.step(other_state, grid)
        assert (surface.spline is None) == (frame >= 3)
        assert [each.id for each in contacts.contacts] == [each.id for each in expected.contacts]
        assert [each.phase for each in contacts.contacts] == [each.phase for each in expected.contacts]
        seen += len(contacts.touching)
    assert seen > 15


def test_a_pad_whose_markers_move_little_does_not_show_an_assumed_sheet(model: InversionModel) -> None:
    """Their motion is less than what is no misfit of a known sheet, but no sheet has it without noise."""
    flat = np.zeros((model.patch.node_count, 3))
    away_mm = np.linalg.norm(model.layout.rest_mm[:, :2] - [6.0, 4.0], axis=1)
    pull_px = 0.15 * np.exp(-0.5 * (away_mm / 3.0) ** 2)
    state = ESTIMATE.start(assumed_sensor())
    rules, pitch_px = ESTIMATE.undescribed_frames, state.pitch_px
    assert np.sqrt(np.mean(pull_px**2)) < rules.misfit_pitch * pitch_px
    press = bent(model, (6.0, 4.0, 0.02))
    for frame in range(24):
        is_pulled, is_pressed = 4 <= frame < 8, frame >= 14
        grid = grid_of(model, press if is_pressed else flat, noise_px=0.002, seed=frame)
        if is_pulled:
            grid = replace(grid, position_px=grid.position_px + pull_px[:, None] * [1.0, 0.4])
        state, surface, _ = ESTIMATE.step(state, grid)
        assert (surface.spline is None) == (4 <= frame < 14)


def test_frames_that_the_sheet_of_the_file_does_not_describe_for_long_are_those_of_perimeter(
    model: InversionModel, shape: np.ndarray
) -> None:
    """After a few frames, in which contacts wait; the sheet is used again as soon as it describes a frame."""
    rules, state = ESTIMATE.undescribed_frames, started()
    flat = np.zeros((model.patch.node_count, 3))
    away_mm = np.linalg.norm(model.layout.rest_mm[:, :2] - [6.0, 4.0], axis=1)
    pull_px = 25.0 * np.exp(-0.5 * (away_mm / 6.0) ** 2)
    last = 3 + rules.wait_frames + 8
    for frame in range(last + rules.retry_frames + 2):
        is_pulled = 3 <= frame < last
        grid = grid_of(model, flat if frame < last else shape, seed=frame)
        if is_pulled:
            grid = replace(grid, position_px=grid.position_px + pull_px[:, None] * [1.0, 0.4])
        state, surface, contacts = ESTIMATE.step(state, grid)
        waits = is_pulled and frame < 3 + rules.wait_frames
        assert surface.status == contacts.status == ("not_converged" if waits else "ok")
        if waits:
            assert np.isnan(surface.displacement_mm).all()
            assert not contacts.touching
        elif is_pulled:
            assert surface.spline is None
            assert np.isfinite(surface.displacement_mm).all()
    assert surface.spline is not None
    assert len(contacts.touching) == 2


def test_frames_that_the_sheet_of_the_file_does_not_describe_have_the_contacts_of_the_run_without_a_file(
    model: InversionModel,
) -> None:
    """Under the finger dots swell against rest, also where the first of these frames is touched."""
    finder = uncalibrated_contact_finder()
    other = PerimeterEstimator(contact_finder=finder, uncalibrated_contact_finder=finder)
    state, other_state = started(), other.start(sensor_of())
    flat = np.zeros((model.patch.node_count, 3))
    offset = (model.layout.rest_mm[:, :2] - [6.0, 4.0]) / 7.0
    bump = np.exp(-0.5 * (offset**2).sum(axis=1))[:, None]
    ring = np.exp(-0.5 * ((np.linalg.norm(offset, axis=1) - 3.0) / 0.5) ** 2)[:, None]
    squeezed_px = 25.0 * bump * [1.0, 0.4] - 6.0 * ring * offset
    undescribed = 0
    for frame in range(60):
        share = 0.0 if frame < 12 else min(1.0, 0.5 + 0.1 * (frame - 12))
        grid = grid_of(model, flat, seed=frame)
        area_px2 = 300.0 * np.exp(0.25 * share * bump[:, 0])
        grid = replace(grid, position_px=grid.position_px + share * squeezed_px, area_px2=area_px2)
        state, surface, contacts = ESTIMATE.step(state, grid)
        other_state, _, expected = other.step(other_state, grid)
        if surface.status == "ok" and surface.spline is None and frame > 30:
            undescribed += 1
            (contact,), (twin,) = contacts.touching, expected.touching
            np.testing.assert_allclose(contact.centre_mm, twin.centre_mm, atol=0.1 * PITCH_MM)
            np.testing.assert_allclose(contact.centre_mm, [6.0, 4.0], atol=PITCH_MM)
    assert undescribed > 20


def test_an_estimator_that_is_used_directly_limits_blas_to_one_thread() -> None:
    from threadpoolctl import threadpool_info, threadpool_limits

    with threadpool_limits(limits=2, user_api="blas"):
        ESTIMATE.start(replace(sensor_of(), name="whose state is not kept from other tests"))
        assert {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"} == {1}


def test_the_depth_of_a_contact_is_less_certain_where_its_face_is_not_resolved(model: InversionModel) -> None:
    """A flat face of this size is not distinguished from a hollow, whose middle is deeper."""
    relative = []
    for radius_mm in (1.0, 5.0):
        pressed = bent(model, (-5.0, 3.0, 1.0), radius_mm=radius_mm)
        (contact,) = read([grid_of(model, pressed, seed=k) for k in range(6)])[2].touching
        relative.append(contact.std("depth") / contact.depth_mm)
    assert relative[1] > 1.15 * relative[0]


def test_a_camera_that_moves_before_an_assumed_sheet() -> None:
    """The markers along the clamp show the motion; without it, contacts along the clamp explained it."""
    known = sensor_of(young_MPa=2.0)
    model = ESTIMATE.start(known).model
    shape = bent(model, (-10.0, 5.0, 0.5))
    state = ESTIMATE.start(replace(known, sheet=assumed_sheet(known.layout)))
    chance = np.random.default_rng(0)
    for number in range(30):
        grid = grid_of(model, shape if number > 4 else np.zeros_like(shape), seed=number)
        shift_px, turn_rad = chance.normal(0.0, 0.6, 2), chance.normal(0.0, 5e-4)
        arm_px = grid.position_px - 800.0
        turned_px = turn_rad * np.column_stack([-arm_px[:, 1], arm_px[:, 0]])
        moved_px = grid.position_px + (shift_px + turned_px if number > 1 else 0.0)
        state, _, contacts = ESTIMATE.step(state, replace(grid, position_px=moved_px))
        if number > 6:
            (contact,) = contacts.touching
            np.testing.assert_allclose(contact.centre_mm, [-10.0, 5.0], atol=0.5)
