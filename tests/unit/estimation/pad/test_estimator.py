"""Contacts on a pad from the images of its own model, and from frames that are not usable."""

from dataclasses import replace

import numpy as np
import pytest

from bonded_pad import POISSON, THICKNESS_MM, YOUNG_MPA, RigidFace, pad_sensor, seen_px
from displaced_dots import Unaware, displaced_dots
from layouts import grid_at
from manytouch import sample
from manytouch.errors import LayoutError, SensorError
from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.estimation.mechanics.regions.outlines import polygon_area
from manytouch.estimation.pad.contacts.pad_contacts import PadContacts
from manytouch.estimation.pad.contacts.pad_shape import large_strain, pad_shape
from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.pad_model import NominalPad
from manytouch.estimation.pad.patch_fit import tractions
from manytouch.estimation.pad.patch_forces import FORCE, RADIAL_SHEAR
from manytouch.estimation.pad.patch_kernels import Profile
from manytouch.estimation.pad.patches import Patches, near_groups
from manytouch.values import Contacts, Phase, Sensor, Status, Surface, TrackedGrid

ESTIMATE = PadEstimator(nominal_pad=NominalPad(element_thickness=0.4))
ONE = np.array([[1.3, -0.7, 0.9, 0.1, 0.8, 2.0, 0.3, -0.1, 0.2, 0.05]])
"""Centre, root of the second moment, normal force, shear, torque over E, radial shear."""


def patches(contact: np.ndarray, profile: Profile = Profile.DOME) -> Patches:
    """Contacts (c, 10) with one profile."""
    return Patches(parameters=contact, profile=np.full(len(contact), profile, dtype=np.int64))


def pressed_px(state: PadState, contact: np.ndarray, profile: Profile = Profile.DOME) -> np.ndarray:
    """(m, 2) marker images under contacts (c, 10), without the free sides' share of the curvature."""
    model = state.model
    image, moved_mm = np.zeros(2 * len(model.rest_px)), np.zeros((len(model.rest_px), 3))
    for parameters in contact:
        images = ESTIMATE.fitter.images(model, parameters[None, :5], profile)
        load = np.array([*parameters[5:9], parameters[FORCE] * parameters[RADIAL_SHEAR]])
        image += load @ images.column[0]
        nodal = model.by_node(tractions(model, patches(parameters[None], profile)))
        moved_mm += np.tensordot(nodal, model.marker, axes=2)
    curved_px = model.project(moved_mm) - model.rest_px - np.einsum("mij,mj->mi", model.slope_px, moved_mm)
    return model.rest_px + image.reshape(-1, 2) + curved_px


def steps(state: PadState, position_px: np.ndarray, count: int = 3) -> tuple[PadState, Surface, Contacts]:
    for seed in range(count):
        state, surface, contacts = ESTIMATE.step(state, grid_at(position_px, noise_px=0.01, seed=seed))
    return state, surface, contacts


def test_nothing_touches_a_pad_at_rest(pad_state: PadState) -> None:
    _, surface, contacts = steps(pad_state, seen_px(pad_sensor()))
    assert not contacts.contacts
    assert np.abs(surface.displacement_mm).max() < 1e-3


def test_dots_that_are_displaced_by_more_than_their_pixels_show_weigh_less(pad_state: PadState) -> None:
    frames = displaced_dots(grid_at(pressed_px(pad_state, ONE), std_px=0.005), 20, 0.1)
    weight = []
    for estimate in (ESTIMATE, replace(ESTIMATE, excess_noise=Unaware())):
        state = pad_state
        for grid in frames:
            state, _, contacts = estimate.step(state, grid)
        assert len(contacts.touching) == 1
        weight.append(estimate.fit_frame(state, grid).weight)
    assert np.median(weight[0]) < 0.5 * np.median(weight[1])


@pytest.mark.parametrize("moved_px", [(0.5, 0.5), (3.0, 0.0)])
def test_an_image_that_shifts_as_a_whole_shows_no_contact(
    pad_state: PadState, moved_px: tuple[float, float]
) -> None:
    _, _, contacts = steps(pad_state, seen_px(pad_sensor()) + np.array(moved_px))
    assert not contacts.touching


