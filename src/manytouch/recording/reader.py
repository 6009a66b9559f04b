"""Reads a recording: an index of its messages, and each message on demand.

The file is scanned record by record from its start, so a truncated file is read up to its last whole record.
Only uncompressed files are read, as the writer makes them. Format of the records: https://mcap.dev/spec
"""

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from manytouch.errors import MissingExtraError, SourceError
from manytouch.recording import CAMERA, READING, SESSION
from manytouch.recording.json_codec import from_json
from manytouch.recording.messages import decode_reading
from manytouch.values import Frame, Reading, Sensor

MAGIC = b"\x89MCAP0\r\n"
_CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x04, 0x05, 0x06, 0x0F
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")


@dataclass(frozen=True, slots=True)
class MessageLocation:
    """Position of the data of a message in the file.

    Attributes:
        offset, length: in bytes.
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
    locations: dict[str, list[MessageLocation]] = field(default_factory=dict)
    is_complete: bool = False


class Recording:
    """A recording on disk.

    Attributes:
        path: the file.
        is_complete: whether the file was closed; a truncated file is read up to its last complete message.
        about: of the first session: source, method, parameters, versions.
        sensor: of the first session.
        frames: locations of the frames, in order.
    """

    def __init__(self, path: Path) -> None:
        """Index a file.

        Raises:
            SourceError: it is not an MCAP file, is compressed, or contains no frame.
            MissingExtraError: the packages for recordings are not installed.
        """
        try:
            from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
        except ImportError as error:
            raise MissingExtraError("playback", "mcap", "record") from error
        self._image = CompressedImage
        self.path = path
        with path.open("rb") as file:
            index = _index(file, path)
        self.is_complete = index.is_complete
        self.frames = index.locations.get(CAMERA, [])
        self.about: dict[str, Any] = json.loads(self._data(_session(index, path)))
        self.sensor: Sensor = from_json(self.about.pop("sensor"))
        self._started_ns = int(self.about["started_unix_ns"])
        self._readings = {location.sequence: location for location in index.locations.get(READING, [])}

    def __len__(self) -> int:
        return len(self.frames)

    def timestamp_ns(self, position: int) -> int:
        """Time of the frame at a position, from the start of the recording."""
        return self.frames[position].log_ns - self._started_ns

    def has_reading(self, position: int) -> bool:
        """Whether the frame at a position was processed."""
        return self.frames[position].sequence in self._readings

    def frame(self, position: int) -> Frame:
        """The frame at a position, not yet decoded; without bytes if it had no image."""
        location = self.frames[position]
        message = self._image.FromString(self._data(location))
        return Frame(
            index=location.sequence,
            timestamp_ns=location.log_ns - self._started_ns,
            camera=message.frame_id,
            image=None,
            encoded=bytes(message.data) or None,
        )

    def reading(self, frame: Frame) -> Reading | None:
        """The recorded reading of a frame; None if the frame was not processed."""
        location = self._readings.get(frame.index)
        return None if location is None else decode_reading(self._data(location), frame, self.sensor.layout)

    def _data(self, location: MessageLocation) -> bytes:
        with self.path.open("rb") as file:
            file.seek(location.offset)
            return file.read(location.length)


def _session(index: _Index, path: Path) -> MessageLocation:
    """Location of the first session."""
    sessions = index.locations.get(SESSION)
    if not sessions or not index.locations.get(CAMERA):
        raise SourceError(
            f"{str(path)!r} contains no frame{'' if index.is_complete else ', because it is truncated'}; "
            "give a recording of manytouch run --record"
        )
    return sessions[0]


def _index(file: IO[bytes], path: Path) -> _Index:
    size = file.seek(0, 2)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise SourceError(f"{str(path)!r} is not an MCAP file: give a recording of manytouch run --record")
    index, at = _Index(), len(MAGIC)
    while at + _HEAD.size <= size:
        file.seek(at)
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        begin, at = at + _HEAD.size, at + _HEAD.size + length
        if at > size:
            break
        if opcode == _DATA_END:
            index.is_complete = True
            break
        if opcode == _CHUNK:
            head = file.read(_CHUNK_HEAD.size)
            (name_length,) = struct.unpack_from("<I", head, _CHUNK_HEAD.size - 4)
            if name_length:
                raise SourceError(
                    f"{str(path)!r} is compressed: give the file that manytouch run --record wrote"
                )
            _add_records(file, begin + _CHUNK_HEAD.size + 8, at, index)
        elif opcode in (_CHANNEL, _MESSAGE):
            _add_records(file, begin - _HEAD.size, at, index)
    return index


def _add_records(file: IO[bytes], at: int, end: int, index: _Index) -> None:
    """Add the channels and messages between two offsets to an index."""
    while at + _HEAD.size <= end:
        file.seek(at)
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        begin, at = at + _HEAD.size, at + _HEAD.size + length
        if opcode == _MESSAGE:
            channel, sequence, log_ns, _ = _MESSAGE_HEAD.unpack(file.read(_MESSAGE_HEAD.size))
            location = MessageLocation(
                begin + _MESSAGE_HEAD.size, length - _MESSAGE_HEAD.size, sequence, log_ns
            )
            index.locations.setdefault(index.topics.get(channel, ""), []).append(location)
        elif opcode == _CHANNEL:
            number, _, topic_length = struct.unpack("<HHI", file.read(8))
            index.topics[number] = file.read(topic_length).decode("utf-8")
