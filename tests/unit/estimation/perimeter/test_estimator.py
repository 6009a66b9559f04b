"""The method `perimeter` as a whole, on known displacements."""

from dataclasses import replace

import numpy as np
import pytest

from layouts import grid_at
from manytouch.errors import LayoutError, SensorError
from manytouch.estimation import ContactTracker, LoadContactFinder, PerimeterEstimator
from manytouch.estimation.uncalibrated.swelling_load import uncalibrated_contact_finder
from manytouch.geometry.camera import project
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Contacts, Sensor, Surface, TrackedGrid
from manytouch.values.arrays import read_only

SENSOR = demo_sensor(1280)
assert SENSOR.layout is not None
REST_MM = SENSOR.layout.rest_mm
COUNT = len(REST_MM)
TRACKER = ContactTracker(confirm_frames=1)
ESTIMATE = PerimeterEstimator(
    contact_finder=LoadContactFinder(tracker=TRACKER),
    uncalibrated_contact_finder=replace(uncalibrated_contact_finder(), tracker=TRACKER),
)
NOISE_PX = 0.03
LEVER_MM = 1.5


def grid_of(
    moved_mm: np.ndarray, *, shift_px: tuple[float, float] = (0.0, 0.0), seed: int | None = None
) -> TrackedGrid:
    """The grid of markers moved by (m, 3) mm, shifted as a whole in the image, with noise."""
    position_px = project(SENSOR.camera, REST_MM + moved_mm) + shift_px
    return grid_at(position_px, std_px=NOISE_PX, noise_px=0.0 if seed is None else NOISE_PX, seed=seed or 0)


def pressed(*presses: tuple[float, float, float, float]) -> np.ndarray:
    """Displacements (m, 3) of a bent sheet under (x, y, depth, radius) mm, seen from its face."""
    moved = np.zeros((COUNT, 3))
    for x, y, depth, radius in presses:
        offset = REST_MM[:, :2] - [x, y]
        hollow = depth * np.exp(-(offset**2).sum(axis=1) / (2 * radius**2))
        moved[:, 2] -= hollow
        moved[:, :2] += LEVER_MM * hollow[:, None] * offset / radius**2
    return moved


def estimate(*grids: TrackedGrid, sensor: Sensor = SENSOR) -> tuple[Surface, Contacts]:
    state = ESTIMATE.start(sensor)
    for grid in grids:
        state, surface, contacts = ESTIMATE.step(state, grid)
    return surface, contacts


@pytest.mark.parametrize("z", [-4.0, 2.0])
def test_the_depth_of_a_sheet_that_comes_nearer_as_a_whole_is_exact(z: float):
    surface, contacts = estimate(grid_of(np.array([[0.0, 0.0, z]]) * np.ones((COUNT, 1))))
    np.testing.assert_allclose(surface.displacement_mm[:, 2], z, atol=1e-6)
    # What grows from one point looks like growth from another one and a shift.
    np.testing.assert_allclose(surface.displacement_mm[:, :2], 0.0, atol=0.1)
    np.testing.assert_allclose(surface.position_mm, REST_MM + surface.displacement_mm)
    assert contacts.contacts == ()


@pytest.mark.parametrize("shift_px", [(0.0, 0.0), (9.0, -6.0), (-20.0, 14.0)])
def test_a_sheet_at_rest_has_no_contacts_also_when_the_view_moved(shift_px: tuple[float, float]):
    state = ESTIMATE.start(SENSOR)
    for frame in range(25):
        state, _, contacts = ESTIMATE.step(
            state, grid_of(np.zeros((COUNT, 3)), shift_px=shift_px, seed=frame)
        )
        assert contacts.contacts == ()


def test_a_rotated_view_has_no_contacts():
    angle = np.deg2rad(1.5)
    turn = np.array([[np.cos(angle) - 1, -np.sin(angle)], [np.sin(angle), np.cos(angle) - 1]])
    moved = np.column_stack([REST_MM[:, :2] @ turn.T, np.zeros(COUNT)])
    surface, contacts = estimate(grid_of(moved, seed=1))
    assert contacts.contacts == ()
    assert np.abs(surface.displacement_mm[:, :2]).max() < 0.05


