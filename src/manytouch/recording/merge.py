"""Joins the recordings of several sensors to one, with channels of its own for each sensor."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import merge
from pathlib import Path

from manytouch.recording import PROFILE
from manytouch.recording.records import MessageLocation, Scan, message_data, scan
from manytouch.recording.writer import EACH_MESSAGE, require_mcap


@dataclass(frozen=True, slots=True)
class _Part:
    """A recording of one sensor, or its continuation after a restart.

    Attributes:
        name: of the sensor.
        path: the file.
        found: what is whole in it.
        first: what is added to the numbers of its frames.
    """

    name: str
    path: Path
    found: Scan
    first: int


def topic_of(sensor: str, topic: str) -> str:
    """Topic of a sensor of a rig, such as /thumb/camera."""
    return f"/{sensor}{topic}"


def merge_recordings(parts: Mapping[str, Sequence[Path]], merged: Path) -> int:
    """Write all whole messages of recordings into one file, in the order of their times.

    Args:
        parts: recordings of each sensor, by its name, in the order of their times; frames of later ones
            are numbered after those of the earlier.
        merged: the file to write.

    Returns:
        The number of messages.

    Raises:
        SourceError: a part is not an MCAP file.
        MissingExtraError: the packages for recordings are not installed.
        OSError: the file cannot be written.
    """
    require_mcap()
    from mcap.writer import CompressionType, Writer

    count = 0
    with merged.open("wb") as file:
        writer = Writer(file, chunk_size=EACH_MESSAGE, compression=CompressionType.ZSTD)
        writer.start(profile=PROFILE, library="manytouch")
        schemas: dict[tuple[str, str, bytes], int] = {}
        channels: dict[str, int] = {}
        for part, number, message in _in_order(_numbered(parts)):
            schema, topic, encoding = part.found.channels[number]
            full = topic_of(part.name, topic)
            if full not in channels:
                described = part.found.schemas[schema]
                if described not in schemas:
                    name, kind, data = described
                    schemas[described] = writer.register_schema(name=name, encoding=kind, data=data)
                channels[full] = writer.register_channel(
                    topic=full, message_encoding=encoding, schema_id=schemas[described]
                )
            writer.add_message(
                channel_id=channels[full],
                log_time=message.log_ns,
                publish_time=message.publish_ns,
                data=message_data(part.path, message),
                sequence=part.first + message.sequence,
            )
            count += 1
        writer.finish()  # type: ignore[no-untyped-call]
    return count


def _numbered(parts: Mapping[str, Sequence[Path]]) -> Iterator[_Part]:
    for name, paths in parts.items():
        first = 0
        for path in paths:
            found = scan(path)
            yield _Part(name, path, found, first)
            numbers = [place.sequence for places in found.messages.values() for place in places]
            first += max(numbers, default=-1) + 1


def _in_order(parts: Iterator[_Part]) -> Iterator[tuple[_Part, int, MessageLocation]]:
    """All messages by time; those of one part with one time as they are in its file."""

    def messages(part: _Part) -> list[tuple[int, int, int, int, _Part, int, MessageLocation]]:
        return sorted(
            (
                (place.log_ns, id(part), place.chunk.begin, place.offset, part, number, place)
                for number, places in part.found.messages.items()
                if number in part.found.channels and part.found.channels[number][0] in part.found.schemas
                for place in places
            ),
            key=lambda each: each[:4],
        )

    for entry in merge(*(messages(part) for part in parts), key=lambda each: each[:4]):
        yield entry[4], entry[5], entry[6]
