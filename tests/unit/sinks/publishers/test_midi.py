"""MIDI polyphonic expression, byte by byte, and a file that mido reads."""

import threading
from pathlib import Path

import mido
import numpy as np
import pytest

from manytouch.errors import OutputError
from manytouch.sinks.publishers import midi
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.midi import MpeEncoder
from manytouch.sinks.publishers.queued import QueuedOutput
from manytouch.sinks.publishers.registry import SCHEMES, open_outputs
from manytouch.sinks.publishers.touches import TouchScale
from manytouch.values import Phase
from waiting import wait_until


@pytest.fixture
def touch(contact_of):
    """A contact with a force, at a share of the width and the height."""

    def make(number: int, x: float, y: float, force_N: float, phase: Phase = Phase.MOVE):
        centre_mm = np.array([-15.0 + 30.0 * x, -8.0 + 16.0 * y])
        return contact_of(number, phase, centre_mm=centre_mm, force_N=np.array([0.0, 0.0, -force_N]))

    return make


@pytest.fixture
def encoder(sensor) -> MpeEncoder:
    return MpeEncoder(TouchScale(sensor, force_N=10.0), low_note=48, notes=24.0)


def sent(messages) -> list[str]:
    return [message.hex() for message in messages]


def test_the_configuration_is_a_lower_zone_of_15_channels(encoder) -> None:
    assert sent(encoder.configuration()) == ["B0 65 00", "B0 64 06", "B0 06 0F"]


def test_a_contact_is_a_note_that_bends_presses_and_ends(encoder, reading_of, touch) -> None:
    assert encoder(reading_of(0)) == []
    # 40 ms later, 2.5 of 10 N: a quarter of full scale, 127 * 0.25 * 50 ms / 40 ms = 40
    begin = encoder(reading_of(1, (touch(3, 0.5, 0.25, 2.5, Phase.START),)))
    assert sent(begin) == ["E1 00 40", "B1 4A 5F", "D1 20", "91 3C 28"]
    # 1 mm of 30 to the right: 24 / 30 semitones, 8192 * 0.8 / 48 = 137 above the centre of 8192
    moved = encoder(reading_of(2, (touch(3, 0.5 + 1 / 30, 0.25, 5.0),)))
    assert sent(moved) == ["E1 09 41", "D1 40"]
    assert encoder(reading_of(3, (touch(3, 0.5 + 1 / 30, 0.25, 5.0),))) == []
    assert sent(encoder(reading_of(4, (touch(3, 0.5, 0.25, 5.0, Phase.END),)))) == ["81 3C 00"]


def test_each_contact_has_a_channel_and_the_sixteenth_waits_for_one(encoder, reading_of, touch) -> None:
    many = tuple(touch(number, 0.5, 0.5, 1.0) for number in range(16))
    notes = [message for message in encoder(reading_of(0, many)) if message.type == "note_on"]
    assert [message.channel for message in notes] == list(range(1, 16))
    later = encoder(reading_of(1, many[1:]))
    assert [(message.type, message.channel) for message in later if message.type.startswith("note")] == [
        ("note_off", 1),
        ("note_on", 1),
    ]
    assert len(encoder.silence()) == 15


def test_an_unknown_force_sounds_by_its_depth(encoder, reading_of, contact_of) -> None:
    messages = encoder(reading_of(0, (contact_of(1, Phase.START, depth_mm=2.0),)))
    pressure = [message.value for message in messages if message.type == "aftertouch"]
    assert pressure == [round(127 * 2.0 / np.sqrt(5.0 * 4.0))]


def test_a_file_has_the_messages_at_their_times(tmp_path: Path, session, reading_of, touch) -> None:
    path = tmp_path / "take.mid"
    (output,) = open_outputs([f"midi://{path}?low-note=60&notes=12"], session)
    for index, force_N in enumerate((1.0, 2.0, 3.0)):
        output.write(reading_of(25 * index, (touch(3, 0.5, 0.25, force_N),)))  # one per second
    output.close()
    file = mido.MidiFile(path)
    assert file.length == pytest.approx(2.0)
    (note,) = (message for message in file.tracks[0] if message.type == "note_on")
    assert (note.note, note.channel) == (66, 1)
    seconds, found = 0.0, []
    for message in file:
        seconds += message.time
        if message.type in ("aftertouch", "note_off"):
            found.append((message.type, round(seconds, 2)))
    assert found == [("aftertouch", 0.0), ("aftertouch", 1.0), ("aftertouch", 2.0), ("note_off", 2.0)]


def test_an_existing_file_is_renamed_when_the_new_one_is_complete(
    tmp_path: Path, session, reading_of, touch
) -> None:
    path, url = tmp_path / "take.mid", f"midi://{tmp_path / 'take.mid'}"
    path.write_bytes(b"earlier")
    (unused,) = open_outputs([url], session)
    unused.close()
    assert [each.name for each in tmp_path.iterdir()] == ["take.mid"]
    (output,) = open_outputs([url], session)
    assert output.description.endswith("the existing file is then renamed to take-1.mid")
    output.write(reading_of(0, (touch(3, 0.5, 0.25, 1.0),)))
    wait_until(lambda: output.state.sent == 1)
    assert path.read_bytes() == b"earlier"
    output.close()
    assert sorted(each.name for each in tmp_path.iterdir()) == ["take-1.mid", "take.mid"]
    assert (tmp_path / "take-1.mid").read_bytes() == b"earlier"
    assert any(message.type == "note_on" for message in mido.MidiFile(path).tracks[0])


def test_without_ports_the_names_and_the_remedy_are_stated(session) -> None:
    with pytest.raises(OutputError, match=r"python-rtmidi|those of this computer"):
        open_outputs(["midi://no such port"], session)


class Port:
    """A port of another program, and what it has received."""

    name = "Synth:in 20:0"

    def __init__(self) -> None:
        self.messages: list[mido.Message] = []

    def send(self, message: mido.Message) -> None:
        self.messages.append(message)

    def close(self) -> None:
        """Nothing is open."""


def test_a_port_that_disappears_is_opened_again_once_it_is_back(
    session, reading_of, touch, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Port] = []
    names = [Port.name]
    monkeypatch.setattr(midi, "PRESENCE_INTERVAL_S", 0.0)
    monkeypatch.setattr(mido, "get_output_names", lambda: list(names))
    monkeypatch.setattr(mido, "open_output", lambda _: opened.append(Port()) or opened[-1])
    address = parse_address("midi://synth")
    output = QueuedOutput(
        "synth", lambda: SCHEMES["midi"].open_publisher(address, session), retry_interval_s=0.01
    )

    def publish(until) -> None:
        for index in range(500):
            output.write(reading_of(index, (touch(3, 0.5, 0.25, 5.0),)))
            if until():
                return
            threading.Event().wait(0.01)
        raise AssertionError(output.state)

    publish(lambda: any(message.type == "note_on" for message in opened[0].messages))
    names.clear()
    publish(lambda: "there is no MIDI port 'synth'" in (output.state.problem or ""))
    names.append(Port.name)
    publish(lambda: len(opened) > 1 and any(each.type == "note_on" for each in opened[-1].messages))
    output.close()
    assert output.state.problem is None
    assert output.state.dropped > 0
