"""Records of an MCAP file that may be damaged: which are whole, and where they are.

Every chunk is checked against its CRC, every record against the end of its chunk. After damage the next
whole chunk is searched. Format of the records: https://mcap.dev/spec
"""

import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from manytouch.errors import SourceError
from manytouch.limits import MAX_MESSAGE_BYTES
from manytouch.recording.compression import decompressed

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0F
_LAST_OPCODE = 0x0F
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_FOOTER = struct.Struct("<BQQQI")
_SHORTEST_CHUNK = _CHUNK_HEAD.size + 8
_CHUNK_BEGIN = re.compile(rb"\x06(?=.{36}(?:\x04\0\0\0zstd|\0\0\0\0))", re.DOTALL)
MAX_EFFORT = 4  # times the size of the file
_MAX_CHUNK_BYTES = MAX_MESSAGE_BYTES + 2**20


@dataclass(frozen=True, slots=True)
class ChunkLocation:
    """Position of the content of a chunk in the file, in bytes."""

    begin: int
    end: int


@dataclass(frozen=True, slots=True)
class MessageLocation:
    """Position of the data of a message.

    Attributes:
        chunk: the chunk it is in.
        offset, length: in bytes, in the decompressed chunk.
        sequence: number of the frame.
        log_ns: time of the message.
        publish_ns: as log_ns, for copies.
    """

    chunk: ChunkLocation
    offset: int
    length: int
    sequence: int
    log_ns: int
    publish_ns: int


@dataclass(slots=True)
class Scan:
    """What is whole in a file.

    Attributes:
        schemas: by number: name, encoding, data.
        channels: by number: number of the schema, topic, message encoding.
        messages: by number of the channel, in the order of the file.
        chunks: number of whole chunks.
        damaged: begin and end of what is not whole, in bytes.
        is_complete: whether the end of the data is there; else the file was cut off.
        has_index: whether the index at the end is whole, which other programs use.
    """

    schemas: dict[int, tuple[str, str, bytes]] = field(default_factory=dict)
    channels: dict[int, tuple[int, str, str]] = field(default_factory=dict)
    messages: dict[int, list[MessageLocation]] = field(default_factory=dict)
    chunks: int = 0
    damaged: list[tuple[int, int]] = field(default_factory=list)
    is_complete: bool = False
    has_index: bool = False

    @property
    def sensors(self) -> list[str]:
        """Names of the sensors of a rig, whose topics begin with them; empty for one sensor."""
        topics = (channel[1] for channel in self.channels.values())
        return sorted({topic.split("/")[1] for topic in topics if topic.count("/") == 2})

    def topic(self, name: str) -> list[MessageLocation]:
        """Messages of all channels with a topic."""
        numbers = [number for number, channel in self.channels.items() if channel[1] == name]
        return [message for number in numbers for message in self.messages.get(number, [])]


