"""MIDI polyphonic expression (MPE 1.1, MIDI Association M1-100-UM): one channel per contact.

Lower zone: channel 1 is the master, channels 2 to 16 are one contact each; further contacts are silent until
a channel is free. Of a contact

    note          from x, over `notes` semitones from `low-note` at the left
    velocity      rate of the pressure at its start; that of full scale within `ATTACK_S` is 127
    pitch bend    change of x since its start, ±48 semitones
    CC 74         y, 127 at the top
    channel pressure  normal force over that of full scale (`touches.TouchScale`)

Values are sent when they change. The control values come before the note, as the standard requires.
"""

import errno
import os
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from manytouch.errors import MissingExtraError, OutputError
from manytouch.sinks.files.atomic_output import atomic_file, next_free, rename_existing
from manytouch.sinks.publishers.address import OutputAddress
from manytouch.sinks.publishers.touches import NormalisedTouch, TouchScale
from manytouch.values import Reading

MEMBERS = 15
BEND_SEMITONES = 48  # of member channels after the configuration message
ATTACK_S = 0.05
ASSUMED_STEP_S = 1 / 30  # before the first reading that has another one before it
TIMBRE = 74
TICKS_PER_S = 960  # 480 per beat, 120 beats per minute
PRESENCE_INTERVAL_S = 2.0
"""How often a named port is looked for: the driver does not report that its program has ended."""


@dataclass(slots=True, kw_only=True)
class _Voice:
    """A note that sounds, and what was sent for it."""

    channel: int
    note: int
    values: tuple[int, int, int]


