"""Forces that the noise of the markers hides, and presses of large slack skins that are not much stronger."""

from functools import cache

import numpy as np
import pytest

from bent_sheets import bent, grid_of, sensor_of
from layouts import lattice_layout
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.gauss_newton import GaussNewton
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel, NominalSheet
from manytouch.mechanics.shell.equilibrium import tangent_factor
from manytouch.values import Contact, Sensor, Sheet
from straight import straight_camera

NOISE_PX = 0.008
USUAL_PX = 0.02
YOUNG_MPA = 1.0


@cache
def large_skin(pretension_N_per_mm: float = 0.0) -> Sensor:
    """192 x 180 mm and 2 mm thick."""
    return Sensor(
        name="large",
        camera=straight_camera(800, 600, focal_px=600.0, distance_mm=220.0),
        layout=lattice_layout(29, 31, 6.0),
        sheet=Sheet(
            size_mm=np.array([192.0, 180.0]),
            thickness_mm=2.0,
            young_MPa=YOUNG_MPA,
            poisson=0.47,
            pretension_N_per_mm=pretension_N_per_mm,
        ),
        centre_noise_px=NOISE_PX,
    )


@cache
def model_of(pretension_N_per_mm: float = 0.0) -> InversionModel:
    return NominalSheet()(large_skin(pretension_N_per_mm), USUAL_PX)


def seen_mm2_per_px(model: InversionModel, coefficient_mm: np.ndarray, place_mm: np.ndarray) -> float:
    """A force on a square of one pitch over the motion of all marker images, around a deformed shape."""
    offset_mm = 0.25 * model.pitch_mm * np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    load = model.patch.load(place_mm + offset_mm, np.tile([0.0, 0.0, 0.25], (4, 1)))
    tangent, force = model.shell.empty_tangent(), np.empty_like(load)
    model.shell.forces_and_tangent(coefficient_mm, force, tangent)
    load = (load * model.patch.is_free).reshape(1, -1)
    moved_mm = tangent_factor(model.shell, tangent).solve(load)[0].reshape(-1, 3)
    step_mm = 1e-4 / np.abs(moved_mm).max() * moved_mm
    images = model.dots.displacement_px
    moved_px = 0.5 * (images(coefficient_mm + step_mm) - images(coefficient_mm - step_mm))
    return float(np.linalg.norm(step_mm) / np.linalg.norm(moved_mm) / np.linalg.norm(moved_px))


@pytest.mark.parametrize("pretension_N_per_mm", [0.0, 0.02])
def test_the_noise_of_a_single_force_is_that_of_all_marker_images(pretension_N_per_mm: float) -> None:
    model = model_of(pretension_N_per_mm)
    at_rest = np.zeros((model.patch.node_count, 3))
    expected_mm2 = USUAL_PX * seen_mm2_per_px(model, at_rest, np.zeros(2))
    found_mm2 = model.nodes.force_noise_mm2(model.patch.slopes(at_rest[:, 2]), USUAL_PX)
    assert found_mm2 == pytest.approx(expected_mm2, rel=1e-3)
    other = model_of(0.0).with_pretension(pretension_N_per_mm / YOUNG_MPA).nodes
    assert other.seen_mm2_per_px == pytest.approx(model.nodes.seen_mm2_per_px)
    assert other.stiffening == pytest.approx(model.nodes.stiffening)


@pytest.mark.parametrize("press_mm2", [0.02, 0.08])
def test_a_load_stiffens_the_sheet_less_far_from_it_and_more_under_it(press_mm2: float) -> None:
    model = model_of()
    place_mm = np.array([45.0, 35.0])
    at_rest, loaded = np.zeros((model.patch.node_count, 3)), bent(model, (*place_mm, press_mm2))
    before, after = (
        model.nodes.force_noise_mm2(model.patch.slopes(shape[:, 2]), USUAL_PX) for shape in (at_rest, loaded)
    )
    far, near = (
        seen_mm2_per_px(model, loaded, at_mm) / seen_mm2_per_px(model, at_rest, at_mm)
        for at_mm in (-place_mm, place_mm)
    )
    assert far < after / before < near
    assert near > 1.2


def test_the_unit_of_forces_is_less_only_where_the_markers_show_less() -> None:
    inversion = GaussNewton()
    small, large = NominalSheet()(sensor_of(), USUAL_PX), model_of()
    for model, least, most in ((small, 1.0, 1.0), (large, 0.01, 0.2)):
        at_rest = np.zeros((model.patch.node_count, 2))
        share = inversion.force_unit_mm2(model, at_rest, USUAL_PX) / model.nodes.force_unit_mm2
        assert least <= share <= most
    pressed = large.patch.slopes(bent(large, (0.0, 0.0, 0.2))[:, 2])
    assert inversion.force_unit_mm2(large, pressed, USUAL_PX) > 2.0 * inversion.force_unit_mm2(
        large, np.zeros_like(pressed), USUAL_PX
    )


