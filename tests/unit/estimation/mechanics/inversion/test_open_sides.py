"""Sides at which a sheet goes on beyond the view."""

from dataclasses import replace

import numpy as np
import pytest

from bent_sheets import PITCH_MM, bent
from layouts import grid_at, lattice_layout
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.open_sides import OpenSides
from manytouch.estimation.mechanics.inversion.searched_press import SearchedPress, SheetTrials
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.camera import project
from manytouch.values import Sensor, Sheet, TrackedGrid
from manytouch.values.sensor_file.assumed_sheet import are_open, assumed_sheet
from straight import straight_camera

ESTIMATE = MechanicsEstimator()
ROWS, COLUMNS, SHOWN = 13, 25, 15
"""Of the whole sheet, and columns that the view shows."""
OFF_MM = 0.5 * (COLUMNS - SHOWN) * PITCH_MM
"""From the middle of the sheet to that of the columns at its left that are shown, towards negative x."""


def whole_sheet() -> Sensor:
    """All of the sheet, which ends a pitch beyond its outermost markers."""
    size_mm = np.array([COLUMNS + 1, ROWS + 1]) * PITCH_MM
    return Sensor(
        name="test",
        camera=straight_camera(1600, 1200, focal_px=1500.0, distance_mm=100.0),
        layout=lattice_layout(ROWS, COLUMNS, PITCH_MM),
        sheet=Sheet(size_mm=size_mm, thickness_mm=3.0, poisson=0.45, young_MPa=1.0, pretension_N_per_mm=0.0),
    )


def left_part() -> Sensor:
    """The columns at the left alone, whose middle is the origin; nothing is known of the sheet."""
    whole = whole_sheet()
    moved_mm = whole.camera.translation_mm - np.array([OFF_MM, 0.0, 0.0])
    camera = replace(whole.camera, translation_mm=moved_mm)
    return replace(whole, camera=camera, layout=lattice_layout(ROWS, SHOWN, PITCH_MM), sheet=None)


def grids_of(
    place_mm: tuple[float, float], over_E_mm2: float, *, part: bool
) -> tuple[list[TrackedGrid], float]:
    """A frame at rest and 24 with a press, of the left part or of all of the sheet, and the largest depth."""
    true = ESTIMATE.start(whole_sheet()).model
    assert isinstance(true, InversionModel)
    pressed = bent(true, (*place_mm, over_E_mm2))
    is_shown = np.tile(np.arange(COLUMNS) < (SHOWN if part else COLUMNS), ROWS)
    rest_px = project(true.camera, true.layout.rest_mm)
    grids = [
        grid_at((rest_px + true.dots.displacement_px(shape))[is_shown], std_px=0.02, noise_px=0.02, seed=seed)
        for seed, shape in enumerate([np.zeros_like(pressed)] + 24 * [pressed])
    ]
    return grids, float(-true.dots.displacement_mm(pressed)[:, 2].min())


@pytest.mark.parametrize(("x_mm", "over_E_mm2"), [(0.0, 0.08), (0.0, 1.0), (-20.0, 1.0)])
def test_a_press_near_the_cut_shows_that_the_sheet_goes_on(x_mm: float, over_E_mm2: float) -> None:
    sensor, place_mm = left_part(), (x_mm, 3.0)
    grids, depth_mm = grids_of(place_mm, over_E_mm2, part=True)
    state = ESTIMATE.start(sensor)
    for grid in grids:
        state, surface, contacts = ESTIMATE.step(state, grid)
    spline = surface.spline
    assert spline is not None
    is_open = are_open(sensor.layout, spline.size_mm, spline.centre_mm)
    np.testing.assert_array_equal(is_open, [[False, True], [False, False]])
    assert spline.size_mm[0] / 2 + spline.centre_mm[0] > 11.0 * PITCH_MM
    (contact,) = contacts.touching
    off_mm = contact.centre_mm - [place_mm[0] + OFF_MM, place_mm[1]]
    assert np.linalg.norm(off_mm) < 0.3 * PITCH_MM
    assert abs(contact.depth_mm - depth_mm) < 2.0 * contact.std("depth") < 0.5 * depth_mm


def test_without_the_search_the_clamp_has_contacts_that_do_not_exist() -> None:
    """So the tests above and below are about it."""
    estimate = replace(ESTIMATE, open_sides=OpenSides(least_gain=np.inf))
    state = estimate.start(left_part())
    for grid in grids_of((-20.0, 3.0), 1.0, part=True)[0]:
        state, _, contacts = estimate.step(state, grid)
    assert len(contacts.touching) > 1


def test_a_press_beyond_the_view_is_no_contact() -> None:
    state = ESTIMATE.start(left_part())
    numbers = []
    for place_mm in ((0.0, 3.0), (18.0, 2.0)):
        for grid in grids_of(place_mm, 1.0, part=True)[0]:
            state, _, contacts = ESTIMATE.step(state, grid)
        numbers.append(len(contacts.touching))
    assert numbers == [1, 0]


