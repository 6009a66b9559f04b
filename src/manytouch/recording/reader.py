"""Reads a recording: an index of its messages, and each when it is asked for.

The file is walked record by record from the front, so one that was cut off is read as far as it is whole.
Only uncompressed files are read, as the writer makes them. The layout of records: https://mcap.dev/spec
"""

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from manytouch.errors import MissingExtraError, SourceError
from manytouch.recording import CAMERA, READING, SESSION
from manytouch.recording.messages import reading_of
from manytouch.recording.packing import unpacked
from manytouch.values import Frame, Reading, Sensor

MAGIC = b"\x89MCAP0\r\n"
_CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x04, 0x05, 0x06, 0x0F
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")


@dataclass(frozen=True, slots=True)
class Place:
    """Where the data of a message lie.

    Attributes:
        offset, length: in the file, bytes.
        sequence: number of the frame.
        log_ns: time of the message.
    """

    offset: int
    length: int
    sequence: int
    log_ns: int


@dataclass(slots=True)
class _Index:
    topics: dict[int, str] = field(default_factory=dict)
    places: dict[str, list[Place]] = field(default_factory=dict)
    is_whole: bool = False


class Recording:
    """A recording on disk.

    Attributes:
        path: the file.
        is_whole: it has its end; else it was cut off, and what is there is read.
        about: of the first session: source, method, parameters, versions.
        sensor: of the first session.
        frames: places of the frames, in order.
    """

    def __init__(self, path: Path) -> None:
        """Walk through a file.

        Raises:
            SourceError: it is none, is compressed, or holds no frame.
            MissingExtraError: the packages for recordings are not installed.
        """
        try:
            from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
        except ImportError as error:
            raise MissingExtraError("replay", "mcap", "record") from error
        self._image = CompressedImage
        self.path = path
        with path.open("rb") as file:
            index = _walked(file, path)
        self.is_whole = index.is_whole
        self.frames = index.places.get(CAMERA, [])
        self.about: dict[str, Any] = json.loads(self._data(_session(index, path)))
        self.sensor: Sensor = unpacked(self.about.pop("sensor"))
        self._started_ns = int(self.about["started_unix_ns"])
        self._readings = {place.sequence: place for place in index.places.get(READING, [])}

    def __len__(self) -> int:
        return len(self.frames)

    def timestamp_ns(self, place: int) -> int:
        """Of the frame at a place, from 0."""
        return self.frames[place].log_ns - self._started_ns

    def was_read(self, place: int) -> bool:
        """Is there a reading of the frame at a place?"""
        return self.frames[place].sequence in self._readings

    def frame(self, place: int) -> Frame:
        """The frame at a place, not yet decoded; without bytes where there was no picture."""
        where = self.frames[place]
        message = self._image.FromString(self._data(where))
        return Frame(
            index=where.sequence,
            timestamp_ns=where.log_ns - self._started_ns,
            camera=message.frame_id,
            image=None,
            encoded=bytes(message.data) or None,
        )

    def reading(self, frame: Frame) -> Reading | None:
        """What was read from a frame when it was recorded; None when it was not read."""
        where = self._readings.get(frame.index)
        return None if where is None else reading_of(self._data(where), frame)

    def _data(self, place: Place) -> bytes:
        with self.path.open("rb") as file:
            file.seek(place.offset)
            return file.read(place.length)


def _session(index: _Index, path: Path) -> Place:
    """The first session's place."""
    sessions = index.places.get(SESSION)
    if not sessions or not index.places.get(CAMERA):
        raise SourceError(
            f"{str(path)!r} holds no frame{'' if index.is_whole else ': it was cut off too early'}; "
            "give a recording of manytouch run --record"
        )
    return sessions[0]


def _walked(file: IO[bytes], path: Path) -> _Index:
    size = file.seek(0, 2)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise SourceError(f"{str(path)!r} is no MCAP file: give a recording of manytouch run --record")
    index, at = _Index(), len(MAGIC)
    while at + _HEAD.size <= size:
        file.seek(at)
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        begin, at = at + _HEAD.size, at + _HEAD.size + length
        if at > size:
            break
        if opcode == _DATA_END:
            index.is_whole = True
            break
        if opcode == _CHUNK:
            head = file.read(_CHUNK_HEAD.size)
            (name_length,) = struct.unpack_from("<I", head, _CHUNK_HEAD.size - 4)
            if name_length:
                raise SourceError(f"{str(path)!r} is compressed: give it as manytouch run --record wrote it")
            _records(file, begin + _CHUNK_HEAD.size + 8, at, index)
        elif opcode in (_CHANNEL, _MESSAGE):
            _records(file, begin - _HEAD.size, at, index)
    return index


def _records(file: IO[bytes], at: int, end: int, index: _Index) -> None:
    """Channels and messages between two places."""
    while at + _HEAD.size <= end:
        file.seek(at)
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        begin, at = at + _HEAD.size, at + _HEAD.size + length
        if opcode == _MESSAGE:
            channel, sequence, log_ns, _ = _MESSAGE_HEAD.unpack(file.read(_MESSAGE_HEAD.size))
            place = Place(begin + _MESSAGE_HEAD.size, length - _MESSAGE_HEAD.size, sequence, log_ns)
            index.places.setdefault(index.topics.get(channel, ""), []).append(place)
        elif opcode == _CHANNEL:
            number, _, topic_length = struct.unpack("<HHI", file.read(8))
            index.topics[number] = file.read(topic_length).decode("utf-8")
