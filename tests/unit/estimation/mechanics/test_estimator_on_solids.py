"""The inversion on a solved solid that ships with the package: other physics than its own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.design.dimensions import light_lattice
from manytouch.design.prototype import FINGERTIP, ObservedPress, Prototype
from manytouch.estimation import MechanicsEstimator
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.solutions import Solutions
from manytouch.evaluation.suite.suite import cases
from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.render.dot_ellipses import dot_ellipses, outlines
from manytouch.values import Contacts, Sensor, Sheet, Surface, TrackedGrid
from manytouch.values.arrays import read_only
from straight import straight_camera

(CASE,) = (case for case in cases(("nominal",), quick=True, tuning=True) if len(case.touches) == 2)
SENSOR = given_sensor(CASE)

AROUND_MM = np.stack(np.meshgrid(*[np.linspace(-2.0, 2.0, 17)] * 2), axis=-1).reshape(-1, 2)


@pytest.fixture(scope="module")
def solved(
    tmp_path_factory: pytest.TempPathFactory,
) -> list[tuple[np.ndarray, np.ndarray, list[np.ndarray], list[float]]]:
    """Of each state: marker images, true depths, and true centres and depths of the contacts."""
    states = Solutions(folder=Path(tmp_path_factory.mktemp("none"))).known(CASE)
    assert states is not None
    layout = SENSOR.layout
    assert layout is not None
    edge_mm = outlines(layout.rest_mm, layout.radius_mm)
    found = []
    for state in states:
        moved_mm = state.displacement_mm(np.ascontiguousarray(edge_mm.reshape(-1, 3)[:, :2]))
        centre_px, _ = dot_ellipses(SENSOR.camera, edge_mm + moved_mm.reshape(edge_mm.shape))
        depth_mm = -state.displacement_mm(np.ascontiguousarray(layout.rest_mm[:, :2]))[:, 2]
        touching = [c.centre_mm for c in state.contacts if c.is_touching]
        deepest = [-state.displacement_mm(centre + AROUND_MM)[:, 2].min() for centre in touching]
        found.append((centre_px, depth_mm, touching, deepest))
    rest_px, _ = dot_ellipses(SENSOR.camera, edge_mm)
    return [(rest_px, np.zeros(len(rest_px)), [], []), *found, found[-1]]


def grid_of(
    centre_px: np.ndarray, lost: np.ndarray, outliers: np.ndarray, seed: int, noise_px: float = 0.03
) -> TrackedGrid:
    chance = np.random.default_rng(seed)
    place_px = centre_px + chance.normal(0.0, noise_px, centre_px.shape)
    place_px[outliers] += 5.0
    return TrackedGrid(
        position_px=read_only(np.where(lost[:, None], np.nan, place_px)),
        covariance_px2=read_only(np.where(lost[:, None, None], np.nan, noise_px**2 * np.eye(2))),
        is_seen=read_only(~lost),
        frames_unseen=read_only(lost.astype(np.int64)),
    )


def last(solved, *, lost_share: float = 0.0, outlier_share: float = 0.0) -> tuple[Surface, Contacts]:
    chance = np.random.default_rng(3)
    count = len(solved[0][0])
    lost = chance.random(count) < lost_share
    estimate = MechanicsEstimator()
    state = estimate.start(SENSOR)
    for seed, (centre_px, *_) in enumerate(solved):
        outliers = chance.random(count) < outlier_share
        state, surface, contacts = estimate.step(state, grid_of(centre_px, lost, outliers, seed))
    return surface, contacts


def rmse_mm(surface: Surface, solved) -> float:
    return float(np.sqrt(np.mean((-surface.displacement_mm[:, 2] - solved[-1][1]) ** 2)))


@pytest.mark.parametrize(
    "trouble", [pytest.param({}, marks=pytest.mark.slow), {"lost_share": 0.2}, {"outlier_share": 0.01}]
)
def test_depth_and_contacts_of_a_solid(solved, trouble: dict[str, float]) -> None:
    surface, contacts = last(solved, **trouble)
    assert surface.status == "ok"
    assert rmse_mm(surface, solved) < (0.008 if trouble else 0.007)
    true_mm = np.array(solved[-1][2])
    found_mm = np.array([contact.centre_mm for contact in contacts.touching])
    away_mm = np.linalg.norm(true_mm[:, None] - found_mm, axis=2)
    assert found_mm.shape == true_mm.shape == (2, 2)
    assert away_mm.min(axis=1).max() < 1.0
    deepest_mm = np.array([contact.depth_mm for contact in contacts.touching])[away_mm.argmin(axis=1)]
    assert deepest_mm == pytest.approx(solved[-1][3], rel=0.025)
    z = (-surface.displacement_mm[:, 2] - solved[-1][1]) / np.sqrt(surface.covariance_mm2[:, 2, 2])
    assert np.mean(np.abs(z) < 1.96) > 0.85


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_markers_with_ten_times_the_noise(solved, seed: int) -> None:
    estimate, none = MechanicsEstimator(), np.zeros(len(solved[0][0]), dtype=bool)
    state = estimate.start(SENSOR)
    depth_error_mm = []
    for frame, (centre_px, depth_mm, *_) in enumerate([*[solved[0]] * 8, *solved[1:]]):
        grid = grid_of(centre_px, none, none, 100 * seed + frame, noise_px=0.3)
        state, surface, contacts = estimate.step(state, grid)
        assert surface.status == "ok"
        assert frame > 8 or not contacts.touching
        depth_error_mm.append(-surface.displacement_mm[:, 2] - depth_mm)
        z = depth_error_mm[-1] / np.sqrt(surface.covariance_mm2[:, 2, 2])
        assert np.mean(np.abs(z) < 1.96) > 0.85
    assert np.sqrt(np.mean(np.square(depth_error_mm), axis=1)).max() < 0.015
    found_mm = np.array([contact.centre_mm for contact in contacts.touching])
    away_mm = np.linalg.norm(np.array(solved[-1][2])[:, None] - found_mm, axis=2)
    assert len(found_mm) == 2
    assert away_mm.min(axis=1).max() < 1.0
    deepest_mm = np.array([contact.depth_mm for contact in contacts.touching])[away_mm.argmin(axis=1)]
    assert deepest_mm == pytest.approx(solved[-1][3], rel=0.06)


def test_the_depth_along_the_clamp_of_a_solid(solved) -> None:
    """Within a thickness of it, where a solid differs from any shell; nothing is fitted."""
    surface, _ = last(solved)
    half_mm = 0.5 * np.array(CASE.size_mm)
    assert SENSOR.layout is not None
    near = (half_mm - np.abs(SENSOR.layout.rest_mm[:, :2])).min(axis=1) < 2.5
    error_mm = (-surface.displacement_mm[:, 2] - solved[-1][1])[near]
    true_mm = solved[-1][1][near]
    assert np.sqrt(np.mean(error_mm**2)) < 0.36 * np.sqrt(np.mean(true_mm**2))


@pytest.fixture(scope="module")
def near_the_clamp(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sensor, ObservedPress]:
    """A small sheet, and a fingertip in it that is four thicknesses from a clamp."""
    sheet = Sheet(size_mm=np.array([44.0, 36.0]), thickness_mm=2.0, young_MPa=3.0, poisson=0.45)
    sensor = Sensor(
        name="small",
        camera=straight_camera(1200, 1000, focal_px=1500.0, distance_mm=60.0),
        layout=light_lattice((44.0, 36.0), 3.0, 0.75, 0.0),
        sheet=sheet,
    )
    whole = Prototype.of(sensor)
    folder = Path(tmp_path_factory.mktemp("states"))
    touched = replace(whole, states=StateCache(folder=folder)).press(FINGERTIP, np.array([13.0, 1.0]), 1.6)
    assert touched is not None
    return sensor, touched


def test_the_error_of_a_centre_near_a_clamp_is_in_its_deviation(
    near_the_clamp: tuple[Sensor, ObservedPress],
) -> None:
    sensor, touched = near_the_clamp
    estimate = MechanicsEstimator()
    state = estimate.start(sensor)
    none = np.zeros(len(touched.displacement_px), dtype=bool)
    for frame, share in enumerate([0.0, 0.2, 0.6, 1.0, 1.0, 1.0, 1.0]):
        centre_px = state.reference_px + share * touched.displacement_px
        state, _, contacts = estimate.step(state, grid_of(centre_px, none, none, frame, noise_px=0.01))
    (contact,) = contacts.touching
    off_mm = contact.centre_mm - touched.contact.centre_mm
    std_mm = np.array([contact.std("x"), contact.std("y")])
    assert abs(off_mm[0]) > 0.1
    assert (np.abs(off_mm) < 2.0 * std_mm).all()
    assert std_mm[0] > 2.0 * std_mm[1]