@pytest.mark.parametrize(("shift_px", "turn_rad"), [((1.5, -0.8), 0.0), ((0.0, 0.0), 1.5e-2)])
def test_a_contact_is_the_same_where_the_camera_has_moved(
    pad_state: PadState, shift_px: tuple[float, float], turn_rad: float
) -> None:
    """The image moves while a contact is held: the only one, with nearly the same force and shear."""
    held_px = pressed_px(pad_state, ONE)
    state, _, before = steps(pad_state, held_px)
    middle_px = pad_state.model.rest_px.mean(axis=0)
    turned_px = turn_rad * (held_px - middle_px)[:, ::-1] * np.array([-1.0, 1.0])
    _, _, after = steps(state, held_px + turned_px + np.array(shift_px), count=4)
    (was,), (found,) = before.touching, after.touching
    press_N = -was.force_N[2]
    np.testing.assert_allclose(found.force_N, was.force_N, atol=0.03 * press_N)
    np.testing.assert_allclose(found.centre_mm, was.centre_mm, atol=0.05)


def test_a_contact_is_found_with_force_shear_and_torque(pad_state: PadState) -> None:
    _, surface, contacts = steps(pad_state, pressed_px(pad_state, ONE))
    (found,) = contacts.touching
    np.testing.assert_allclose(found.centre_mm, ONE[0, :2], atol=0.1)
    press_N = YOUNG_MPA * ONE[0, 5]
    assert -found.force_N[2] == pytest.approx(press_N, abs=2.0 * found.std("normal_force"))
    assert found.std("normal_force") < 0.3 * press_N
    np.testing.assert_allclose(found.force_N[:2], YOUNG_MPA * ONE[0, 6:8], atol=0.03 * press_N)
    assert found.torque_Nmm == pytest.approx(YOUNG_MPA * ONE[0, 8], abs=3.0 * found.std("torque"))
    assert found.normal_force_over_E_mm2 == pytest.approx(-found.force_N[2] / YOUNG_MPA)
    assert 0.0 < found.depth_mm < 1.0
    assert np.linalg.eigvalsh(found.covariance[:7, :7]).min() > 0.0
    under = sample(surface, found.centre_mm[:1], found.centre_mm[1:])
    assert under.depth_mm[0] == pytest.approx(found.depth_mm, rel=0.15)
    assert found.outline is not None


def test_the_pressure_of_the_surface_adds_up_to_the_force(pad_state: PadState) -> None:
    _, surface, contacts = steps(pad_state, pressed_px(pad_state, ONE))
    assert surface.spline is not None
    total = surface.spline.force_over_E_mm2.sum(axis=0)
    assert -total[2] == pytest.approx(contacts.touching[0].normal_force_over_E_mm2, rel=1e-6)


def test_the_force_grows_over_the_linear_one_with_the_depth(pad_state: PadState) -> None:
    fit = PadEstimator().fit_frame(pad_state, grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0))
    shape = pad_shape(pad_state.model, fit)
    (linear,), (stiff,) = (
        PadContacts(stiffening=value, sticking=0.0)(pad_state.model, fit, shape) for value in (0.0, 0.35)
    )
    assert linear.normal_force_over_E_mm2 == pytest.approx(float(fit.force_mm2[0]))
    ratio = 1.0 + 0.35 * linear.depth_mm / THICKNESS_MM
    assert stiff.normal_force_over_E_mm2 == pytest.approx(ratio * linear.normal_force_over_E_mm2)
    assert stiff.force_N[2] == pytest.approx(ratio * linear.force_N[2])
    assert stiff.std("normal_force") > linear.std("normal_force")
    np.testing.assert_allclose(stiff.force_N[:2], linear.force_N[:2])