PLACES = [(-44.0, -22.0), (-18.0, 16.0), (2.0, -16.0), (22.0, 14.0), (44.0, -12.0), (-42.0, 18.0)]


@pytest.mark.parametrize("fingers", range(1, 7))
def test_as_many_contacts_as_fingers_where_they_press(fingers: int):
    presses = [(x, y, 2.5, 6.0) for x, y in PLACES[:fingers]]
    _, contacts = estimate(grid_of(pressed(*presses), seed=fingers, shift_px=(3.0, -2.0)))
    assert len(contacts.touching) == fingers
    for each in contacts.touching:
        nearest = np.linalg.norm(np.array(PLACES[:fingers]) - each.centre_mm, axis=1).min()
        assert nearest < 1.0
        assert nearest < 4.0 * np.hypot(each.std("x"), each.std("y"))
        assert np.isnan(each.force_N).all()
        assert each.depth_mm > 0.0
        assert each.std("depth") > 0.0


@pytest.mark.parametrize("radius", [4.0, 8.0, 12.0])
def test_a_wide_finger_is_one_contact(radius: float):
    _, contacts = estimate(grid_of(pressed((6.0, -4.0, 4.0, radius)), seed=2))
    assert len(contacts.touching) == 1
    assert np.linalg.norm(contacts.touching[0].centre_mm - [6.0, -4.0]) < 2.0


def test_the_image_position_of_a_contact_is_that_in_the_present_image():
    shift_px = (7.0, -4.0)
    _, contacts = estimate(grid_of(pressed((10.0, 5.0, 3.0, 6.0)), shift_px=shift_px))
    (each,) = contacts.touching
    expected = project(SENSOR.camera, np.array([[*each.centre_mm, -3.0]]))[0] + shift_px
    assert np.linalg.norm(each.centre_px - expected) < 3.0


def test_a_sheet_that_creeps_back_has_no_contacts_after_a_release():
    """A tenth of a deep press remains for a while."""
    state = ESTIMATE.start(SENSOR)
    deep, crept = pressed((0.0, 0.0, 5.0, 7.0)), pressed((0.0, 0.0, 0.5, 7.0))
    for frame in range(5):
        state, _, contacts = ESTIMATE.step(state, grid_of(deep, seed=frame))
    assert len(contacts.touching) == 1
    for frame in range(8):
        state, _, contacts = ESTIMATE.step(state, grid_of(crept, seed=frame))
    assert contacts.touching == ()


def test_hidden_markers_are_interpolated_with_larger_deviation():
    moved = pressed((0.0, 0.0, 3.0, 8.0))
    grid = grid_of(moved)
    is_seen = np.random.default_rng(4).random(COUNT) > 0.15
    holes = TrackedGrid(
        position_px=read_only(np.where(is_seen[:, None], grid.position_px, np.nan)),
        covariance_px2=read_only(np.where(is_seen[:, None, None], grid.covariance_px2, np.nan)),
        is_seen=read_only(is_seen),
        frames_unseen=read_only(np.where(is_seen, 0, 1)),
    )
    surface, contacts = estimate(holes)
    assert np.isfinite(surface.displacement_mm).all()
    whole, _ = estimate(grid)
    std = np.sqrt(surface.covariance_mm2[:, 0, 0])
    assert np.median(std[~is_seen]) > 3.0 * np.median(np.sqrt(whole.covariance_mm2[:, 0, 0]))
    assert len(contacts.touching) == 1
    assert np.linalg.norm(contacts.touching[0].centre_mm) < 1.0


def test_at_rest_the_depth_has_the_predicted_variance():
    state = ESTIMATE.start(SENSOR)
    squares = []
    for frame in range(60):
        state, surface, _ = ESTIMATE.step(state, grid_of(np.zeros((COUNT, 3)), seed=100 + frame))
        squares.append(surface.displacement_mm[:, 2] ** 2 / surface.covariance_mm2[:, 2, 2])
    assert 0.7 < np.mean(squares) < 1.1


