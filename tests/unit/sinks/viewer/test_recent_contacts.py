"""Contacts that are kept for pages that are opened later."""

from dataclasses import replace

import pytest

pytest.importorskip("nicegui")

from manytouch.sinks.files.tables import contact_column_names
from manytouch.sinks.viewer.recent_contacts import CODES, COLUMNS, MAX_ROWS, SPAN_S, RecentContacts
from manytouch.values import Reading
from viewer_session import reading_of

FPS = 30


def crowd(index: int, count: int) -> Reading:
    reading = reading_of(index)
    (one,) = reading.contacts.contacts
    contacts = tuple(replace(one, id=k) for k in range(count))
    return replace(reading, contacts=replace(reading.contacts, contacts=contacts))


def test_nothing_was_read_yet() -> None:
    message = RecentContacts().message()
    assert (message["time_s"], message["rows"]) == (None, [])


def test_a_row_has_the_numbers_of_a_contact_and_none_where_they_are_not_known() -> None:
    recent = RecentContacts()
    recent.add(reading_of(30, 2.5))
    message = recent.message()
    (row,) = message["rows"]
    assert message["time_s"] == row[0] == pytest.approx(1.0, abs=1e-3)
    found = dict(zip(("time_s", "contact", *message["columns"]), row, strict=True))
    assert message["columns"] == COLUMNS
    assert ("frame", "time_s", "contact", *COLUMNS[1:]) == contact_column_names("mm")
    assert (found["frame"], CODES["phase"][found["phase"]]) == (30, "move")
    assert (found["contact"], found["x_mm"], found["y_mm"], found["depth_mm"]) == (7, -20.0, 8.0, 2.5)
    assert (found["normal_force_N"], found["force_std_N"]) == (1.5, pytest.approx(0.05))
    assert [found[name] for name in ("shear_x_N", "shear_y_N", "torque_Nmm", "slip")] == [None] * 4


def test_rows_are_those_of_the_last_seconds_and_not_too_many() -> None:
    recent = RecentContacts()
    for index in range(round(2 * SPAN_S) * FPS):
        recent.add(reading_of(index))
    times = [row[0] for row in recent.message()["rows"]]
    assert times[-1] - times[0] == pytest.approx(SPAN_S, abs=2 / FPS)
    for index in range(0, 10 * FPS):
        recent.add(crowd(round(2 * SPAN_S) * FPS + index, 20))
    assert len(recent.message()["rows"]) == MAX_ROWS


def test_a_repeated_reading_adds_nothing_and_another_place_begins_again() -> None:
    recent = RecentContacts()
    for index in (100, 101, 101, 102):
        recent.add(reading_of(index))
    assert len(recent.message()["rows"]) == 3
    recent.add(reading_of(40))
    assert len(recent.message()["rows"]) == 1
    recent.add(reading_of(40 + round(SPAN_S + 1) * FPS))
    assert len(recent.message()["rows"]) == 1