@pytest.mark.parametrize(
    ("radial", "profile", "share"),
    [
        (0.05, Profile.DOME, 0.0),
        (-0.11, Profile.DOME, 0.5),
        (-0.3, Profile.DOME, 1.0),
        (-0.3, Profile.RIM, 1.0),
    ],
)
def test_the_force_of_an_object_that_sticks_grows_more(
    pad_state: PadState, radial: float, profile: Profile, share: float
) -> None:
    model = pad_state.model
    fit = PadEstimator().fit_frame(pad_state, grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0))
    parameters = fit.patches.parameters.copy()
    parameters[0, RADIAL_SHEAR] = radial
    fit = replace(fit, patches=patches(parameters, profile))
    shape = pad_shape(model, fit)
    (found,) = PadContacts(stiffening=0.2, sticking=0.6)(model, fit, shape)
    ratio = 1.0 + (0.2 + share * 0.6) * found.depth_mm / THICKNESS_MM
    assert found.normal_force_over_E_mm2 == pytest.approx(ratio * float(fit.force_mm2[0]))


@pytest.mark.parametrize("sticks", [False, True])
@pytest.mark.parametrize("radius_mm", [2.5, 3.2, 4.0])
def test_a_flat_face_is_as_deep_as_its_force_presses_it(
    pad_state: PadState, radius_mm: float, sticks: bool
) -> None:
    """The depth of a patch with the force, moment and radial shear of a rigid face on a layer."""
    model, depth_mm = pad_state.model, 0.02
    per_mm, root_mm, _, radial = RigidFace(radius_mm, THICKNESS_MM, POISSON, sticks).moments
    fit = PadEstimator().fit_frame(pad_state, grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0))
    one = np.array([[0.4, -0.3, root_mm, 0.0, root_mm, depth_mm * per_mm, 0.0, 0.0, 0.0, radial]])
    fit = replace(fit, patches=patches(one, Profile.FLAT), sheet=np.zeros_like(fit.sheet))
    (found,) = PadContacts()(model, fit, pad_shape(model, fit))
    assert found.depth_mm == pytest.approx(depth_mm, rel=0.05)


@pytest.mark.parametrize("sticks", [False, True])
@pytest.mark.parametrize(("thickness_mm", "poisson"), [(4.0, 0.48), (2.5, 0.49)])
def test_a_flat_face_that_is_seen_has_its_depth(thickness_mm: float, poisson: float, sticks: bool) -> None:
    """Images of markers on a layer under a rigid face with a radius of .7 and 1.1 thicknesses."""
    sensor = pad_sensor(thickness_mm=thickness_mm, poisson=poisson)
    assert sensor.layout is not None
    face, depth_mm = RigidFace(2.8, thickness_mm, poisson, sticks), 0.1
    moved_mm = depth_mm * face.displacement_mm(sensor.layout.rest_mm[:, :2] - (0.3, -0.4), 0.5)
    _, _, contacts = steps(ESTIMATE.start(sensor), seen_px(sensor, moved_mm))
    (found,) = contacts.touching
    np.testing.assert_allclose(found.centre_mm, (0.3, -0.4), atol=0.1)
    assert found.depth_mm == pytest.approx(depth_mm, rel=0.17)
    assert found.normal_force_over_E_mm2 == pytest.approx(depth_mm * face.moments[0], rel=0.12)


@pytest.mark.parametrize(("radial", "share"), [(0.05, 0.0), (-0.11, 0.5), (-0.3, 1.0)])
def test_the_force_of_a_flat_face_that_sticks_grows_as_a_thin_pad_stiffens(
    pad_state: PadState, radial: float, share: float
) -> None:
    fit = PadEstimator().fit_frame(pad_state, grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0))
    parameters = fit.patches.parameters.copy()
    parameters[0, RADIAL_SHEAR] = radial
    fit = replace(fit, patches=patches(parameters, Profile.FLAT))
    (found,) = PadContacts(stiffening=0.2)(pad_state.model, fit, pad_shape(pad_state.model, fit))
    strain = found.depth_mm / THICKNESS_MM
    ratio = (1.0 - share) * (1.0 + 0.2 * strain) + share * (1.0 - strain) ** -1.5
    assert found.normal_force_over_E_mm2 == pytest.approx(ratio * float(fit.force_mm2[0]))