@pytest.mark.parametrize("place_mm", [(44.0, 3.0), (-46.0, -18.0), (2.0, 20.0)])
def test_presses_near_the_clamp_of_a_whole_sheet_open_no_side(place_mm: tuple[float, float]) -> None:
    sensor = replace(whole_sheet(), sheet=None)
    state = ESTIMATE.start(sensor)
    for grid in grids_of(place_mm, 0.6, part=False)[0]:
        state, surface, contacts = ESTIMATE.step(state, grid)
    assert surface.spline is not None
    assert state.open_sides.tried_pitch.max() > 0.0
    assert not are_open(sensor.layout, surface.spline.size_mm, surface.spline.centre_mm).any()
    assert len(contacts.touching) == 1


def test_sides_that_move_little_or_as_much_as_before_are_not_tried() -> None:
    rules, layout = OpenSides(), lattice_layout(ROWS, COLUMNS, PITCH_MM)
    sheet, before = assumed_sheet(layout), OpenSides().start()
    moved = np.array([[0.1, 0.3], [0.0, 0.24]])
    assert rules.tried_sides(before, sheet, layout, moved, 1.0) == ((0, 1),)
    assert rules.tried_sides(before, sheet, layout, moved, 0.9) == ((0, 1), (1, 1))
    tried = replace(before, tried_pitch=np.array([[0.0, 0.2], [0.0, 0.0]]))
    assert rules.tried_sides(tried, sheet, layout, moved, 1.0) == ()
    assert rules.tried_sides(tried, sheet, layout, 2.0 * moved, 2.0) == ((0, 1),)
    margin = np.array([[1.0, 5.0], [1.0, 1.0]])
    assert rules.tried_sides(before, assumed_sheet(layout, margin), layout, moved, 1.0) == ()


def test_motion_of_the_outermost_markers() -> None:
    layout = lattice_layout(3, 4, PITCH_MM)
    moved_px = np.zeros((12, 2))
    moved_px[[0, 4, 8], 1] = 3.0
    is_seen = np.ones(12, dtype=np.bool_)
    moved = OpenSides().moved_pitch(layout, moved_px, is_seen, 10.0)
    np.testing.assert_allclose(moved, [[0.3, 0.0], [0.15, 0.15]])
    is_seen[4] = False
    assert OpenSides().moved_pitch(layout, moved_px, is_seen, 10.0)[0, 0] == 0.0


@pytest.mark.parametrize("shift_px", [0.1, 0.4])
def test_a_camera_that_moves_opens_no_side(shift_px: float) -> None:
    sensor = replace(whole_sheet(), sheet=None)
    state = ESTIMATE.start(sensor)
    grids, _ = grids_of((4.0, 3.0), 0.1, part=False)
    for number, grid in enumerate(grids):
        moved_px = grid.position_px + (shift_px * np.array([1.0, 0.6]) if number else 0.0)
        state, surface, _ = ESTIMATE.step(state, replace(grid, position_px=moved_px))
    assert surface.spline is not None
    assert state.open_sides.tried_pitch.max() > 0.0
    assert not are_open(sensor.layout, surface.spline.size_mm, surface.spline.centre_mm).any()


def test_a_press_that_no_sheet_describes_opens_no_side() -> None:
    rules, sensor = OpenSides(), replace(left_part(), sheet=assumed_sheet(left_part().layout))
    grids, _ = grids_of((0.0, 3.0), 1.0, part=True)
    press = SearchedPress(
        measured_px=grids[1].position_px - grids[0].position_px,
        information=np.tile(np.eye(2) / 0.02**2, (len(grids[0].position_px), 1, 1)),
        noise=1.0,
        usual_std_px=0.02,
        moved_pitch=0.05,
        view_px=np.zeros_like(grids[0].position_px),
    )
    model = ESTIMATE.start(sensor).model
    trial_of = SheetTrials(ESTIMATE.gauss_newton, ESTIMATE.nominal_sheet, model)
    estimate = rules.with_press(rules.start(), sensor, press, ((0, 1),), np.full((2, 2), 0.1))
    for _ in range(4):
        estimate = rules.with_trials(estimate, trial_of)
    searched = estimate.searched
    assert searched is not None
    assert searched.is_done
    assert searched.has_opened
    assert rules.opened_sheet(searched) is not None
    assert rules.opened_sheet(replace(searched, misfit=0.08)) is None


def test_a_contact_near_an_open_side_is_uncertain() -> None:
    sensor, place_mm = left_part(), (4.0, 3.0)
    state, (grids, _) = ESTIMATE.start(sensor), grids_of(place_mm, 0.08, part=True)
    assert state.model.open_nearness(np.array([28.0, 0.0])) == 0.0
    for grid in grids:
        state, _, contacts = ESTIMATE.step(state, grid)
    (contact,) = contacts.touching
    off_mm = contact.centre_mm - [place_mm[0] + OFF_MM, place_mm[1]]
    std_mm = np.sqrt(np.diag(contact.covariance)[:2])
    assert np.all(np.abs(off_mm) < 1.5 * std_mm)
    assert np.all(std_mm > 0.9 * PITCH_MM)
    nearness = [state.model.open_nearness(np.array([x_mm, 5.0])) for x_mm in (40.0, 24.0, 22.0, -28.0)]
    np.testing.assert_allclose(nearness, [1.0, 1.0, np.exp(-1.0), np.exp(-26.0)])
