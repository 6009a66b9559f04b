"""Contacts that are found for presses of the suite: their widths and profiles, and where they show."""

from dataclasses import replace

import numpy as np
import pytest

from layouts import grid_at
from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.pad_model import NominalPad
from manytouch.estimation.pad.patch_forces import RADIAL_SHEAR
from manytouch.estimation.pad.patches import Profile
from manytouch.evaluation.suite.calibrated.pad_sensor import calibration_presses, drawn_pad
from manytouch.evaluation.suite.pads.cases import OwnPadCase, pads
from manytouch.evaluation.suite.pads.pad_sensors import NOMINAL_STD, true_pad
from manytouch.evaluation.suite.pads.recording import pad_states
from manytouch.evaluation.suite.sensors import exact_sensor
from manytouch.geometry.refraction import rest_px
from manytouch.simulation.scene.deformation import Deformation
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Sensor, TrackedGrid, Truth
from manytouch.values.arrays import Points2

ESTIMATE = PadEstimator()
LONGER = PadEstimator(nominal_pad=NominalPad(element_thickness=0.5))
"""Its elements are half a thickness long instead of a third."""


def truth_of(case: OwnPadCase, state: int) -> Truth:
    """What is true in one of the three states of a press."""
    markers, _ = pad_states(case)[state]
    scene = SolidScene(name="press", time_s=np.array([0.0, 1.0]), states=(markers, markers), duration_s=1.0)
    return Simulator(sensor=true_pad(case), scene=scene).truth(0)


def grid_of(case: OwnPadCase, state: int, seed: int = 1) -> TrackedGrid:
    """The markers in one of the three states of a press."""
    return grid_at(truth_of(case, state).grid.position_px, noise_px=0.03, seed=seed)


def with_usual_deviations(sensor: Sensor) -> Sensor:
    """The sensor whose file states the deviations of a nominal one."""
    sheet = sensor.sheet
    assert sheet is not None
    return replace(
        sensor,
        sheet=replace(
            sheet,
            thickness_std_mm=NOMINAL_STD["thickness_mm"] * sheet.thickness_mm,
            poisson_std=NOMINAL_STD["poisson"],
            marker_depth_std_mm=NOMINAL_STD["marker_depth_mm"],
        ),
    )


def at_rest_px(sensor: Sensor) -> Points2:
    """(m, 2) images of the markers at rest."""
    assert sensor.layout is not None
    return rest_px(sensor, sensor.layout)


def true_mm2(case: OwnPadCase, state: int) -> float:
    """Normal force of a press over E."""
    (contact,) = pad_states(case)[state][1].contacts
    return contact.normal_force_N / case.young_MPa


@pytest.fixture(
    scope="module", params=[LONGER, pytest.param(ESTIMATE, marks=pytest.mark.slow)], ids=["longer", "usual"]
)
def thin(request: pytest.FixtureRequest) -> tuple[PadState, OwnPadCase]:
    """A pad of 2.5 mm that its file states 6 % thinner, and a ball of 16 mm that is pressed on it."""
    case = calibration_presses("thin")[1]
    return request.param.start(drawn_pad(calibration_presses("thin")[0])), case


def test_a_wide_press_that_is_sudden_has_the_force_of_a_slow_one(thin: tuple[PadState, OwnPadCase]) -> None:
    start, case = thin
    slow = start
    for state in range(3):
        slow, _, _ = ESTIMATE.step(slow, grid_of(case, state))
    _, _, contacts = ESTIMATE.step(slow, grid_of(case, 2))
    _, _, sudden = ESTIMATE.step(start, grid_of(case, 2))
    (one,), (other,) = contacts.touching, sudden.touching
    assert other.normal_force_over_E_mm2 == pytest.approx(one.normal_force_over_E_mm2, rel=0.02)
    assert one.normal_force_over_E_mm2 == pytest.approx(true_mm2(case, 2), rel=0.2)


def test_a_long_object_that_sticks_has_the_radial_shear_of_one() -> None:
    """Its shear is across the contact; if it were along it too, the markers would show none."""
    (case,) = (each for each in pads("pads") if each.name == "fingertip-dragged")
    start = LONGER.start(exact_sensor(true_pad(case)))
    for seed in range(3):
        after, _, contacts = LONGER.step(start, grid_of(case, 1, seed))
        (contact,) = contacts.touching
        assert after.patches.parameters[0, RADIAL_SHEAR] < -0.05
        assert contact.normal_force_over_E_mm2 == pytest.approx(true_mm2(case, 1), rel=0.11)