@pytest.mark.parametrize("profile", [Profile.DOME, Profile.FLAT])
@pytest.mark.parametrize("loads", [(0.3, 0.4, 0.0), (0.0, 0.0, -0.5 * np.sqrt(2.0) * 2.4)])
def test_the_depth_of_a_flat_face_that_is_dragged_or_turned_is_less_certain(
    pad_state: PadState, profile: Profile, loads: tuple[float, float, float]
) -> None:
    """By half of half its depth, where shear or turn are half the normal force."""
    fit = PadEstimator().fit_frame(pad_state, grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0))
    one = np.array([[0.5, -0.5, 2.4, 0.0, 2.4, 1.0, *loads, -0.2]])
    fit = replace(fit, patches=patches(one, profile), sheet=np.zeros_like(fit.sheet))
    shape = pad_shape(pad_state.model, fit)
    found, usual = (
        PadContacts(dragged_face=share)(pad_state.model, fit, shape)[0].std("depth") for share in (0.5, 0.0)
    )
    (contact,) = PadContacts()(pad_state.model, fit, shape)
    more_mm = 0.25 * contact.depth_mm / contact.normal_force_over_E_mm2 if profile is Profile.FLAT else 0.0
    assert found == pytest.approx(np.hypot(usual, more_mm))


def test_two_contacts_are_two(pad_state: PadState) -> None:
    two = np.vstack([ONE, [-5.0, 2.0, 0.7, 0.0, 0.7, 1.2, 0.0, 0.1, 0.0, 0.0]])
    _, _, contacts = steps(pad_state, pressed_px(pad_state, two))
    centres = np.array([contact.centre_mm for contact in contacts.touching])
    assert len(centres) == 2
    away = np.linalg.norm(two[:, None, :2] - centres, axis=2)
    assert away.min(axis=1).max() < 0.4


def test_the_only_contact_on_a_touched_pad_needs_no_clear_force(pad_state: PadState) -> None:
    """Displaced markers show that something presses, also where they hardly show how hard."""
    strict = PadEstimator(start_stds=1e3, last_stds=1e3)
    touched = grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0)
    state, _, first = strict.step(pad_state, touched)
    _, _, then = strict.step(state, touched)
    assert len(first.touching) == len(then.touching) == 1
    hardly = ONE * np.where(np.arange(10) < 5, 1.0, 0.02)  # displacements as small as those of noise
    _, _, none = strict.step(pad_state, grid_at(pressed_px(pad_state, hardly), noise_px=0.01, seed=0))
    assert not none.touching


def test_a_contact_keeps_its_identity_and_ends(pad_state: PadState) -> None:
    state, _, first = steps(pad_state, pressed_px(pad_state, ONE))
    moved = ONE.copy()
    moved[0, 0] += 0.5
    state, _, second = steps(state, pressed_px(pad_state, moved))
    assert [each.id for each in second.contacts] == [each.id for each in first.touching]
    _, _, last = steps(state, pad_state.model.rest_px, count=1)
    assert [each.phase for each in last.contacts] == [Phase.END]


def test_contacts_end_where_no_more_are_allowed(pad_state: PadState) -> None:
    estimate = replace(ESTIMATE, max_contacts=1)
    state, _, pressed = estimate.step(pad_state, grid_at(pressed_px(pad_state, ONE), noise_px=0.01, seed=0))
    assert len(pressed.touching) == 1
    state, _, lifted = estimate.step(state, grid_at(pad_state.model.rest_px, noise_px=0.01, seed=1))
    assert not lifted.touching
    assert len(state.patches) == 0


def test_contacts_beyond_the_largest_number_are_dropped(pad_state: PadState) -> None:
    two = np.vstack([ONE, [-5.0, 2.0, 0.7, 0.0, 0.7, 1.2, 0.0, 0.1, 0.0, 0.0]])
    state, _, contacts = steps(pad_state, pressed_px(pad_state, two))
    assert len(contacts.touching) == 2
    fewer = replace(ESTIMATE, max_contacts=1)
    state, _, _ = fewer.step(state, grid_at(pressed_px(pad_state, two), noise_px=0.01, seed=4))
    assert len(state.patches) == 1