def test_under_presses_most_depths_lie_within_two_deviations():
    moved = pressed((-20.0, 5.0, 3.0, 7.0), (25.0, -10.0, 2.0, 6.0))
    surface, _ = estimate(grid_of(moved, seed=3))
    off = np.abs(surface.displacement_mm[:, 2] - moved[:, 2]) / np.sqrt(surface.covariance_mm2[:, 2, 2])
    assert np.mean(off < 2.0) > 0.8


def test_an_assumed_scale_increases_the_deviations_of_depth_and_centre():
    assumed = replace(SENSOR, assumptions=("The camera's horizontal field of view is 60 degrees.",))
    moved = pressed((0.0, 0.0, 3.0, 8.0))
    known, sure = estimate(grid_of(moved))
    wider, unsure = estimate(grid_of(moved), sensor=assumed)
    assert unsure.touching[0].std("x") > 1.5 * sure.touching[0].std("x")
    deepest = np.argmin(moved[:, 2])
    assert wider.covariance_mm2[deepest, 2, 2] > known.covariance_mm2[deepest, 2, 2]


@pytest.mark.parametrize("fingers", range(1, 6))
def test_with_an_assumed_view_contacts_are_within_their_deviations(fingers: int):
    assumed = replace(SENSOR, assumptions=("The camera's horizontal field of view is 60 degrees.",))
    places = np.array(PLACES[:fingers])
    moved = pressed(*((x, y, 3.0, 6.0) for x, y in places))
    _, contacts = estimate(grid_of(moved, seed=fingers), grid_of(moved, seed=20 + fingers), sensor=assumed)
    assert len(contacts.touching) == fingers
    for each in contacts.touching:
        off_mm = places - each.centre_mm
        off_mm = off_mm[np.linalg.norm(off_mm, axis=1).argmin()]
        assert (np.abs(off_mm) < [2.0 * each.std("x"), 2.0 * each.std("y")]).all()


def test_the_deviation_of_the_law_is_limited_to_what_its_map_shows():
    surface, _ = estimate(grid_of(pressed((0.0, 0.0, 3.0, 8.0))))
    std_mm = np.sqrt(surface.covariance_mm2[:, 2, 2])
    assert std_mm.max() < 1.5 * np.abs(surface.displacement_mm[:, 2]).max()


def test_a_frame_without_markers_has_a_status():
    nothing = TrackedGrid(
        position_px=read_only(np.full((COUNT, 2), np.nan)),
        covariance_px2=read_only(np.full((COUNT, 2, 2), np.nan)),
        is_seen=read_only(np.zeros(COUNT, dtype=np.bool_)),
        frames_unseen=read_only(np.ones(COUNT, dtype=np.int64)),
    )
    finger = grid_of(pressed((0.0, 0.0, 3.0, 8.0)))
    surface, contacts = estimate(finger, finger, nothing)
    assert surface.status == contacts.status == "few_markers"
    assert np.isnan(surface.displacement_mm).all()
    assert len(contacts.touching) == 1


def test_a_sensor_without_enough_markers_raises():
    with pytest.raises(SensorError, match="no \\[markers\\]"):
        ESTIMATE.start(replace(SENSOR, layout=None))
    assert SENSOR.layout is not None
    few = replace(
        SENSOR.layout,
        rest_mm=REST_MM[:3],
        row_column=None,
        radius_mm=SENSOR.layout.radius_mm[:3],
        is_missing=SENSOR.layout.is_missing[:3],
    )
    with pytest.raises(LayoutError, match="has 3 markers"):
        ESTIMATE.start(replace(SENSOR, layout=few))


def test_the_depth_of_a_contact_whose_region_lies_above_its_rest_is_unknown():
    raised_mm = np.array([[0.0, 0.0, 8.0]])
    for lift_mm, is_known in ((0.0 * raised_mm, True), (raised_mm, False)):
        _, contacts = estimate(grid_of(pressed((5.0, 3.0, 1.5, 8.0)) + lift_mm))
        (contact,) = contacts.touching
        assert np.isfinite(contact.depth_mm) == np.isfinite(contact.std("depth")) == is_known
        assert np.hypot(*(contact.centre_mm - (5.0, 3.0))) < 2.0
