"""Identities that last: births, gaps, crossings, ends."""

from collections.abc import Sequence

import numpy as np
import pytest

from manytouch.errors import SensorError
from manytouch.estimation.contact_tracker import ContactTracker
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Camera, Contact, Contacts, Phase, Sensor

SENSOR = demo_sensor(640)  # pitch 4 mm
IDENTITY = ContactTracker()


def contact(x: float, y: float, depth: float = 1.0, force_mm2: float = np.nan) -> Contact:
    return Contact(
        id=-1,
        phase=Phase.MOVE,
        centre_mm=np.array([x, y], dtype=np.float64),
        centre_px=np.array([10.0 * x, 10.0 * y]),
        depth_mm=depth,
        force_N=np.full(3, np.nan),
        torque_Nmm=np.nan,
        area_mm2=20.0,
        covariance=np.eye(8),
        normal_force_over_E_mm2=force_mm2,
    )


def played(
    frames: Sequence[Sequence[Contact]], *, identity: ContactTracker = IDENTITY, **kept: object
) -> list[Contacts]:
    state = identity.start(SENSOR)
    told = []
    for found in frames:
        state, contacts = identity.step(state, found, **kept)  # type: ignore[arg-type]
        told.append(contacts)
    return told


def phases(told: list[Contacts]) -> list[dict[int, str]]:
    return [{each.id: each.phase.value for each in contacts.contacts} for contacts in told]


def test_a_contact_starts_when_it_is_confirmed_moves_and_ends_with_its_last_values():
    frames = [[], [contact(0, 0)], [contact(1, 0)], [contact(2, 0, depth=3.0)], [], []]
    told = played(frames, identity=ContactTracker(bridge_frames=0))
    assert phases(told) == [{}, {}, {0: "start"}, {0: "move"}, {0: "end"}, {}]
    assert told[4].contacts[0].depth_mm == 3.0
    assert told[4].touching == ()


def test_what_shows_in_one_frame_only_is_no_contact():
    assert phases(played([[contact(0, 0)], [], [contact(0, 0)], [], []])) == [{}] * 5


def test_a_short_gap_does_not_end_a_contact_but_a_long_one_does():
    here = [contact(5, 5)]
    told = played([here, here, [], [], here, [], [], []])
    assert phases(told) == [{}, {0: "start"}, *[{0: "move"}] * 5, {0: "end"}]
    assert told[2].contacts[0].std("x") > told[1].contacts[0].std("x")


def test_a_contact_that_left_a_flat_sheet_ends_at_once():
    here = [contact(5, 5)]
    told = played([here, here, []], is_there=lambda points: np.zeros(len(points), dtype=np.bool_))
    assert phases(told)[-1] == {0: "end"}


def test_an_identity_is_never_given_twice():
    here = [contact(5, 5)]
    told = played([here, here, [], [], [], here, here])
    assert phases(told)[-1] == {1: "start"}


def test_a_contact_that_comes_up_elsewhere_is_another():
    told = played([[contact(0, 0)]] * 3 + [[contact(30, 0)]] * 6)
    assert phases(told)[-1] == {1: "move"}
    assert {id_ for frame in phases(told) for id_, phase in frame.items() if phase == "end"} == {0}


def test_the_order_in_which_contacts_are_found_does_not_matter():
    chance = np.random.default_rng(3)
    place = np.array([[-30.0, 0.0], [0.0, 10.0], [25.0, -8.0], [40.0, 20.0]])
    state = IDENTITY.start(SENSOR)
    for frame in range(12):
        order = chance.permutation(4)
        state, told = IDENTITY.step(state, [contact(*(place[k] + 0.5 * frame)) for k in order])
    now = {round(float(each.centre_mm[0] - 5.5)): each.id for each in told.contacts}
    assert sorted(now) == [-30, 0, 25, 40]
    ids = [each.id for each in told.contacts]
    assert ids == sorted(ids) == [0, 1, 2, 3]
    state, again = IDENTITY.step(state, [contact(*(place[k] + 6.0)) for k in (3, 1, 0, 2)])
    assert {round(float(each.centre_mm[0] - 6)): each.id for each in again.contacts} == now


def test_neighbours_that_move_together_keep_their_own_identities():
    """The nearest partner of one is the other's last place; the sum of both tells."""
    frames = [[contact(6.0 * k + 5.0 * t, 0) for k in range(3)] for t in range(6)]
    told = played(frames)
    assert [each.id for each in told[-1].contacts] == [0, 1, 2]
    assert [each.centre_mm[0] for each in told[-1].contacts] == [25.0, 31.0, 37.0]


def test_a_faint_contact_goes_on_but_does_not_begin():
    here = [contact(5, 5)]
    faint = played([here] * 5, is_firm=[False])
    assert phases(faint) == [{}] * 5
    state = IDENTITY.start(SENSOR)
    for firm in (True, True, False, False, False):
        state, told = IDENTITY.step(state, here, is_firm=[firm])
    assert phases([told]) == [{0: "move"}]


def test_two_that_become_one_are_one_at_once():
    apart = [contact(-3, 0, force_mm2=2.0), contact(3, 0, force_mm2=1.0)]
    told = played([apart, apart, [contact(-1, 0, force_mm2=3.0)], [contact(-1, 0, force_mm2=3.0)]])
    assert phases(told)[1:] == [{0: "start", 1: "start"}, {0: "move", 1: "end"}, {0: "move"}]


@pytest.mark.parametrize(
    "left", [contact(-3, 0, force_mm2=2.0), contact(-3, 0, force_mm2=3.0), contact(-1, 0)]
)
def test_one_that_is_missed_beside_another_is_bridged(left: Contact):
    apart = [contact(-3, 0, force_mm2=2.0), contact(3, 0, force_mm2=1.0)]
    told = played([apart, apart, [left], apart])
    assert phases(told)[2:] == [{0: "move", 1: "move"}] * 2


def test_frames_that_went_wrong_do_not_end_contacts():
    here = [contact(5, 5)]
    state = IDENTITY.start(SENSOR)
    for _ in range(3):
        state, _ = IDENTITY.step(state, here)
    for _ in range(8):
        state, told = IDENTITY.step(state, [], status="few_markers")
        assert told.status == "few_markers"
        assert [each.id for each in told.touching] == [0]
    state, told = IDENTITY.step(state, here)
    assert phases([told]) == [{0: "move"}]


def test_a_sensor_without_markers_is_refused_in_a_sentence():
    camera: Camera = SENSOR.camera
    with pytest.raises(SensorError, match="no \\[markers\\]"):
        IDENTITY.start(Sensor(name="bare", camera=camera))