def test_interleaved_states_give_the_same_bits(pad_state: PadState) -> None:
    position_px = pressed_px(pad_state, ONE)
    alone, _, one = steps(pad_state, position_px)
    steps(pad_state, pressed_px(pad_state, ONE * 1.1))
    again, _, two = steps(pad_state, position_px)
    np.testing.assert_array_equal(alone.patches.parameters, again.patches.parameters)
    np.testing.assert_array_equal(one.touching[0].covariance, two.touching[0].covariance)


@pytest.fixture(scope="module")
def exact_std() -> float:
    """Standard deviation of the normal force over E of `ONE` on a pad whose numbers are known."""
    exact = ESTIMATE.start(pad_sensor(poisson_std=1e-4, thickness_std_mm=1e-3, young_std_MPa=1e-4))
    return steps(exact, pressed_px(exact, ONE))[2].touching[0].std("normal_force")


@pytest.mark.parametrize(
    ("unknown", "least"),
    [({"poisson_std": 0.02}, 1.2), ({"thickness_std_mm": 0.4}, 1.005), ({"young_std_MPa": 0.05}, 1.2)],
    ids=["poisson", "thickness", "young"],
)
def test_an_unknown_number_of_the_pad_widens_the_force(
    exact_std: float, unknown: dict[str, float], least: float
) -> None:
    known = {"poisson_std": 1e-4, "thickness_std_mm": 1e-3, "young_std_MPa": 1e-4}
    state = ESTIMATE.start(pad_sensor(**known | unknown))
    found = steps(state, pressed_px(state, ONE))[2].touching[0]
    assert found.std("normal_force") > least * exact_std


def test_wrong_parameters_move_the_force_within_its_deviation(pad_state: PadState) -> None:
    state = ESTIMATE.start(pad_sensor(poisson=0.47, poisson_std=0.01, thickness_mm=4.2))
    found = steps(state, pressed_px(pad_state, ONE))[2].touching[0]
    assert abs(-found.force_N[2] - YOUNG_MPA * ONE[0, 5]) < 2.5 * found.std("normal_force")


@pytest.mark.parametrize(
    "changed",
    [
        {"poisson": 0.49},
        pytest.param({"thickness_mm": 3.85}, marks=pytest.mark.slow),
        pytest.param({"marker_depth_mm": 0.9}, marks=pytest.mark.slow),
    ],
)
def test_wrong_parameters_move_the_depth_within_its_deviation(
    pad_state: PadState, changed: dict[str, float]
) -> None:
    exact = steps(pad_state, pressed_px(pad_state, ONE))[2].touching[0]
    stds = {"poisson_std": 0.01, "thickness_std_mm": 0.15, "marker_depth_std_mm": 0.2}
    state = ESTIMATE.start(pad_sensor(**stds, **changed))
    found = steps(state, pressed_px(pad_state, ONE))[2].touching[0]
    assert abs(found.depth_mm - exact.depth_mm) < 1.5 * found.std("depth")


def test_a_held_contact_keeps_its_depth(pad_state: PadState) -> None:
    position_px = pressed_px(pad_state, np.array([[1.0, -1.0, 0.7, 0.0, 0.7, 6.0, 0.0, 0.0, 0.0, 0.1]]))
    state, depth_mm = pad_state, []
    for seed in range(6):
        state, _, contacts = ESTIMATE.step(state, grid_at(position_px, noise_px=0.01, seed=seed))
        depth_mm.append(contacts.touching[0].depth_mm)
    assert np.ptp(depth_mm) < 0.05 * np.mean(depth_mm)


@pytest.mark.parametrize("root", [(0.2, 0.0, 3.5), (3.5, 0.0, 0.2), (0.25, 0.3, 0.25), (2.5, 0.0, 2.5)])
def test_a_fit_ends_at_the_same_contact_from_narrow_and_wide_guesses(
    pad_state: PadState, root: tuple[float, float, float]
) -> None:
    faint = ONE.copy()
    faint[0, 5:8] *= 0.1
    measured_px = (pressed_px(pad_state, faint) - pad_state.model.rest_px).ravel()
    random = np.random.default_rng(3)
    measured_px += random.normal(0.0, 0.02, measured_px.shape)
    weight = np.full(len(measured_px), 0.03**-2)
    guess = faint.copy()
    guess[0, 2:5] = root
    near, far = (
        ESTIMATE.fitter(pad_state.model, patches(each), measured_px, weight, is_sheet_known=True)
        for each in (faint, guess)
    )
    assert far.misfit == pytest.approx(near.misfit, abs=0.3)
    assert far.force_mm2[0] == pytest.approx(near.force_mm2[0], abs=0.3 * near.force_std_mm2[0])