class MpeEncoder:
    """Converts readings to MIDI messages, in order; they are `mido.Message`, at time 0."""

    def __init__(self, scale: TouchScale, *, low_note: int = 48, notes: float = 24.0) -> None:
        """Prepare.

        Args:
            scale: of places and pressures.
            low_note: MIDI note at the left of the sheet.
            notes: semitones from the left to the right.
        """
        self._scale = scale
        self._low_note, self._notes = low_note, notes
        self._voices: dict[int, _Voice] = {}
        self._free = deque(range(1, MEMBERS + 1))
        self._last_ns: int | None = None

    def configuration(self) -> list[Any]:
        """Messages before all others: a lower zone with 15 member channels."""
        return [_control(0, 101, 0), _control(0, 100, 6), _control(0, 6, MEMBERS)]

    def __call__(self, reading: Reading) -> list[Any]:
        """Messages of a reading."""
        now_ns = reading.frame.timestamp_ns
        step_s = ASSUMED_STEP_S if self._last_ns is None else (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        touches = self._scale(reading)
        messages = self._released({touch.id for touch in touches})
        for touch in touches:
            voice = self._voices.get(touch.id)
            messages += self._moved(touch, voice) if voice is not None else self._started(touch, step_s)
        return messages

    def silence(self) -> list[Any]:
        """Messages that end all notes."""
        return self._released(set())

    def _released(self, present: set[int]) -> list[Any]:
        from mido import Message

        messages = []
        for number in [number for number in self._voices if number not in present]:
            voice = self._voices.pop(number)
            self._free.append(voice.channel)
            messages.append(Message("note_off", channel=voice.channel, note=voice.note, velocity=0))
        return messages

    def _started(self, touch: NormalisedTouch, step_s: float) -> list[Any]:
        from mido import Message

        if not self._free:
            return []
        channel = self._free.popleft()
        note = min(max(round(self._pitch(touch)), 0), 127)
        voice = _Voice(channel=channel, note=note, values=self._values(touch, note))
        self._voices[touch.id] = voice
        velocity = min(max(round(127 * touch.pressure * ATTACK_S / max(step_s, 1e-3)), 1), 127)
        messages = [_value(voice.channel, place, value) for place, value in enumerate(voice.values)]
        return [*messages, Message("note_on", channel=channel, note=note, velocity=velocity)]

    def _moved(self, touch: NormalisedTouch, voice: _Voice) -> list[Any]:
        values = self._values(touch, voice.note)
        changed = [
            _value(voice.channel, place, value)
            for place, (value, before) in enumerate(zip(values, voice.values, strict=True))
            if value != before
        ]
        voice.values = values
        return changed

    def _values(self, touch: NormalisedTouch, note: int) -> tuple[int, int, int]:
        """Pitch bend, CC 74 and channel pressure."""
        bend = round(8192 * (self._pitch(touch) - note) / BEND_SEMITONES)
        return min(max(bend, -8192), 8191), round(127 * (1.0 - touch.y)), round(127 * touch.pressure)

    def _pitch(self, touch: NormalisedTouch) -> float:
        return self._low_note + self._notes * touch.x


class MidiPublisher:
    """Sends messages to a MIDI port, or writes them to a file of type 0 when it is closed.

    An earlier file of that name is renamed then. Without a reading nothing is written.
    """

    def __init__(self, address: OutputAddress, encoder: MpeEncoder) -> None:
        """Open the port or prepare the file.

        Args:
            address: `midi://NAME` is the port whose name contains NAME, `midi://` a virtual port named
                manytouch, `midi://take.mid` and `midi:///folder/take.mid` a file.
            encoder: makes the messages.

        Raises:
            OutputError: there is no such port, or the file cannot be written.
            MissingExtraError: mido, or for ports python-rtmidi, is not installed.
        """
        try:
            import mido
        except ImportError:
            raise MissingExtraError("MIDI", "mido", "connect") from None
        self._encoder = encoder
        self._port: Any = None
        self._next_look_s = time.monotonic() + PRESENCE_INTERVAL_S
        target = f"{address.host}/{address.path}" if address.path else address.host
        self._path = Path(target) if target.lower().endswith(".mid") else None
        self._is_of_other = bool(target)
        self._track = mido.MidiTrack()
        self._first_ns: int | None = None
        self._ticks = 0
        if self._path is None:
            self._port = _open_port(target)
            self.description = f"sends notes to the MIDI port {self._port.name}"
        else:
            self.description = _prepare_file(self._path)
        self._send(encoder.configuration())

    def publish(self, reading: Reading) -> None:
        """Send or store the messages of a reading.

        Raises:
            OutputError: the port has disappeared; it can be opened again once it is back.
        """
        self._require_port()
        if self._first_ns is None:
            self._first_ns = reading.frame.timestamp_ns
        elapsed_s = (reading.frame.timestamp_ns - self._first_ns) * 1e-9
        self._send(self._encoder(reading), max(round(elapsed_s * TICKS_PER_S), self._ticks))

    def close(self) -> None:
        """End all notes; close the port or write the file.

        Raises:
            OutputError: the file cannot be written.
        """
        self._send(self._encoder.silence(), self._ticks)
        if self._port is not None:
            self._port.close()
        elif self._path is not None and self._first_ns is not None:
            self._save(self._path)

    def _send(self, messages: Sequence[Any], ticks: int = 0) -> None:
        for message in messages:
            if self._port is not None:
                self._port.send(message)
            else:
                self._track.append(message.copy(time=ticks - self._ticks))
                self._ticks = ticks

    def _require_port(self) -> None:
        """Look, from time to time, whether there still is the port of another program or device."""
        if self._port is None or not self._is_of_other or time.monotonic() < self._next_look_s:
            return
        import mido

        self._next_look_s = time.monotonic() + PRESENCE_INTERVAL_S
        if self._port.name not in mido.get_output_names():
            raise OutputError(f"the MIDI port {self._port.name!r} has disappeared")

    def _save(self, path: Path) -> None:
        import mido

        with atomic_file(path) as partial:
            mido.MidiFile(type=0, ticks_per_beat=480, tracks=[self._track]).save(partial)
            rename_existing(path)


def _prepare_file(path: Path) -> str:
    """Check that a file can be written, and describe what is.

    Raises:
        OutputError: it cannot be written.
    """
    probe = path.with_name(f".{path.name}.{os.getpid()}.probe")
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"{str(path)!r} cannot be written: {error.strerror or error}; choose another folder"
        ) from error
    renamed = next_free(path)
    kept = "" if renamed is None else f" at the end; the existing file is then renamed to {renamed.name}"
    return f"writes notes to {path}{kept}"


def _open_port(name: str) -> Any:
    import mido

    try:
        if not name:
            return mido.open_output("manytouch", virtual=True)
        names = mido.get_output_names()
    except ImportError:
        raise OutputError(
            "MIDI ports require the package python-rtmidi, which is not installed: run pip install "
            "python-rtmidi, or write a file with midi://take.mid"
        ) from None
    found = next((each for each in names if name.casefold() in each.casefold()), None)
    if found is None:
        raise OutputError(
            f"there is no MIDI port {name!r}; those of this computer: {', '.join(names) or 'none'}"
        )
    return mido.open_output(found)


def _control(channel: int, control: int, value: int) -> Any:
    from mido import Message

    return Message("control_change", channel=channel, control=control, value=value)


def _value(channel: int, place: int, value: int) -> Any:
    """The message of a value of `MpeEncoder._values`."""
    from mido import Message

    if place == 0:
        return Message("pitchwheel", channel=channel, pitch=value)
    if place == 1:
        return _control(channel, TIMBRE, value)
    return Message("aftertouch", channel=channel, value=value)
