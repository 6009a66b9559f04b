"""Check of a recording, and a copy of all that is whole in it."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from manytouch.errors import SourceError
from manytouch.recording import CAMERA, PROFILE, READING, SESSION
from manytouch.recording.messages import decode_session
from manytouch.recording.reader import Recording
from manytouch.recording.records import MessageLocation, Scan, message_data, scan
from manytouch.recording.writer import EACH_MESSAGE, require_mcap

MOST_LISTED = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class RepairReport:
    """What of a recording is whole.

    Attributes:
        bytes: size of the file.
        is_complete: whether its end is there; else it was cut off.
        has_index: whether the index at its end is whole.
        damaged: begin and end of damaged parts, in bytes.
        messages: number of whole messages by topic.
        sensors: names of the sensors of a rig; none for the recording of one sensor.
        lost_frames, lost_readings: number of frames, and of readings of other frames, in damaged parts.
        bad_readings: number of readings that have a right checksum and wrong content.
        problem: why it cannot be replayed, or None.
    """

    bytes: int
    is_complete: bool
    has_index: bool
    damaged: tuple[tuple[int, int], ...]
    messages: dict[str, int]
    sensors: tuple[str, ...]
    lost_frames: int
    lost_readings: int
    bad_readings: int
    problem: str | None

    @property
    def is_whole(self) -> bool:
        """Whether nothing is missing or damaged."""
        has_damage = self.damaged or self.lost_frames or self.bad_readings or self.problem
        return self.is_complete and self.has_index and not has_damage

    def lines(self) -> Iterator[str]:
        """The report as text."""
        yield f"{self.bytes} bytes, {'closed' if self.is_complete else 'cut off: it has no end'}"
        if self.is_complete and not self.has_index:
            yield "its index is damaged: other programs may not open it"
        if self.sensors:
            yield f"the recording of a rig with the sensors {', '.join(self.sensors)}"
        for topic, count in sorted(self.messages.items()):
            yield f"{topic}: {count} whole messages"
        for begin, end in self.damaged[:MOST_LISTED]:
            yield f"damaged: bytes {begin} to {end}"
        if len(self.damaged) > MOST_LISTED:
            yield f"damaged: {len(self.damaged) - MOST_LISTED} more parts"
        if self.lost_frames:
            yield f"lost: {self.lost_frames} frames"
        if self.lost_readings:
            yield f"lost: the readings of {self.lost_readings} frames"
        if self.bad_readings:
            yield f"{self.bad_readings} readings cannot be read"
        if self.problem:
            yield self.problem


def check(path: Path) -> RepairReport:
    """Check every chunk, message and reading of a recording.

    Raises:
        SourceError: it is not an MCAP file.
        MissingExtraError: the packages for recordings are not installed.
    """
    require_mcap()
    found = scan(path)
    counts = Counter({channel[1]: 0 for channel in found.channels.values()})
    for number, messages in found.messages.items():
        topic = found.channels[number][1] if number in found.channels else "unknown topic"
        counts[topic] += len(messages)
    lost = lost_readings = bad = 0
    problems: list[str] = []
    sensors: list[str | None] = [*found.sensors] or [None]
    for sensor in sensors:
        try:
            recording = Recording(path, sensor)
        except SourceError as error:
            problems.append(str(error) if sensor is None else f"{sensor}: {error}")
        else:
            lost += recording.damaged_frames
            lost_readings += recording.damaged_readings
            bad += sum(1 for _ in recording.bad_readings())
    return RepairReport(
        bytes=path.stat().st_size,
        is_complete=found.is_complete,
        has_index=found.has_index,
        damaged=tuple(found.damaged),
        messages=dict(counts),
        sensors=tuple(found.sensors),
        lost_frames=lost,
        lost_readings=lost_readings,
        bad_readings=bad,
        problem="; ".join(problems) or None,
    )


def repair(path: Path, repaired: Path) -> int:
    """Write a copy with an index, of all whole messages of a recording.

    Args:
        path: the recording, also one that was cut off.
        repaired: the file to write.

    Returns:
        The number of messages that were copied.

    Raises:
        SourceError: it is not an MCAP file, or no frame or no session in it is whole.
        MissingExtraError: the packages for recordings are not installed.
        OSError: the copy cannot be written.
    """
    require_mcap()
    from mcap.writer import CompressionType, Writer

    found = scan(path)
    prefixes = [f"/{sensor}" for sensor in found.sensors] or [""]
    sessions = [first for prefix in prefixes if (first := _first_session(path, found, prefix)) is not None]
    if not sessions:
        raise SourceError(
            f"nothing of {str(path)!r} can be saved: no frame or no session with the sensor in it is whole"
        )
    copied = 0
    with repaired.open("wb") as file:
        writer = Writer(file, chunk_size=EACH_MESSAGE, compression=CompressionType.ZSTD)
        writer.start(profile=PROFILE, library="manytouch")
        schemas = {0: 0}
        for number, (name, encoding, data) in sorted(found.schemas.items()):
            schemas[number] = writer.register_schema(name=name, encoding=encoding, data=data)
        channels = {
            number: writer.register_channel(topic=topic, message_encoding=encoding, schema_id=schemas[schema])
            for number, (schema, topic, encoding) in sorted(found.channels.items())
            if schema in schemas
        }
        for number, message in _in_order(found, sessions, prefixes):
            if number in channels:
                writer.add_message(
                    channel_id=channels[number],
                    log_time=message.log_ns,
                    publish_time=message.publish_ns,
                    data=message_data(path, message),
                    sequence=message.sequence,
                )
                copied += 1
        writer.finish()  # type: ignore[no-untyped-call]
    return copied


def _first_session(path: Path, found: Scan, prefix: str) -> MessageLocation | None:
    """The first whole session of a sensor that has a whole frame."""
    if not found.topic(prefix + CAMERA):
        return None
    return next((place for place in found.topic(prefix + SESSION) if _is_session(path, place)), None)


def _in_order(
    found: Scan, first: Sequence[MessageLocation], prefixes: Sequence[str]
) -> Iterator[tuple[int, MessageLocation]]:
    """Number of the channel and place of all messages: sessions first, then as they are in the file."""
    everything = [(number, place) for number, places in found.messages.items() for place in places]
    begin = {(place.chunk.begin, place.offset) for place in first}
    everything.sort(
        key=lambda each: (
            (each[1].chunk.begin, each[1].offset) not in begin,
            each[1].chunk.begin,
            each[1].offset,
        )
    )
    once_per_frame = {prefix + topic for prefix in prefixes for topic in (CAMERA, READING)}
    frames: set[tuple[int, int]] = set()
    for number, place in everything:
        is_per_frame = number in found.channels and found.channels[number][1] in once_per_frame
        if is_per_frame and (number, place.sequence) in frames:
            continue
        frames.add((number, place.sequence))
        yield number, place


def _is_session(path: Path, place: MessageLocation) -> bool:
    try:
        decode_session(message_data(path, place))
    except SourceError:
        return False
    return True