WIDE = np.array([[0.5, -0.5, 3.4, 0.2, 3.2, 60.0, 2.0, 0.0, 0.0, -0.06]])


@pytest.mark.parametrize("profile", Profile)
def test_a_wide_contact_is_one_with_its_profile_and_force(pad_state: PadState, profile: Profile) -> None:
    wide = np.array([[0.5, -0.5, 2.4, 0.1, 2.2, 20.0, 0.5, 0.0, 0.0, -0.05]])
    state, _, contacts = steps(pad_state, pressed_px(pad_state, wide, profile))
    (found,) = contacts.touching
    assert list(state.patches.profile) == [profile]
    assert found.normal_force_over_E_mm2 == pytest.approx(20.0, rel=0.08)
    assert np.linalg.norm(found.centre_mm - wide[0, :2]) < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_faint_ring_is_one_contact(pad_state: PadState, seed: int) -> None:
    """Its first fit is a narrow dome on one side, which others follow."""
    ring = np.array([[0.5, -0.5, 2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, -0.2]])
    grid = grid_at(pressed_px(pad_state, ring, Profile.RIM), noise_px=0.02, seed=seed)
    state, _, contacts = ESTIMATE.step(pad_state, grid)
    (found,) = contacts.touching
    assert list(state.patches.profile) == [Profile.RIM]
    assert found.normal_force_over_E_mm2 == pytest.approx(2.0, rel=0.15)


def test_patches_that_are_linked_by_others_are_one_group() -> None:
    row = np.repeat(ONE, 4, axis=0)
    row[:, 0], row[:, 2:5] = (0.0, 3.0, 7.0, 40.0), (1.0, 0.0, 1.0)
    assert near_groups(patches(row)) == [(0, 1), (0, 1, 2)]
    assert near_groups(patches(row[[0, 3]])) == []
    assert near_groups(patches(row[:1])) == []


def test_the_only_contact_that_is_allowed_gets_its_profile(pad_state: PadState) -> None:
    estimate = replace(ESTIMATE, max_contacts=1)
    wide = np.array([[0.5, -0.5, 2.4, 0.1, 2.2, 20.0, 0.5, 0.0, 0.0, -0.05]])
    position_px = pressed_px(pad_state, wide, Profile.RIM)
    state, _, contacts = estimate.step(pad_state, grid_at(position_px, noise_px=0.01, seed=0))
    assert list(state.patches.profile) == [Profile.RIM]
    assert len(contacts.touching) == 1


def test_the_profile_of_a_contact_that_begins_later_is_chosen_in_the_next_frame(pad_state: PadState) -> None:
    """In the first frame, which may be the only one, everything is tried at once."""
    wide = np.array([[0.5, -0.5, 2.4, 0.1, 2.2, 6.0, 0.2, 0.0, 0.0, -0.05]])
    position_px = pressed_px(pad_state, wide, Profile.FLAT)
    only, _, _ = steps(pad_state, position_px, count=1)
    rest, _, _ = steps(pad_state, pad_state.reference_px, count=2)
    begun, _, contacts = steps(rest, position_px, count=1)
    later, _, after = steps(begun, position_px, count=1)
    assert [list(state.patches.profile) for state in (only, begun, later)] == [[1], [0], [1]]
    assert len(contacts.touching) == 1
    assert [each.id for each in after.touching] == [each.id for each in contacts.touching]
    np.testing.assert_allclose(later.patches.parameters[:, FORCE], 6.0, rtol=0.1)


def test_a_narrow_contact_stays_a_dome(pad_state: PadState) -> None:
    state, _, _ = steps(pad_state, pressed_px(pad_state, ONE, Profile.RIM))
    assert list(state.patches.profile) == [Profile.DOME]


