"""Contacts that are given: laws of the sheet, the 3-D states that are shipped, and what is refused."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from manytouch import Ball, ContactError, Patch, PointForces, SensorError, simulate_contacts
from manytouch.simulation.contacts.ball_kernels import Balls
from manytouch.simulation.contacts.coarse_sheet import CoarseSheet, DeadLoad
from manytouch.simulation.demo_sensor import demo_sensor, pad_sensor
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.scene.file import BUILT_IN, load_scene
from manytouch.simulation.scene.motion import poses
from manytouch.simulation.solve_scene import shipped_states, solid_problem
from manytouch.values import Phase, Sensor, Status

SENSOR = demo_sensor(640)
assert SENSOR.layout is not None
assert SENSOR.sheet is not None
PLACE_MM = np.ascontiguousarray(SENSOR.layout.rest_mm[:, :2])
THICKNESS_MM = SENSOR.sheet.thickness_mm


def ball(x_mm: float = 10.0, y_mm: float = -6.0, depth_mm: float = 3.0, radius_mm: float = 6.0) -> Ball:
    return Ball(x_mm=x_mm, y_mm=y_mm, depth_mm=depth_mm, radius_mm=radius_mm)


def patch(
    x_mm: float = -20.0, y_mm: float = 5.0, force_N: tuple = (0.0, 0.0, -2.0), size: float = 8.0
) -> Patch:
    return Patch(x_mm=x_mm, y_mm=y_mm, force_N=force_N, size_mm=(size, size))


def resultant_N(*contacts: Ball | Patch | PointForces, sensor: Sensor = SENSOR) -> np.ndarray:
    reading = simulate_contacts(sensor, contacts, output="reading")
    return np.sum([each.force_N for each in reading.contacts.contacts], axis=0)


BATCH = [
    [ball(), ball(-30.0, 10.0, 2.0, 5.0)],
    [],
    [patch(force_N=(0.4, -0.2, -1.5)), ball(25.0, 12.0, 6.0, 7.0)],
    [PointForces(place_mm=np.array([[0.0, 0.0], [2.0, 1.0]]), force_N=np.array([[0.0, 0.1, -1.0]] * 2))],
]


def test_a_batch_has_the_same_bits_as_its_presses_in_any_order() -> None:
    together = simulate_contacts(SENSOR, BATCH)
    assert together.shape == (4, 600, 3)
    assert np.abs(together[1]).max() < 1e-12
    for number in (3, 0, 2, 1, 0):
        np.testing.assert_array_equal(simulate_contacts(SENSOR, BATCH[number]), together[number])
    other = replace(SENSOR, sheet=replace(SENSOR.sheet))
    np.testing.assert_array_equal(simulate_contacts(other, BATCH), together)  # a solver of its own


def test_images_differ_by_their_seed_only() -> None:
    images = simulate_contacts(SENSOR, BATCH[:2], output="image", seed=7)
    assert images.shape == (2, 360, 640)
    assert images.dtype == np.uint8
    np.testing.assert_array_equal(simulate_contacts(SENSOR, BATCH[1], output="image", seed=8), images[1])
    other = simulate_contacts(SENSOR, BATCH[1], output="image", seed=9)
    assert 0.5 < np.abs(other.astype(float) - images[1]).mean() < 5.0


def test_a_reading_has_the_contacts_as_ids_in_their_order() -> None:
    contacts = [ball(0.0, 0.0, -1.0), patch(), ball()]  # the first one is above the sheet
    reading = simulate_contacts(SENSOR, contacts, output="reading")
    assert [contact.id for contact in reading.contacts.contacts] == [1, 2]
    assert {contact.phase for contact in reading.contacts.contacts} == {Phase.START}
    assert reading.status is Status.OK
    assert reading.frame.image is None
    dead, rigid = reading.contacts.contacts
    assert dead.force_N == pytest.approx([0.0, 0.0, -2.0])
    assert dead.centre_mm == pytest.approx([-20.0, 5.0])
    assert dead.area_mm2 == pytest.approx(np.pi * 16.0)
    assert rigid.centre_mm == pytest.approx([10.0, -6.0], abs=0.3)
    assert rigid.depth_mm == pytest.approx(3.0, abs=0.4)
    np.testing.assert_array_equal(reading.surface.displacement_mm, simulate_contacts(SENSOR, contacts))
    assert reading.grid.is_seen.all()
    assert reading.to_dict()["contacts"][1]["contact"] == 2


def test_it_agrees_with_the_shipped_3d_states() -> None:
    scene = load_scene(BUILT_IN / "one.toml", width_px=640)
    problem = solid_problem(scene)
    states = shipped_states("one", problem.keys)
    assert states is not None
    compared = 0
    for time_s, state in zip(problem.time_s.tolist(), states, strict=True):
        ((body, position_mm, _),) = poses(scene.bodies, time_s, thickness_mm=THICKNESS_MM)
        assert isinstance(body.indenter, Sphere)
        depth_mm, radius_mm = THICKNESS_MM - float(position_mm[2]), body.indenter.radius_mm
        (true,) = state.contacts
        if true.normal_force_N < 0.5:
            continue
        x_mm, y_mm = position_mm[:2].tolist()
        reading = simulate_contacts(SENSOR, [ball(x_mm, y_mm, depth_mm, radius_mm)], output="reading")
        (found,) = reading.contacts.contacts
        off_mm = reading.surface.displacement_mm - state.displacement_mm(PLACE_MM)
        assert np.sqrt(np.mean(off_mm[:, 2] ** 2)) < 0.008 * true.depth_mm
        assert np.abs(off_mm[:, :2]).max() < 0.03
        assert -found.force_N[2] == pytest.approx(true.normal_force_N, rel=0.06)
        assert found.depth_mm == pytest.approx(true.depth_mm, abs=0.06)
        assert np.linalg.norm(found.centre_mm - true.centre_mm) < 0.1
        compared += 1
    assert compared >= 12


def test_the_outline_holds_what_presses() -> None:
    grid = CoarseSheet(SENSOR.sheet).fine
    value, stretch = np.zeros((5, *grid.energy.shape)), np.ones(grid.energy.shape)
    forces_N = np.array([[0.3, 0.1, -1.0], [0.0, -0.4, -2.0]])
    dead_N = grid.nodal(DeadLoad(place_mm=np.array([[-20.3, 3.1], [10.9, 11.0]]), force_N=forces_N))
    assert dead_N.sum(axis=(1, 2)) == pytest.approx(forces_N.sum(axis=0))
    balls = Balls(
        centre_mm=np.array([[25.0, -20.0, 1.5 - 3.0 + 6.0]]),
        radius_mm=np.array([6.0]),
        stiffness_MPa_per_mm=np.array([1.5]),
    )
    loads, has_converged = grid.descend(value, stretch, balls, dead_N)
    assert has_converged
    _, slope = grid.energy.elastic(value, stretch)
    outline = np.ones(stretch.shape, dtype=bool)
    outline[1:-1, 1:-1] = False
    pull_N = -slope[:3, outline].sum(axis=1)
    assert pull_N == pytest.approx(forces_N.sum(axis=0) + loads.resultant[0, :3], abs=0.05)
    assert loads.resultant[0, 2] < -3.0


def test_small_forces_superpose_and_large_ones_stretch_the_sheet() -> None:
    def field_mm(*scales: float) -> np.ndarray:
        forces = ((0.02, 0.0, -0.1), (0.0, 0.01, -0.06))
        places = ((-12.0, 5.0), (14.0, -3.0))
        contacts = [
            patch(*place, force_N=tuple(scale * each for each in force))
            for scale, force, place in zip(scales, forces, places, strict=True)
        ]
        return simulate_contacts(SENSOR, contacts)

    both, one, other = field_mm(1.0, 1.0), field_mm(1.0, 0.0), field_mm(0.0, 1.0)
    peak_mm = np.abs(both).max()
    assert 0.03 < peak_mm < 0.2
    assert np.abs(both - one - other).max() < 0.02 * peak_mm
    slack = replace(SENSOR, sheet=replace(SENSOR.sheet, pretension_N_per_mm=0.0))
    little, much = (simulate_contacts(slack, [patch(force_N=(0.0, 0.0, -force))]) for force in (0.1, 4.0))
    assert np.abs(much).max() < 0.6 * 40.0 * np.abs(little).max()


def test_what_moves_what_is_mutual() -> None:
    """Betti: of two small forces, each does the same work on the displacement by the other one."""
    first, second = np.array([[-8.0, 4.0]]), np.array([[13.0, -9.0]])
    force = np.array([[0.0, 0.0, -0.2]])
    at = [int(np.argmin(np.linalg.norm(PLACE_MM - place, axis=1))) for place in (first, second)]
    first, second = PLACE_MM[at[0]][None], PLACE_MM[at[1]][None]
    there = simulate_contacts(SENSOR, [PointForces(place_mm=first, force_N=force)])[at[1], 2]
    back = simulate_contacts(SENSOR, [PointForces(place_mm=second, force_N=force)])[at[0], 2]
    assert there < -0.005
    assert there == pytest.approx(back, rel=0.02)


def test_far_away_only_the_force_of_a_contact_matters() -> None:
    rigid = simulate_contacts(SENSOR, [ball(0.0, 0.0, 3.0, 6.0)], output="reading")
    (contact,) = rigid.contacts.contacts
    x_N, y_N, z_N = contact.force_N.tolist()
    size = 2.0 * float(np.sqrt(contact.area_mm2 / np.pi))
    soft = simulate_contacts(SENSOR, [patch(0.0, 0.0, (x_N, y_N, z_N), size)])
    is_far = np.linalg.norm(PLACE_MM, axis=1) > 12.0
    off_mm = soft[is_far] - rigid.surface.displacement_mm[is_far]
    assert np.abs(off_mm).max() < 0.02 * contact.depth_mm


def test_mirrored_presses_give_mirrored_fields() -> None:
    one, other = (simulate_contacts(SENSOR, [ball(side * 15.0, side * -8.0, 4.0)]) for side in (1.0, -1.0))
    np.testing.assert_allclose(one, other[::-1] * [-1.0, -1.0, 1.0], atol=0.01)


def test_a_deep_ball_comes_in_steps() -> None:
    forces_N = [-resultant_N(ball(0.0, 0.0, depth_mm, 4.0))[2] for depth_mm in (2.0, 4.0, 6.0, 8.0)]
    assert np.all(np.diff(forces_N, n=2) > 0.0)


def test_many_balls_of_any_size_find_an_equilibrium() -> None:
    chance = np.random.default_rng(4)
    presses = [
        [
            ball(
                chance.uniform(-40.0, 40.0),
                chance.uniform(-24.0, 24.0),
                chance.uniform(-1.0, 8.0),
                chance.uniform(2.6, 20.0),
            )
            for _ in range(6)
        ]
        for _ in range(12)
    ]
    deepest_mm = -simulate_contacts(SENSOR, presses)[..., 2].min(axis=1)
    wanted_mm = [max(each.depth_mm for each in press) for press in presses]
    assert np.all(deepest_mm > 0.6 * np.array(wanted_mm))


def test_balls_at_one_place_are_contacts_of_one_depth() -> None:
    reading = simulate_contacts(SENSOR, [ball(), ball()], output="reading")
    first, second = reading.contacts.contacts
    (alone,) = simulate_contacts(SENSOR, [ball()], output="reading").contacts.contacts
    assert [first.depth_mm, second.depth_mm] == pytest.approx([alone.depth_mm] * 2, rel=0.05)
    assert np.allclose(first.centre_mm, second.centre_mm)


def test_a_press_without_an_equilibrium_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("manytouch.simulation.contacts.coarse_sheet.MOST_EVALUATIONS", 3)
    with pytest.raises(ContactError, match="press 1: no equilibrium was found"):
        simulate_contacts(SENSOR, [[], [ball()]])


@pytest.mark.parametrize(
    ("contacts", "message"),
    [
        ([ball(70.0)], r"contact 0 reaches \(70, -6\) mm, outside of the sheet, which ends at x = ±60 mm"),
        ([ball(), ball(55.0, depth_mm=3.0)], "contact 1 is 3 mm deep at 5 mm .* at most 2.5 mm there"),
        ([ball(radius_mm=1.0)], "radius of 1 mm, too small .* at least 2.5 mm, or a Patch"),
        ([ball(depth_mm=float("nan"))], "contact 0 has a depth_mm that is not finite: give a finite number"),
        ([patch(-59.0)], "outside of the sheet"),
        ([patch(size=0.0)], "give two positive lengths"),
        ([patch(force_N=(0.0, 0.0, -500.0))], "further than 20 mm: press with less force"),
        ([[ball()], [ball(), ball(99.0)]], "press 1: contact 1 reaches"),
    ],
)
def test_what_cannot_be_simulated_is_refused_in_a_sentence(contacts: list, message: str) -> None:
    with pytest.raises(ContactError, match=message):
        simulate_contacts(SENSOR, contacts)


def test_sensors_that_cannot_be_simulated_are_refused() -> None:
    with pytest.raises(SensorError, match=r"needs \[markers\]"):
        simulate_contacts(replace(SENSOR, layout=None), [])
    with pytest.raises(SensorError, match='boundary = "clamped"'):
        simulate_contacts(pad_sensor(), [])


WRONG = {
    "simulate(sensor, 5)": "contacts is of type int: give a list of contacts",
    "simulate('demo', [])": "the sensor is of type str: give a Sensor",
    "simulate(sensor, [], output='video')": "the output is 'video': give one of markers, image, reading",
    "simulate(sensor, [], output=['image'])": "the output is of type list: give markers, image or reading",
    "simulate(sensor, [], seed='a')": "the seed is of type str: give a whole number",
    "simulate(sensor, [], seed=1.5)": "the seed is of type float: give a whole number",
    "simulate(sensor, [3])": "contact 0 is of type int: give a Ball, a Patch or PointForces",
    "simulate(sensor, [[], [3]])": "press 1: contact 0 is of type int",
    "simulate(sensor, [[], 3])": "press 1: contacts is of type int: give a list of contacts",
    "patch(force_N=(0, -1))": "force_N of shape (2,): give finite numbers of shape (3,)",
    "patch(size_mm=5.0)": "size_mm of shape (): give finite numbers of shape (2,)",
    "patch(x_mm='left')": "x_mm of type str: give a finite number",
    "patch(x_mm='1')": "x_mm of type str: give a finite number",
    "patch(y_mm=10**400)": "y_mm of type int: give a finite number",
    "patch(size_mm=('5', '5'))": "size_mm of type tuple: give finite numbers of shape (2,)",
    "patch(x_mm=None)": "x_mm of type NoneType: give a finite number",
    "patch(outline=['ellipse'])": "outline ['ellipse']: give ellipse or rectangle",
    "patch(outline='ring')": "outline 'ring': give ellipse or rectangle",
    "forces([[0, 0]] * 3, [[0, 0, -1]] * 2)": "place_mm of shape (3, 2): give finite numbers of shape (2, 2)",
    "forces(1.0, 2.0)": "force_N of shape (): give finite numbers of shape (n, 3)",
}
PROGRAM = f"""
import numpy as np
from manytouch import ManytouchError, Patch, PointForces, simulate_contacts as simulate
from manytouch.simulation.demo_sensor import demo_sensor

sensor = demo_sensor(640)
valid = dict(x_mm=0, y_mm=0, force_N=(0, 0, -1), size_mm=(5, 5))

def patch(**wrong):
    return simulate(sensor, [Patch(**valid | wrong)])

def forces(place_mm, force_N):
    return simulate(sensor, [PointForces(place_mm=place_mm, force_N=force_N)])

for call in {list(WRONG)!r}:
    try:
        eval(call)
        print("accepted")
    except (ManytouchError, ValueError) as error:
        print(error)
patch(x_mm=1)
patch(x_mm=np.float32(1.0), size_mm=np.array([5, 5]))
simulate(sensor, [], output="image", seed=np.int64(2))
forces([[0, 0]], [[0, 0, -1]])
"""


def test_values_of_wrong_types_are_refused_in_a_sentence() -> None:
    """In a process in which no types are checked, as of users."""
    without = {name: value for name, value in os.environ.items() if name != "CHECK_TYPES"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False, env=without
    )
    assert done.returncode == 0, done.stderr
    for message, wanted in zip(done.stdout.splitlines(), WRONG.values(), strict=True):
        assert wanted in message
