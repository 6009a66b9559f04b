"""What presses and holds an assumed sheet beyond its markers."""

from dataclasses import replace

import numpy as np
import pytest

from bent_sheets import PITCH_MM, bent
from layouts import grid_at, lattice_layout
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.beyond_markers import BeyondMarkers
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel, NominalSheet
from manytouch.geometry.camera import project
from manytouch.values import Sensor, Sheet, TrackedGrid
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
def test_a_press_near_the_cut(x_mm: float, over_E_mm2: float) -> None:
    state, place_mm = ESTIMATE.start(left_part()), (x_mm, 3.0)
    grids, depth_mm = grids_of(place_mm, over_E_mm2, part=True)
    for grid in grids:
        state, _, contacts = ESTIMATE.step(state, grid)
    (contact,) = contacts.touching
    off_mm = contact.centre_mm - [place_mm[0] + OFF_MM, place_mm[1]]
    assert np.linalg.norm(off_mm) < 0.3 * PITCH_MM
    assert abs(contact.depth_mm - depth_mm) < 2.0 * contact.std("depth") < 0.8 * depth_mm


def test_a_clamp_next_to_the_markers_has_contacts_that_do_not_exist() -> None:
    """So the tests above and below are about the forces beyond the markers."""
    estimate = replace(ESTIMATE, nominal_sheet=NominalSheet(margin_pitch=1.0, beyond_pitch=2.0))
    state = estimate.start(left_part())
    assert not state.model.nodes.is_beyond.any()
    for grid in grids_of((-20.0, 3.0), 1.0, part=True)[0]:
        state, _, contacts = estimate.step(state, grid)
    assert len(contacts.touching) > 1


@pytest.mark.parametrize("place_mm", [(18.0, 2.0), (26.0, -8.0), (40.0, 6.0)])
def test_a_press_beyond_the_view_is_no_contact(place_mm: tuple[float, float]) -> None:
    state = ESTIMATE.start(left_part())
    for grid in grids_of(place_mm, 1.0, part=True)[0]:
        state, _, contacts = ESTIMATE.step(state, grid)
    assert not contacts.touching


@pytest.mark.parametrize("place_mm", [(44.0, 3.0), (-46.0, -18.0), (2.0, 20.0)])
def test_a_press_near_the_clamp_of_a_whole_sheet(place_mm: tuple[float, float]) -> None:
    state = ESTIMATE.start(replace(whole_sheet(), sheet=None))
    for grid in grids_of(place_mm, 0.6, part=False)[0]:
        state, _, contacts = ESTIMATE.step(state, grid)
    (contact,) = contacts.touching
    assert np.linalg.norm(contact.centre_mm - place_mm) < 0.5 * PITCH_MM


@pytest.mark.parametrize("shift_px", [0.1, 0.4, 1.5])
def test_a_camera_that_moves(shift_px: float) -> None:
    state = ESTIMATE.start(replace(whole_sheet(), sheet=None))
    grids, _ = grids_of((4.0, 3.0), 0.1, part=False)
    for number, grid in enumerate(grids):
        moved_px = grid.position_px + (shift_px * np.array([1.0, 0.6]) if number else 0.0)
        state, _, contacts = ESTIMATE.step(state, replace(grid, position_px=moved_px))
    (contact,) = contacts.touching
    assert np.linalg.norm(contact.centre_mm - [4.0, 3.0]) < 0.2 * PITCH_MM


def test_a_contact_near_the_outermost_markers_is_uncertain() -> None:
    state, place_mm = ESTIMATE.start(left_part()), (4.0, 3.0)
    for grid in grids_of(place_mm, 0.08, part=True)[0]:
        state, _, contacts = ESTIMATE.step(state, grid)
    (contact,) = contacts.touching
    off_mm = contact.centre_mm - [place_mm[0] + OFF_MM, place_mm[1]]
    std_mm = np.sqrt(np.diag(contact.covariance)[:2])
    assert np.all(np.abs(off_mm) < 1.5 * std_mm)
    assert np.all(std_mm > 0.9 * PITCH_MM)
    nearness = [state.model.edge_nearness(np.array([x_mm, 5.0])) for x_mm in (40.0, 24.0, 22.0, -20.0)]
    np.testing.assert_allclose(nearness, np.exp([0.0, 0.0, -1.0, -2.0]), rtol=1e-12)
    assert ESTIMATE.start(whole_sheet()).model.edge_nearness(np.array([48.0, 0.0])) == 0.0


def test_weights_are_inverse_means_of_the_squares_around() -> None:
    nodes, rules = ESTIMATE.start(left_part()).model.nodes, BeyondMarkers(least_std=0.01, reach=2)
    force_mm2 = np.random.default_rng(1).normal(size=(len(nodes.place_mm), 3))
    weight = rules.weights(nodes, force_mm2)
    place = np.array(list(np.ndindex(*nodes.shape)))
    for number, node in list(enumerate(np.flatnonzero(nodes.is_beyond)))[::37]:
        is_near = (np.abs(place - place[node]) <= 2).all(axis=1) & nodes.is_beyond
        mean_mm4 = np.square(force_mm2[is_near]).mean() + (0.01 * nodes.force_unit_mm2) ** 2
        np.testing.assert_allclose(weight[number], [1.0 / mean_mm4])
    known = ESTIMATE.start(whole_sheet()).model.nodes
    assert rules.weights(known, np.zeros((len(known.place_mm), 3))).size == 0