def test_patches_keep_their_profiles_where_others_come_and_go() -> None:
    pair = patches(np.vstack([ONE, 2.0 * ONE]), Profile.RIM).with_profile(1, Profile.FLAT)
    more = pair.with_more(3.0 * ONE, Profile.DOME)
    assert list(more.profile) == [Profile.RIM, Profile.FLAT, Profile.DOME]
    rest = more.without(0)
    assert list(rest.profile) == [Profile.FLAT, Profile.DOME]
    np.testing.assert_array_equal(rest.parameters, np.vstack([2.0 * ONE, 3.0 * ONE]))


@pytest.mark.parametrize("profile", Profile)
def test_a_ring_is_deepest_on_its_rim_and_a_flat_face_everywhere(
    pad_state: PadState, profile: Profile
) -> None:
    wide = np.array([[0.5, -0.5, 2.4, 0.0, 2.4, 20.0, 0.0, 0.0, 0.0, 0.0]])
    _, surface, contacts = steps(pad_state, pressed_px(pad_state, wide, profile))
    (found,) = contacts.touching
    angle = 2.0 * np.pi * np.arange(48) / 48
    rim = sample(surface, 0.5 + 3.4 * np.cos(angle), -0.5 + 3.4 * np.sin(angle))
    centre = sample(surface, np.array([0.5]), np.array([-0.5]))
    if profile is Profile.FLAT:
        assert np.median(rim.depth_mm) == pytest.approx(centre.depth_mm[0], rel=0.2)
    else:
        assert (np.median(rim.depth_mm) > centre.depth_mm[0]) == (profile is Profile.RIM)
    assert found.depth_mm == pytest.approx(max(rim.depth_mm.max(), centre.depth_mm[0]), rel=0.2)


def test_what_a_pad_keeps_of_a_wide_press_is_no_contact(pad_state: PadState) -> None:
    """Its force and depth contain 0; a touch of the same strength is a contact after the pad came back."""
    nominal = replace(pad_state, model=replace(pad_state.model, shape_is_nominal=True))
    pressed, kept = (pressed_px(pad_state, WIDE * _strength(share)) for share in (1.0, 0.1))
    state, _, contacts = steps(nominal, pressed)
    assert len(contacts.touching) == 1
    state, _, contacts = steps(state, kept, count=12)
    assert not contacts.contacts
    state, _, _ = steps(state, pad_state.model.rest_px)
    _, _, contacts = steps(state, kept)
    assert len(contacts.touching) == 1


def test_what_a_gel_keeps_of_a_press_is_no_contact_however_clear_it_is(pad_state: PadState) -> None:
    """It is one on a pad that was not pressed before, or that came back a while ago, and so are more."""
    rest_px, pressed, kept, lighter = (
        pressed_px(pad_state, ONE * _strength(share)) for share in (0.0, 1.0, 0.05, 0.15)
    )

    def count(*images: tuple[np.ndarray, int]) -> int:
        state = pad_state
        for position_px, frames in images:
            for seed in range(frames):
                grid = grid_at(position_px, noise_px=0.005, std_px=0.005, seed=seed)
                state, _, contacts = ESTIMATE.step(state, grid)
        return len(contacts.touching)

    assert count((kept, 2)) == 1
    assert count((pressed, 3), (kept, 12)) == 0
    assert count((pressed, 3), (rest_px, 40), (kept, 2)) == 1
    assert count((pressed, 3), (lighter, 12)) == 1


