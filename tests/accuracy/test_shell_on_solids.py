"""The shell, and the inversion with it, against 3-D solids of other thicknesses than they were tried on."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from forward_error import CASES, SIZE_MM, YOUNG_MPA, Case, compare, solve_solid  # noqa: E402

from manytouch.design.dimensions import light_lattice  # noqa: E402
from manytouch.estimation import MechanicsEstimator  # noqa: E402
from manytouch.simulation.fem.cache import StateCache  # noqa: E402
from manytouch.simulation.render.dot_ellipses import dot_ellipses, outlines  # noqa: E402
from manytouch.values import Contact, Sensor, Sheet, TrackedGrid  # noqa: E402
from manytouch.values.arrays import read_only  # noqa: E402
from straight import straight_camera  # noqa: E402

NOISE_PX = 0.03
FRAMES = 6  # of each equilibrium
BY_NAME = {case.name: case for case in CASES}


@pytest.fixture(scope="module")
def states(tmp_path_factory: pytest.TempPathFactory) -> StateCache:
    return StateCache(folder=Path(tmp_path_factory.mktemp("states")))


def sensor_of(case: Case) -> Sensor:
    return Sensor(
        name=case.name,
        camera=straight_camera(2200, 1600, focal_px=2061.0, distance_mm=90.0),
        layout=light_lattice(SIZE_MM, 4.0, 1.0, 0.0),
        sheet=Sheet(
            size_mm=np.array(SIZE_MM),
            thickness_mm=case.thickness_mm,
            young_MPa=YOUNG_MPA,
            poisson=case.poisson,
            pretension_N_per_mm=case.pretension_N_per_mm,
            bending_factor=1.0,
        ),
    )


def estimates(case: Case, states: StateCache) -> list[tuple[float, Contact]]:
    """True force, and the only contact that is estimated, at each equilibrium."""
    sensor, estimate, chance = sensor_of(case), MechanicsEstimator(), np.random.default_rng(0)
    assert sensor.layout is not None
    edge_mm = outlines(sensor.layout.rest_mm, sensor.layout.radius_mm)
    state, found = estimate.start(sensor), []
    for solid in [None, *solve_solid(case, states)]:
        moved_mm = edge_mm.copy()
        if solid is not None:
            place_mm = np.ascontiguousarray(edge_mm.reshape(-1, 3)[:, :2])
            moved_mm += solid.displacement_mm(place_mm).reshape(edge_mm.shape)
        centre_px, _ = dot_ellipses(sensor.camera, moved_mm)
        count = len(centre_px)
        for _ in range(FRAMES):
            noisy_px = centre_px + chance.normal(0.0, NOISE_PX, centre_px.shape)
            grid = TrackedGrid(
                position_px=read_only(noisy_px),
                covariance_px2=read_only(np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1))),
                is_seen=read_only(np.ones(count, dtype=bool)),
                frames_unseen=read_only(np.zeros(count, dtype=np.int64)),
            )
            state, _, contacts = estimate.step(state, grid)
        if solid is None:
            assert not contacts.touching
        else:
            (contact,) = contacts.touching
            found.append((solid.contacts[0].normal_force_N, contact))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["3 mm", "1.5 mm", "5 mm", "nu 0.3"])
def test_the_shape_under_a_known_load(name: str, states: StateCache) -> None:
    for each in compare(BY_NAME[name], states):
        assert abs(each.near) < 0.03
        assert abs(each.far) < 0.03
        assert abs(each.in_plane) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "depths", "within"),
    [
        ("3 mm", 3, 0.05),
        ("1.5 mm", 3, 0.05),
        ("5 mm", 3, 0.09),
        ("2.7 t from the clamp", 3, 0.15),
        ("2 t from the clamp", 2, 0.15),
    ],
)
def test_the_force_of_a_ball(name: str, depths: int, within: float, states: StateCache) -> None:
    case = replace(BY_NAME[name], depth_mm=BY_NAME[name].depth_mm[:depths])
    for force_N, contact in estimates(case, states):
        assert -contact.force_N[2] == pytest.approx(force_N, rel=within)
