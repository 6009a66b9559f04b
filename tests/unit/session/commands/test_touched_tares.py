"""Tares during which something touched the sheet: which reference is doubtful, and from when to when."""

from dataclasses import replace

from layouts import lattice_layout
from manytouch.session.commands.tare import TareTime
from manytouch.session.commands.touched_tares import TouchedTares
from manytouch.sinks.output_process.rest_reading import rest_reading
from manytouch.values import Contacts, Phase, Reading

TOUCHED = rest_reading(lattice_layout(4, 6, (5.0, 4.0), radius_mm=0.8, polarity="dark"))
S = 10**9


def at(second: int, contacts: int, *, phase: Phase = Phase.MOVE) -> Reading:
    (contact,) = TOUCHED.contacts.contacts
    named = tuple(replace(contact, id=number, phase=phase) for number in range(contacts))
    frame = replace(TOUCHED.frame, timestamp_ns=second * S)
    return replace(TOUCHED, frame=frame, contacts=Contacts(contacts=named))


def test_a_tare_is_doubtful_only_if_something_touched_between_its_frames() -> None:
    tares = TouchedTares()
    for second, contacts in enumerate((0, 2, 1, 0, 0)):
        tares.add(at(second, contacts))
    tares.add(at(5, 1, phase=Phase.END))
    assert tares.use(TareTime(begin_ns=3 * S, end_ns=5 * S)) is None
    assert tares.warnings == ()
    sentence = tares.use(TareTime(begin_ns=1 * S, end_ns=4 * S))
    assert sentence is not None
    assert sentence.startswith("2 contacts touched the sheet when it was tared at 1.00 s")
    assert sentence == tares.warning


def test_the_warning_is_that_of_the_reference_in_use() -> None:
    tares = TouchedTares()
    touched, other, clean = (TareTime(begin_ns=time * S, end_ns=time * S) for time in (1, 2, 3))
    for second, contacts in enumerate((0, 1, 1, 0)):
        tares.add(at(second, contacts))
    assert tares.use(None) is None
    first = tares.use(touched)
    assert first is not None
    assert tares.use(touched) is None, "parameters have changed, and not the reference"
    tares.add(at(4, 0))
    assert "tared at 2.00 s" in (tares.use(other) or "")
    tares.add(at(5, 0))
    assert tares.use(touched) == first, "the later one was undone"
    tares.add(at(6, 0))
    assert tares.use(clean) is None
    assert tares.warning is None
    assert [sentence.partition("contacts, ")[2] for sentence in tares.warnings] == [
        f"depths and forces until {end}.00 s are relative to the touched shape" for end in (6, 5)
    ]
