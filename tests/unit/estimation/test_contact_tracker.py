"""Identities over starts, gaps, crossings and ends."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from contacts import contact_with
from manytouch.errors import SensorError
from manytouch.estimation.contact_tracker import ContactTracker
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Camera, Contact, Contacts, Sensor, Status

SENSOR = demo_sensor(640)  # pitch 4 mm
TRACKER = ContactTracker()


def contact(x: float, y: float, depth: float = 1.0, force_mm2: float = np.nan) -> Contact:
    return contact_with(
        id=-1,
        centre_mm=np.array([x, y], dtype=np.float64),
        centre_px=np.array([10.0 * x, 10.0 * y]),
        depth_mm=depth,
        area_mm2=20.0,
        covariance=np.eye(8),
        normal_force_over_E_mm2=force_mm2,
    )


def track(
    frames: Sequence[Sequence[Contact]], *, tracker: ContactTracker = TRACKER, **options: object
) -> list[Contacts]:
    state = tracker.start(SENSOR)
    tracked = []
    for found in frames:
        state, contacts = tracker.step(state, found, **options)  # type: ignore[arg-type]
        tracked.append(contacts)
    return tracked


def phases(tracked: list[Contacts]) -> list[dict[int, str]]:
    return [{each.id: each.phase.value for each in contacts.contacts} for contacts in tracked]


def test_a_contact_starts_when_it_is_confirmed_moves_and_ends_with_its_last_values():
    frames = [[], [contact(0, 0)], [contact(1, 0)], [contact(2, 0, depth=3.0)], [], []]
    tracked = track(frames, tracker=ContactTracker(bridge_frames=0))
    assert phases(tracked) == [{}, {}, {0: "start"}, {0: "move"}, {0: "end"}, {}]
    assert tracked[4].contacts[0].depth_mm == 3.0
    assert tracked[4].touching == ()


def test_a_contact_in_one_frame_only_is_not_confirmed():
    assert phases(track([[contact(0, 0)], [], [contact(0, 0)], [], []])) == [{}] * 5


def test_a_short_gap_does_not_end_a_contact_but_a_long_one_does():
    here = [contact(5, 5)]
    tracked = track([here, here, [], [], here, [], [], []])
    assert phases(tracked) == [{}, {0: "start"}, *[{0: "move"}] * 5, {0: "end"}]
    assert tracked[2].contacts[0].std("x") > tracked[1].contacts[0].std("x")


def test_a_contact_that_a_frame_does_not_show_may_have_any_smaller_force():
    known = replace(
        contact(5, 5, depth=2.0),
        force_N=np.array([0.3, -0.4, -5.0]),
        torque_Nmm=6.0,
        covariance=0.01 * np.eye(8),
    )
    before, kept = (each.contacts[0] for each in track([[known], [known], []])[1:])
    values = {"depth": 2.0, "shear_x": 0.3, "normal_force": 5.0, "torque": 6.0, "area": 20.0}
    for name, value in values.items():
        assert value / 2 < kept.std(name) < value, name  # 0 and all of it are within two deviations
        assert before.std(name) == pytest.approx(0.1)
    state = TRACKER.start(SENSOR)
    for status, found in ((Status.OK, [known]), (Status.OK, [known]), (Status.DARK, [])):
        state, dark = TRACKER.step(state, found, status=status)
    assert dark.contacts[0].std("depth") == pytest.approx(0.2)  # a dark frame shows nothing


def test_a_contact_that_left_an_unloaded_sheet_ends_at_once():
    here = [contact(5, 5)]
    tracked = track([here, here, []], is_loaded=lambda _: False)
    assert phases(tracked)[-1] == {0: "end"}


def test_an_identity_is_never_reused():
    here = [contact(5, 5)]
    tracked = track([here, here, [], [], [], here, here])
    assert phases(tracked)[-1] == {1: "start"}


def test_a_contact_far_from_the_last_one_is_another():
    tracked = track([[contact(0, 0)]] * 3 + [[contact(30, 0)]] * 6)
    assert phases(tracked)[-1] == {1: "move"}
    assert {id_ for frame in phases(tracked) for id_, phase in frame.items() if phase == "end"} == {0}


def test_the_order_in_which_contacts_are_found_does_not_matter():
    random = np.random.default_rng(3)
    place = np.array([[-30.0, 0.0], [0.0, 10.0], [25.0, -8.0], [40.0, 20.0]])
    state = TRACKER.start(SENSOR)
    for frame in range(12):
        order = random.permutation(4)
        state, tracked = TRACKER.step(state, [contact(*(place[k] + 0.5 * frame)) for k in order])
    now = {round(float(each.centre_mm[0] - 5.5)): each.id for each in tracked.contacts}
    assert sorted(now) == [-30, 0, 25, 40]
    ids = [each.id for each in tracked.contacts]
    assert ids == sorted(ids) == [0, 1, 2, 3]
    state, again = TRACKER.step(state, [contact(*(place[k] + 6.0)) for k in (3, 1, 0, 2)])
    assert {round(float(each.centre_mm[0] - 6)): each.id for each in again.contacts} == now


def test_neighbours_that_move_together_keep_their_identities():
    """The nearest partner of one is the other's last place; the smallest sum decides."""
    frames = [[contact(6.0 * k + 5.0 * t, 0) for k in range(3)] for t in range(6)]
    tracked = track(frames)
    assert [each.id for each in tracked[-1].contacts] == [0, 1, 2]
    assert [each.centre_mm[0] for each in tracked[-1].contacts] == [25.0, 31.0, 37.0]