def touching(
    *presses: tuple[float, float, float], frames: int = 3, sensor: Sensor | None = None
) -> list[Contact]:
    """Contacts after this number of frames with presses: x, y, and force over E."""
    estimator = MechanicsEstimator()
    state = estimator.start(sensor or large_skin())
    shape = bent(state.model, *presses)
    shapes = [np.zeros_like(shape)] * 2 + [shape] * frames
    for seed, each in enumerate(shapes):
        grid = grid_of(state.model, each, noise_px=NOISE_PX, seed=seed)
        state, _, contacts = estimator.step(state, grid)
    return list(contacts.touching)


@pytest.mark.parametrize("place_mm", [(0.0, 0.0), (40.0, -25.0), (-60.0, 50.0)])
def test_a_press_of_some_millinewtons_on_a_large_skin_is_found(place_mm: tuple[float, float]) -> None:
    press_mm2 = 0.004
    (contact,) = touching((*place_mm, press_mm2))
    assert contact.centre_mm == pytest.approx(place_mm, abs=3.0)
    assert contact.normal_force_over_E_mm2 == pytest.approx(press_mm2, rel=0.15)


def test_noise_of_a_large_skin_is_no_contact() -> None:
    estimator, state = MechanicsEstimator(), MechanicsEstimator().start(large_skin())
    at_rest = np.zeros((state.model.patch.node_count, 3))
    for seed in range(60):
        grid = grid_of(state.model, at_rest, noise_px=NOISE_PX, seed=seed)
        state, _, contacts = estimator.step(state, grid)
        assert not contacts.touching


def test_a_light_press_beside_a_strong_one_is_found_on_a_large_skin() -> None:
    strong, light = touching((-40.0, -30.0, 0.06), (35.0, 30.0, 0.003), frames=5)
    assert light.centre_mm == pytest.approx((35.0, 30.0), abs=3.0)
    assert light.normal_force_over_E_mm2 == pytest.approx(0.003, rel=0.25)
    assert strong.normal_force_over_E_mm2 == pytest.approx(0.06, rel=0.05)


def test_a_press_with_two_hundredths_of_the_force_of_another_one_is_found() -> None:
    strong, light = touching((-40.0, 0.0, 0.3), (35.0, 10.0, 0.006), frames=5)
    assert strong.normal_force_over_E_mm2 == pytest.approx(0.3, rel=0.02)
    assert light.centre_mm == pytest.approx((35.0, 10.0), abs=3.0)
    assert light.normal_force_over_E_mm2 == pytest.approx(0.006, rel=0.15)


@pytest.mark.parametrize("place_mm", [(0.0, 0.0), (8.0, -5.0)])
def test_a_light_press_on_a_thick_sheet_is_found(place_mm: tuple[float, float]) -> None:
    (contact,) = touching((*place_mm, 0.03), sensor=sensor_of(thickness_mm=4.0))
    assert contact.centre_mm == pytest.approx(place_mm, abs=1.0)
    assert contact.normal_force_over_E_mm2 == pytest.approx(0.03, rel=0.05)


@pytest.mark.parametrize("share", [1.5, 2.5])
def test_two_balls_that_begin_lightly_are_two_once_the_markers_show_it(share: float) -> None:
    """`share` is their force in least forces in the first frames, in which they are one contact or none."""
    estimator, state = MechanicsEstimator(), MechanicsEstimator().start(sensor_of())
    model, least_mm2 = state.model, state.model.nodes.least_force_mm2

    def shape(force: float, radius_mm: float) -> np.ndarray:
        presses = [(x_mm, y_mm, force * least_mm2) for x_mm, y_mm in ((-6.0, 0.0), (6.0, 1.0))]
        return bent(model, *presses, radius_mm=radius_mm)

    shapes = [np.zeros((model.patch.node_count, 3))] * 2 + [shape(share, 0.5)] * 2 + [shape(25.0, 1.5)] * 2
    for seed, each in enumerate(shapes):
        grid = grid_of(model, each, noise_px=NOISE_PX, seed=seed)
        state, _, contacts = estimator.step(state, grid)
    assert len(contacts.touching) == 2


@pytest.mark.parametrize("seed", range(3))
def test_three_presses_that_begin_in_one_frame_are_three_contacts_at_once(seed: int) -> None:
    turn = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi * np.arange(3) / 3
    places_mm = 9.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    forces_mm2 = (0.16, 0.1, 0.13)
    presses = [(float(x), float(y), force) for (x, y), force in zip(places_mm, forces_mm2, strict=True)]
    found = touching(*presses, frames=1, sensor=sensor_of())
    assert len(found) == 3
    for place_mm, force_mm2 in zip(places_mm, forces_mm2, strict=True):
        nearest = min(found, key=lambda each: float(np.linalg.norm(each.centre_mm - place_mm)))
        assert nearest.centre_mm == pytest.approx(place_mm, abs=1.0)
        assert nearest.normal_force_over_E_mm2 == pytest.approx(force_mm2, rel=0.12)
