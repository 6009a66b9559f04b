"""When an assumed sheet is taken to describe a frame."""

from dataclasses import replace

import numpy as np
import pytest

from bent_sheets import PITCH_MM, bent
from layouts import grid_at, lattice_layout
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.undescribed_frames import UndescribedFrames
from manytouch.geometry.camera import project
from manytouch.values import Sensor, Sheet, Status, TrackedGrid
from straight import straight_camera

ESTIMATE, RULES, NOISE_PX = MechanicsEstimator(), UndescribedFrames(), 0.002
PITCH_PX = 1500.0 * PITCH_MM / 100.0


def sensor_of(sheet: Sheet | None) -> Sensor:
    return Sensor(
        name="test",
        camera=straight_camera(1600, 1200, focal_px=1500.0, distance_mm=100.0),
        layout=lattice_layout(11, 15, PITCH_MM),
        sheet=sheet,
    )


@pytest.fixture(scope="module")
def pressed() -> tuple[np.ndarray, np.ndarray]:
    """Images (m, 2) of the markers at rest, and their motion under a press on the assumed sheet."""
    model = ESTIMATE.start(sensor_of(None)).model
    shape = bent(model, (4.0, 3.0, 3.0))
    return project(model.camera, model.layout.rest_mm), model.dots.displacement_px(shape)


def grid_of(rest_px: np.ndarray, moved_px: np.ndarray, seed: int = 0) -> TrackedGrid:
    return grid_at(rest_px + moved_px, std_px=NOISE_PX, noise_px=NOISE_PX, seed=seed)


def with_misfit(rest_px: np.ndarray, moved_px: np.ndarray, share: float) -> tuple[Fit, TrackedGrid]:
    """A fit whose residuals are this share of the motion of the markers in the RMS, and the frame."""
    grid = grid_of(rest_px, moved_px)
    fit = ESTIMATE.fit_frame(ESTIMATE.start(sensor_of(None)), grid)
    left_px = np.random.default_rng(2).normal(size=moved_px.shape)
    left_px *= share * np.linalg.norm(fit.shape.displacement_px) / np.linalg.norm(left_px)
    return replace(fit, residual_px=left_px), grid


@pytest.mark.parametrize(
    ("share", "soon", "late"), [(0.01, True, True), (0.06, True, False), (0.3, False, False)]
)
def test_what_was_long_not_a_sheet_must_look_clearly_like_one(
    pressed: tuple[np.ndarray, np.ndarray], share: float, soon: bool, late: bool
) -> None:
    model = ESTIMATE.start(sensor_of(None)).model
    fit, grid = with_misfit(*pressed, share)
    assert RULES.shows(model, fit, grid, unlike=RULES.unlike_frames - 1) == soon
    assert RULES.shows(model, fit, grid, unlike=RULES.unlike_frames) == late
    known = replace(model, is_assumed=False)
    assert RULES.shows(known, fit, grid, unlike=100)


@pytest.mark.parametrize(("share", "is_doubtful"), [(0.02, False), (0.06, True)])
def test_a_contact_does_not_vanish_where_the_markers_show_it(
    pressed: tuple[np.ndarray, np.ndarray], share: float, is_doubtful: bool
) -> None:
    state = ESTIMATE.start(sensor_of(None))
    fit, grid = with_misfit(*pressed, share)
    for _ in range(3):
        state, _, contacts = ESTIMATE.step(state, grid)
    seen = replace(state.without_sheet, touching=tuple(contacts.touching))
    unseen = replace(state.without_sheet, touching=())
    assert RULES.is_doubtful(fit, seen, grid, state.reference_px, PITCH_PX) == is_doubtful
    assert not RULES.is_doubtful(fit, unseen, grid, state.reference_px, PITCH_PX)


def test_only_pressed_frames_count_against_a_sheet(pressed: tuple[np.ndarray, np.ndarray]) -> None:
    """Markers that move at random, each by itself, are no sheet; at rest nothing is learnt."""
    rest_px, moved_px = pressed
    state = ESTIMATE.start(sensor_of(None))
    torn_px = np.random.default_rng(3).normal(0.0, 0.2 * PITCH_PX, moved_px.shape)
    for number in range(3):
        state, _, _ = ESTIMATE.step(state, grid_of(rest_px, torn_px, seed=number))
    assert state.unlike == 3
    for number in range(3):
        state, _, _ = ESTIMATE.step(state, grid_of(rest_px, np.zeros_like(rest_px), seed=number))
    assert (state.unlike, state.undescribed) == (3, 6)
    for number in range(3):
        state, surface, _ = ESTIMATE.step(state, grid_of(rest_px, moved_px, seed=number))
    assert surface.status is Status.OK
    assert (state.unlike, state.undescribed) == (0, 0)


@pytest.mark.parametrize(
    ("rows", "columns", "is_known", "is_described"),
    [(6, 9, False, False), (7, 7, False, False), (7, 8, False, True), (6, 9, True, True)],
)
def test_few_markers_show_a_sheet_only_if_it_is_known(
    rows: int, columns: int, is_known: bool, is_described: bool
) -> None:
    size_mm = np.array([columns + 1, rows + 1]) * PITCH_MM
    known = Sensor(
        name="test",
        camera=straight_camera(1600, 1200, focal_px=1500.0, distance_mm=100.0),
        layout=lattice_layout(rows, columns, PITCH_MM),
        sheet=Sheet(size_mm=size_mm, thickness_mm=3.0, poisson=0.45, young_MPa=1.0, pretension_N_per_mm=0.0),
    )
    model = ESTIMATE.start(known).model
    pressed = bent(model, (3.0, 2.0, 0.5))
    state = ESTIMATE.start(known if is_known else replace(known, sheet=None))
    for number, shape in enumerate([np.zeros_like(pressed), *3 * [pressed]]):
        at_px = project(model.camera, model.layout.rest_mm) + model.dots.displacement_px(shape)
        grid = grid_at(at_px, std_px=0.02, noise_px=0.02, seed=number)
        state, surface, contacts = ESTIMATE.step(state, grid)
    assert (surface.spline is not None) == is_described
    assert len(contacts.touching) == 1