def test_a_faint_contact_continues_but_does_not_start():
    here = [contact(5, 5)]
    faint = track([here] * 5, may_start=[False])
    assert phases(faint) == [{}] * 5
    state = TRACKER.start(SENSOR)
    for start in (True, True, False, False, False):
        state, tracked = TRACKER.step(state, here, may_start=[start])
    assert phases([tracked]) == [{0: "move"}]


def test_two_contacts_that_merge_become_one_at_once():
    apart = [contact(-3, 0, force_mm2=2.0), contact(3, 0, force_mm2=1.0)]
    tracked = track([apart, apart, [contact(-1, 0, force_mm2=3.0)], [contact(-1, 0, force_mm2=3.0)]])
    assert phases(tracked)[1:] == [{0: "start", 1: "start"}, {0: "move", 1: "end"}, {0: "move"}]


@pytest.mark.parametrize(
    ("half_major_mm", "last"), [(4.5, {0: "move", 1: "end"}), (3.5, {0: "move", 1: "move"})]
)
def test_two_that_merge_while_they_are_released_become_one_if_it_extends_to_both(
    half_major_mm: float, last: dict[int, str]
):
    apart = [contact(-3, 0, force_mm2=2.0), contact(3, 0, force_mm2=1.0)]
    one = replace(contact(-1, 0, force_mm2=2.0), half_major_mm=half_major_mm)
    assert phases(track([apart, apart, [one]]))[2] == last


@pytest.mark.parametrize(
    "left", [contact(-3, 0, force_mm2=2.0), contact(-3, 0, force_mm2=3.0), contact(-1, 0)]
)
def test_one_that_is_missed_near_another_is_bridged(left: Contact):
    apart = [contact(-3, 0, force_mm2=2.0), contact(3, 0, force_mm2=1.0)]
    tracked = track([apart, apart, [left], apart])
    assert phases(tracked)[2:] == [{0: "move", 1: "move"}] * 2


def test_unusable_frames_do_not_end_contacts():
    here = [contact(5, 5)]
    state = TRACKER.start(SENSOR)
    for _ in range(3):
        state, _ = TRACKER.step(state, here)
    for _ in range(8):
        state, tracked = TRACKER.step(state, [], status=Status.FEW_MARKERS)
        assert tracked.status == "few_markers"
        assert [each.id for each in tracked.touching] == [0]
    state, tracked = TRACKER.step(state, here)
    assert phases([tracked]) == [{0: "move"}]


def test_a_sensor_without_markers_raises():
    camera: Camera = SENSOR.camera
    with pytest.raises(SensorError, match="no \\[markers\\]"):
        TRACKER.start(Sensor(name="bare", camera=camera))


def test_an_uncertain_centre_may_jump_further():
    frames = [[contact(0, 0)], [contact(0, 0)], [contact(9.5, 0)]]
    uncertain = ContactTracker(gate_stds=2.0)  # both centres have a deviation of 1 mm
    for tracker, x_mm in ((TRACKER, 0.0), (uncertain, 9.5)):
        (last,) = track(frames, tracker=tracker)[-1].touching
        assert last.centre_mm[0] == x_mm


def test_a_contact_of_another_tracker_continues_wherever_it_is():
    """Its id counts, not its place; without one, the place does."""
    first, second = replace(contact(0, 0), id=7), replace(contact(5, 0), id=8)
    frames = [[first, second]] * 2 + [[replace(contact(30, 0), id=7), replace(contact(0, 0), id=8)]]
    tracked = track(frames)
    places = {each.id: float(each.centre_mm[0]) for each in tracked[-1].touching}
    assert places == {0: 30.0, 1: 0.0}
    tracked = track([*frames, [contact(1, 0), replace(contact(30, 0), id=9)]])
    assert {each.id: float(each.centre_mm[0]) for each in tracked[-1].touching} == {0: 30.0, 1: 1.0}


def test_a_contact_is_as_old_as_the_time_since_its_first_frame():
    """Frames that do not show it count too."""
    state, here = TRACKER.start(SENSOR), [contact(5, 5)]
    ages_s = []
    for found in ([], here, here, [], here):
        state, _ = TRACKER.step(state, found, elapsed_s=0.05)
        ages_s.append(state.touching_s.tolist())
    assert ages_s == [[], [], [pytest.approx(0.05)], [pytest.approx(0.1)], [pytest.approx(0.15)]]
