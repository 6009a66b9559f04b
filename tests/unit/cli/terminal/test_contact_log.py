"""Lines at the start and the end of contacts, with the nearest true contact of the same frame."""

from dataclasses import replace

import numpy as np

from contacts import contact_with
from manytouch.cli.terminal.contact_log import ContactLog
from manytouch.values import (
    Contact,
    Contacts,
    Detections,
    Frame,
    Phase,
    Reading,
    Sensor,
    Sheet,
    Surface,
    TrackedGrid,
    Truth,
)
from straight import straight_camera

SENSOR = Sensor(
    name="bench",
    camera=straight_camera(64, 48, focal_px=50.0, distance_mm=50.0),
)
GRID = TrackedGrid(
    position_px=np.zeros((0, 2)),
    covariance_px2=np.zeros((0, 2, 2)),
    is_seen=np.zeros(0, dtype=np.bool_),
    frames_unseen=np.zeros(0, dtype=np.int64),
)
SURFACE = Surface(
    position_mm=np.zeros((0, 3)), displacement_mm=np.zeros((0, 3)), covariance_mm2=np.zeros((0, 3, 3))
)


def contact(number: int, phase: Phase, depth_mm: float, x_mm: float = 3.0) -> Contact:
    covariance = np.full((8, 8), np.nan)
    covariance[2, 2] = 0.25
    return contact_with(
        id=number,
        phase=phase,
        centre_mm=np.array([x_mm, -2.0]),
        depth_mm=depth_mm,
        covariance=covariance,
    )


def reading(index: int, *contacts: Contact) -> Reading:
    nothing = np.zeros(0)
    return Reading(
        frame=Frame(index=index, timestamp_ns=index * 500_000_000, camera="bench", image=None),
        detections=Detections(
            centre_px=np.zeros((0, 2)), covariance_px2=np.zeros((0, 2, 2)), area_px2=nothing, contrast=nothing
        ),
        grid=GRID,
        surface=SURFACE,
        contacts=Contacts(contacts=contacts),
        milliseconds=1.0,
    )


def truth(index: int) -> Truth:
    near, far = contact(0, Phase.MOVE, index + 0.9, 2.5), contact(1, Phase.MOVE, 9.0, 80.0)
    return Truth(frame_index=index, grid=GRID, surface=SURFACE, contacts=Contacts(contacts=(far, near)))


def lines_of(*readings: Reading, with_truth: bool = False) -> list[str]:
    lines: list[str] = []
    log = ContactLog(SENSOR, lines.append, truth if with_truth else None)
    for each in readings:
        log.write(each)
    log.close()
    return lines


ONE_CONTACT = (
    reading(0),
    reading(1, contact(4, Phase.START, 0.5)),
    reading(2, contact(4, Phase.MOVE, 2.0)),
    reading(3, contact(4, Phase.MOVE, 1.0)),
    reading(4, contact(4, Phase.END, 1.0)),
)


def test_a_contact_has_a_line_at_its_start_and_one_at_its_end():
    _, start, end = lines_of(*ONE_CONTACT)
    assert start.split() == ["0.50", "s", "#4", "touches", "3.00", "-2.00", "0.50", "±", "0.50"]
    assert end.split()[:8] == ["2.00", "s", "#4", "gone", "3.00", "-2.00", "2.00", "±"]
    assert end.endswith("deepest of 1.50 s")


def test_the_end_has_the_nearest_true_contact_of_the_deepest_frame():
    _, start, end = lines_of(*ONE_CONTACT, with_truth=True)
    assert start.endswith("truth 2.50, -2.00, depth 1.90")
    assert end.endswith("truth 2.50, -2.00, depth 2.90")


def test_open_contacts_are_printed_on_closing():
    assert "#4 still there" in lines_of(*ONE_CONTACT[:3])[-1]


def test_forces_are_printed_where_the_sensor_states_the_modulus():
    def pressed(each: Contact) -> Contact:
        covariance = each.covariance.copy()
        covariance[5, 5] = 0.01
        return replace(each, force_N=np.array([0.0, 0.0, -1.25]), covariance=covariance)

    sheet = Sheet(size_mm=np.array([40.0, 30.0]), thickness_mm=3.0, young_MPa=2.0)
    lines: list[str] = []
    near = pressed(contact(0, Phase.MOVE, 2.0))
    known = Truth(frame_index=1, grid=GRID, surface=SURFACE, contacts=Contacts(contacts=(near,)))
    log = ContactLog(replace(SENSOR, sheet=sheet), lines.append, lambda _: known)
    log.write(reading(1, pressed(contact(4, Phase.START, 0.5))))
    log.write(reading(2, contact(5, Phase.START, 0.5)))
    headings, first, second = lines
    assert "force (N)" in headings
    assert "0.50 ± 0.50       1.25 ± 0.10     truth 3.00, -2.00, depth 2.00, 1.25 N" in first
    assert "0.50 ± 0.50       unknown " in second
    assert "force" not in lines_of(*ONE_CONTACT)[0]


def test_nothing_is_printed_without_contacts():
    assert lines_of(reading(0), reading(1)) == []


def test_a_playback_that_goes_back_prints_each_contact_once():
    back = (*ONE_CONTACT, *ONE_CONTACT[:3])
    assert lines_of(*back) == lines_of(*ONE_CONTACT)
    still = lines_of(*ONE_CONTACT[:4], ONE_CONTACT[0])[-1]
    assert still.split()[:4] == ["1.50", "s", "#4", "still"]
    assert still.endswith("deepest of 1.00 s")


def test_a_contact_that_ended_in_frames_left_out_is_gone():
    assert "#4 gone" in lines_of(*ONE_CONTACT[:3], reading(400))[-1]
