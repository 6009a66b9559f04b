"""Markers of a slack sheet under given loads, and the contacts of the method `mechanics`."""

from dataclasses import replace
from functools import cache

import numpy as np

from manytouch.design.dimensions import light_lattice
from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.clusters.rigid_faces import RigidFaces
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.geometry.camera import project
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.values import Contacts, Sensor, Sheet, TrackedGrid
from manytouch.values.arrays import Points2, read_only
from straight import straight_camera

NOISE_PX = 0.02
THICKNESS_MM = 2.0


@cache
def slack_sensor() -> Sensor:
    sheet = Sheet(
        size_mm=np.array([72.0, 60.0]),
        thickness_mm=THICKNESS_MM,
        young_MPa=3.0,
        poisson=0.45,
        pretension_N_per_mm=0.0,
    )
    return Sensor(
        name="slack",
        camera=straight_camera(1600, 1400, focal_px=2000.0, distance_mm=100.0),
        layout=light_lattice((72.0, 60.0), 3.0, 0.75, 0.0),
        sheet=sheet,
    )


@cache
def started(faces: RigidFaces | None = None) -> MechanicsState:
    """The state before the first frame; it is a value, so that tests can share it."""
    return _estimator(faces).start(slack_sensor())


def _estimator(faces: RigidFaces | None) -> MechanicsEstimator:
    return replace(MechanicsEstimator(), rigid_faces=faces or RigidFaces())


@cache
def _centre_px(places_mm: tuple[tuple[float, float], ...], force_mm2: float, shear_mm2: float) -> Points2:
    """Images of the markers without noise; each load is solved once."""
    sensor, model = slack_sensor(), started().model
    load = np.zeros((model.patch.node_count, 3))
    if force_mm2:
        each = np.tile(np.array([shear_mm2, 0.0, -force_mm2]) / len(places_mm), (len(places_mm), 1))
        load = model.patch.load(np.array(places_mm), each)
    found = equilibrium(model.shell, load)
    assert found.status == "ok"
    assert sensor.layout is not None
    rest_px = project(sensor.camera, sensor.layout.rest_mm)
    return read_only(rest_px + model.dots.displacement_px(found.coefficient_mm))


def pressed(place_mm: np.ndarray, force_mm2: float, seed: int, shear_mm2: float = 0.0) -> TrackedGrid:
    """Markers under forces over E that places (k, 2) share evenly: down, and along x; with noise."""
    centre_px = _centre_px(tuple(map(tuple, place_mm.tolist())), force_mm2, shear_mm2)
    count = len(centre_px)
    return TrackedGrid(
        position_px=read_only(centre_px + np.random.default_rng(seed).normal(0.0, NOISE_PX, (count, 2))),
        covariance_px2=read_only(np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1))),
        is_seen=read_only(np.ones(count, dtype=bool)),
        frames_unseen=read_only(np.zeros(count, dtype=np.int64)),
    )


def contacts_of(grids: list[TrackedGrid], faces: RigidFaces | None = None) -> Contacts:
    """Contacts of the last of several frames."""
    estimator, state = _estimator(faces), started(faces)
    for grid in grids:
        state, _, contacts = estimator.step(state, grid)
    return contacts


def disc_mm(x: float, y: float, radius_mm: float) -> np.ndarray:
    """Places (60, 2) of even weight on a disc."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    ring = radius_mm * np.sqrt((np.arange(5) + 0.5) / 5)
    return np.stack([x + np.outer(ring, np.cos(angle)), y + np.outer(ring, np.sin(angle))], axis=-1).reshape(
        -1, 2
    )