def test_a_fit_leaves_a_guess_from_which_long_steps_lead_nowhere(thin: tuple[PadState, OwnPadCase]) -> None:
    start, case = thin
    moved_px = (grid_of(case, 2).position_px - start.model.rest_px).ravel()
    weight = np.full(len(moved_px), 0.03**-2)
    guess, _ = ESTIMATE.search(start.candidates, moved_px, weight)
    assert guess is not None
    patches = start.patches.with_more(guess[None], Profile.DOME)
    fit = ESTIMATE.fitter(start.model, patches, moved_px, weight, is_sheet_known=True, with_covariance=False)
    assert np.abs(fit.patches.parameters[0] - guess).max() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("poisson", 0.0),
        *(("poisson", change) for change in (-0.01, 0.01, 0.015)),
        *(("thickness_mm", change) for change in (-0.2, 0.2)),
        *(("marker_depth_mm", change) for change in (-0.15, -0.1, 0.1, 0.2)),
    ],
)
def test_a_ring_is_found_where_the_numbers_of_the_pad_are_not_exact(name: str, change: float) -> None:
    """Radial shear and the parameters of the pad nearly explain its images by a third of its size."""
    (case,) = (each for each in pads("pads") if each.name == "ring")
    sensor = with_usual_deviations(true_pad(case))
    sheet = sensor.sheet
    assert sheet is not None
    given = replace(sheet, **{name: getattr(sheet, name) + change})
    state = ESTIMATE.start(replace(sensor, sheet=given))
    for number in range(3):
        state, _, contacts = ESTIMATE.step(state, grid_of(case, number))
        (one,) = contacts.touching
        assert one.normal_force_over_E_mm2 == pytest.approx(true_mm2(case, number), rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thickness_mm", "poisson", "depth_mm"), [(2.398, 0.4845, 0.287), (2.433, 0.4759, 0.252)]
)
def test_a_wide_contact_is_not_a_narrow_one_between_the_markers(
    thickness_mm: float, poisson: float, depth_mm: float
) -> None:
    """That is deeper under the same force, and takes it for one of a larger strain."""
    case = calibration_presses("thin")[0]
    true = true_pad(case)
    assert true.sheet is not None
    given = {"thickness_mm": thickness_mm, "poisson": poisson, "marker_depth_mm": depth_mm}
    start = ESTIMATE.start(with_usual_deviations(replace(true, sheet=replace(true.sheet, **given))))
    moved_px = truth_of(case, 2).grid.position_px - at_rest_px(true)
    _, _, contacts = ESTIMATE.step(start, grid_at(start.model.rest_px + moved_px, noise_px=0.03, seed=1))
    (one,) = contacts.touching
    assert one.normal_force_over_E_mm2 == pytest.approx(true_mm2(case, 2), rel=0.2)


@pytest.mark.slow
def test_a_sudden_ring_is_one_contact() -> None:
    """Small contacts around one that is too small explain some of what that leaves, a ring nearly all."""
    (case,) = (each for each in pads("pads") if each.name == "ring")
    start = ESTIMATE.start(with_usual_deviations(true_pad(case)))
    for number in range(3):
        for seed in range(8):
            _, _, contacts = ESTIMATE.step(start, grid_of(case, number, seed))
            (one,) = contacts.touching
            assert one.normal_force_over_E_mm2 == pytest.approx(true_mm2(case, number), rel=0.3)


@pytest.mark.slow
def test_a_sudden_ring_does_not_pull() -> None:
    """Wider guesses from a contact that is too small ended as ones that pull, and were refused."""
    (case,) = (each for each in pads("pads") if each.name == "ring")
    start = ESTIMATE.start(with_usual_deviations(true_pad(case)))
    for seed in (11, 31):
        _, _, contacts = ESTIMATE.step(start, grid_of(case, 2, seed))
        (one,) = contacts.touching
        assert one.normal_force_over_E_mm2 == pytest.approx(true_mm2(case, 2), rel=0.3)


def _seen_px(sensor: Sensor, markers: Deformation) -> np.ndarray:
    """(m, 2) images of the markers."""
    scene = SolidScene(name="press", time_s=np.array([0.0, 1.0]), states=(markers, markers), duration_s=1.0)
    return Simulator(sensor=sensor, scene=scene).truth(0).grid.position_px


@pytest.mark.parametrize(
    ("estimate", "frames"),
    [(LONGER, 6), pytest.param(ESTIMATE, 12, marks=pytest.mark.slow)],
    ids=["longer", "usual"],
)
def test_a_punch_that_sticks_is_not_taken_for_a_weak_ring(estimate: PadEstimator, frames: int) -> None:
    """A ring under shear that points outwards has nearly the same images, with half the force."""
    (case,) = (each for each in pads("pads") if each.name == "flat-punch-3-mm-sticking")
    sensor = exact_sensor(true_pad(case, width_px=320, centre_noise_px=0.02))
    markers, _ = pad_states(case)[0]
    position_px = _seen_px(sensor, markers)
    started = estimate.start(sensor)
    for seed in range(frames):
        _, _, contacts = estimate.step(started, grid_at(position_px, noise_px=0.02, seed=seed))
        (found,) = contacts.touching
        assert found.force_N[2] == pytest.approx(markers.contacts[0].force_N[2], rel=0.25)


@pytest.mark.parametrize("number", range(3))
def test_a_punch_that_sticks_is_as_deep_as_it_is(number: int) -> None:
    """Markers hardly show whether the middle of a contact is loaded, and a rim has another depth."""
    (case,) = (each for each in pads("pads") if each.name == "flat-punch-3-mm-sticking")
    sensor = exact_sensor(true_pad(case, width_px=320, centre_noise_px=0.02))
    markers, _ = pad_states(case)[number]
    position_px = _seen_px(sensor, markers)
    start = ESTIMATE.start(sensor)
    for seed in range(3):
        after, _, contacts = ESTIMATE.step(start, grid_at(position_px, noise_px=0.02, seed=seed))
        (found,) = contacts.touching
        assert list(after.patches.profile) == [Profile.FLAT]
        assert found.depth_mm == pytest.approx(markers.contacts[0].depth_mm, rel=0.2)


@pytest.mark.parametrize("name", ["ball-4-mm-dragged", "fingertip-dragged"])
def test_the_centre_of_an_object_that_drags_the_face_shows_where_it_is(name: str) -> None:
    (case,) = (each for each in pads("pads") if each.name == name)
    state = LONGER.start(exact_sensor(true_pad(case)))
    for number in range(3):
        state, _, contacts = LONGER.step(state, grid_of(case, number))
    (found,), (true,) = contacts.touching, truth_of(case, 2).contacts.touching
    away_px = np.linalg.norm(found.centre_px - true.centre_px)
    assert away_px < 0.15 * state.model.pitch_px / state.model.pitch_mm