def _strength(share: float) -> np.ndarray:
    return np.where(np.isin(np.arange(10), (5, 6, 7, 8)), share, 1.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_faint_press_is_found_where_the_noise_is_little(pad_state: PadState, seed: int) -> None:
    """It moves markers by up to .04 px, 1.8e-3 of the pitch."""
    faint_px = pressed_px(pad_state, ONE * _strength(0.03))
    state = pad_state
    for number in range(2):
        grid = grid_at(faint_px, noise_px=0.005, std_px=0.005, seed=2 * seed + number)
        state, _, contacts = ESTIMATE.step(state, grid)
    (found,) = contacts.touching
    assert np.linalg.norm(found.centre_mm - ONE[0, :2]) < 0.5
    assert found.normal_force_over_E_mm2 == pytest.approx(0.03 * ONE[0, 5], rel=0.4)


def test_no_region_is_beyond_the_pad(pad_state: PadState) -> None:
    near_side = np.array([[10.5, 8.0, 1.6, 0.0, 1.6, 6.0, 0.0, 0.0, 0.0, -0.06]])
    (found,) = steps(pad_state, pressed_px(pad_state, near_side))[2].touching
    assert found.outline is not None
    half_mm = 0.5 * np.array(pad_state.model.patch.size_mm)
    assert (np.abs(found.outline[0].point_mm) <= half_mm + 1e-9).all()
    assert found.area_mm2 == pytest.approx(polygon_area(found.outline[0].point_mm))


def test_a_motion_that_no_contact_explains_delays_no_later_contact(pad_state: PadState) -> None:
    after, _, contacts = steps(replace(pad_state, refused_misfit=1e6), seen_px(pad_sensor()), count=1)
    assert not contacts.touching
    assert len(steps(after, pressed_px(pad_state, ONE), count=1)[2].touching) == 1


def test_few_markers_are_a_status(pad_state: PadState) -> None:
    position_px = seen_px(pad_sensor())
    position_px[11:] = np.nan
    _, surface, contacts = ESTIMATE.step(pad_state, grid_at(position_px))
    assert contacts.status is surface.status is Status.FEW_MARKERS


def test_missing_markers_do_not_press(pad_state: PadState) -> None:
    position_px = pressed_px(pad_state, ONE)
    position_px[::3] = np.nan
    (found,) = steps(pad_state, position_px)[2].touching
    assert np.linalg.norm(found.centre_mm - ONE[0, :2]) < 4.0 * found.std("x")


def test_large_strain_is_that_of_a_column_with_logarithmic_strain() -> None:
    linear_mm = np.array([-0.2, 0.0, 0.05, 1.0, 2.5])
    found_mm = large_strain(linear_mm, 4.0)
    np.testing.assert_array_equal(found_mm[:2], linear_mm[:2])
    np.testing.assert_allclose(found_mm[2:], 4.0 * (1.0 - np.exp(-linear_mm[2:] / 4.0)))


def test_depths_far_beyond_the_pad_are_its_thickness() -> None:
    with np.errstate(all="raise"):
        np.testing.assert_allclose(large_strain(np.array([1e3, 1e30]), 4.0), 4.0, rtol=0.12)


def test_contacts_without_force_can_be_joined(pad_state: PadState) -> None:
    pair = np.vstack([ONE, ONE])
    pair[1, :2] += 0.8
    position_px = pressed_px(pad_state, pair * np.where(np.arange(10) == 5, 1e-3, 1.0))
    _, _, contacts = steps(
        replace(pad_state, patches=patches(pair * np.where(np.arange(10) == 5, -1.0, 1.0))), position_px
    )
    assert contacts.status is Status.OK


def test_the_method_mechanics_chooses_by_the_boundary(pad_state: PadState) -> None:
    class Started:
        def start(self, sensor: Sensor) -> PadState:
            return pad_state

        def step(self, state: PadState, grid: TrackedGrid) -> tuple[PadState, Surface, Contacts]:
            return ESTIMATE.step(state, grid)

    method = MechanicsEstimator(pad=Started())
    assert method.start(pad_sensor()) is pad_state
    _, _, contacts = method.step(pad_state, grid_at(pressed_px(pad_state, ONE)))
    assert contacts.touching


def without(sensor: Sensor, **parts: None) -> Sensor:
    return replace(sensor, **parts)


def test_a_pad_without_layout_or_with_few_markers_is_refused() -> None:
    sensor = pad_sensor()
    with pytest.raises(SensorError, match=r"no \[markers\]"):
        ESTIMATE.start(without(sensor, layout=None))
    layout = sensor.layout
    assert layout is not None
    few = replace(
        layout,
        rest_mm=layout.rest_mm[:6],
        row_column=None,
        radius_mm=layout.radius_mm[:6],
        is_missing=layout.is_missing[:6],
    )
    with pytest.raises(LayoutError, match="6 markers; a pad needs 12"):
        ESTIMATE.start(replace(sensor, layout=few))