def scan(path: Path) -> Scan:
    """Check a whole file.

    Raises:
        SourceError: it is not an MCAP file, or it cannot be read.
    """
    found = Scan()
    with opened(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise SourceError(
                f"{str(path)!r} is not an MCAP file: give a recording of manytouch run --record"
            )
        size = file.seek(0, 2)
        content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    with content:
        at, effort_bytes = len(MAGIC), MAX_EFFORT * size
        while at + _HEAD.size <= size:
            end = _next(content, at, size, found)
            if end is None:
                end, effort_bytes = _resume(content, at + 1, size, effort_bytes)
                if end < size or not found.is_complete:
                    _add_damage(found, at, end)
            at = end
        found.has_index = _has_index(content, size)
    if not found.is_complete and found.damaged and found.damaged[-1][1] == size:
        found.damaged.pop()  # a message that was not written to its end
    return found


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """The file, to be read.

    Raises:
        SourceError: instead of any OSError inside.
    """
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise SourceError(
            f"{str(path)!r} cannot be read: {error.strerror or error}; give a file that can be read"
        ) from error


def read_chunk(content: bytes | mmap.mmap, location: ChunkLocation) -> bytes:
    """The decompressed records of a chunk.

    Raises:
        ValueError: it is damaged.
    """
    begin, end = location.begin, location.end
    if end - begin < _SHORTEST_CHUNK or end - begin > _MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {end - begin} bytes")
    head = _CHUNK_HEAD.unpack(content[begin : begin + _CHUNK_HEAD.size])
    size, crc, name_length = head[2], head[3], head[4]
    at = begin + _CHUNK_HEAD.size
    if name_length > 8 or at + name_length + 8 > end:
        raise ValueError("the name of the compression")
    name = bytes(content[at : at + name_length]).decode("ascii")
    (length,) = struct.unpack("<Q", content[at + name_length : at + name_length + 8])
    at += name_length + 8
    if at + length != end:
        raise ValueError("the size of the chunk")
    data = decompressed(name, content[at:end], size)
    if crc != 0 and zlib.crc32(data) != crc:
        raise ValueError("the checksum of the chunk")
    return data


def message_data(path: Path, place: MessageLocation) -> bytes:
    """The data of a message of a file.

    Raises:
        ValueError: the file has changed.
        SourceError: it cannot be read.
    """
    with opened(path) as file:
        file.seek(place.chunk.begin)
        content = file.read(place.chunk.end - place.chunk.begin)
    found = read_chunk(content, ChunkLocation(0, len(content)))
    return found[place.offset : place.offset + place.length]


def records(data: bytes | mmap.mmap, at: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the records between two offsets.

    Raises:
        ValueError: a record reaches beyond the end.
    """
    while at < end:
        if at + _HEAD.size > end:
            raise ValueError("a cut record")
        opcode, length = _HEAD.unpack(data[at : at + _HEAD.size])
        begin, at = at + _HEAD.size, at + _HEAD.size + length
        if at > end:
            raise ValueError(f"a record of {length} bytes")
        yield opcode, begin, at


def _next(content: mmap.mmap, at: int, size: int, found: Scan) -> int | None:
    """Add the record at an offset, and return its end; None if there is no record that could be whole."""
    opcode, length = _HEAD.unpack(content[at : at + _HEAD.size])
    begin, end = at + _HEAD.size, at + _HEAD.size + int(length)
    if not 0 < opcode <= _LAST_OPCODE or end > size:
        return None
    try:
        if opcode == CHUNK:
            location = ChunkLocation(begin, end)
            data = read_chunk(content, location)
            inner = list(records(data, 0, len(data)))
            for each in inner:
                _add(data, each, location, found)
            found.chunks += 1
        elif opcode == DATA_END:
            found.is_complete = True
        elif opcode in (SCHEMA, CHANNEL):  # of the summary; messages without a checksum are not read
            _add(content, (opcode, begin, end), ChunkLocation(begin, end), found)
    except (ValueError, struct.error):
        following = content[end] if end < size else DATA_END
        if opcode == CHUNK and not 0 < following <= _LAST_OPCODE:
            return None  # its length may be damaged
        _add_damage(found, at, end)
    return end


def _add(data: bytes | mmap.mmap, record: tuple[int, int, int], chunk: ChunkLocation, found: Scan) -> None:
    """Add a schema, a channel or a message."""
    opcode, begin, end = record
    if opcode == MESSAGE:
        channel, sequence, log_ns, publish_ns = _MESSAGE_HEAD.unpack(data[begin : begin + _MESSAGE_HEAD.size])
        offset = begin + _MESSAGE_HEAD.size
        if end - offset > MAX_MESSAGE_BYTES:
            raise ValueError("a message that is too long")
        message = MessageLocation(chunk, offset, end - offset, sequence, log_ns, publish_ns)
        found.messages.setdefault(channel, []).append(message)
    elif opcode == CHANNEL:
        number, schema = struct.unpack("<HH", data[begin : begin + 4])
        topic, at = _text(data, begin + 4, end)
        encoding, _ = _text(data, at, end)
        found.channels.setdefault(number, (schema, topic, encoding))
    elif opcode == SCHEMA:
        (number,) = struct.unpack("<H", data[begin : begin + 2])
        name, at = _text(data, begin + 2, end)
        encoding, at = _text(data, at, end)
        (length,) = struct.unpack("<I", data[at : at + 4])
        if at + 4 + length > end:
            raise ValueError("a schema beyond its record")
        found.schemas.setdefault(number, (name, encoding, bytes(data[at + 4 : at + 4 + length])))


def _text(data: bytes | mmap.mmap, at: int, end: int) -> tuple[str, int]:
    """A text with its length before it, and the offset after it."""
    (length,) = struct.unpack("<I", data[at : at + 4])
    at += 4
    if at + length > end:
        raise ValueError("a text beyond its record")
    return bytes(data[at : at + length]).decode("utf-8"), at + length


def _resume(content: mmap.mmap, at: int, size: int, effort_bytes: int) -> tuple[int, int]:
    """Begin of the next whole chunk, or the end of the file; and what is left of the effort.

    The effort is the number of bytes that may be checked in vain, so that no file takes long.
    """
    for match in _CHUNK_BEGIN.finditer(content, at):
        place = match.start()
        _, length = _HEAD.unpack(content[place : place + _HEAD.size])
        end = place + _HEAD.size + length
        if end <= size:
            try:
                read_chunk(content, ChunkLocation(place + _HEAD.size, end))
            except ValueError:
                effort_bytes -= length
                if effort_bytes < 0:
                    break
                continue
            return place, effort_bytes
    return size, effort_bytes


def _has_index(content: mmap.mmap, size: int) -> bool:
    """Whether the footer is there, and its checksum of the summary is right."""
    at = size - len(MAGIC) - _FOOTER.size
    if at < len(MAGIC) or content[size - len(MAGIC) : size] != MAGIC:
        return False
    opcode, length, begin, _, crc = _FOOTER.unpack(content[at : at + _FOOTER.size])
    is_footer = opcode == FOOTER and length == 20 and 0 < begin <= at
    return bool(is_footer and (crc == 0 or zlib.crc32(content[begin : size - len(MAGIC) - 4]) == crc))


def _add_damage(found: Scan, begin: int, end: int) -> None:
    if found.damaged and found.damaged[-1][1] == begin:
        begin = found.damaged.pop()[0]
    found.damaged.append((begin, end))
