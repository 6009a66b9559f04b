"""Reads a recording: an index of its messages, and each message on demand."""

import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from manytouch.errors import MissingExtraError, SourceError
from manytouch.limits import MAX_FRAME_INDEX, MAX_FRAME_TIME_NS
from manytouch.recording import CAMERA, READING, SESSION
from manytouch.recording.messages import decode_reading, decode_session
from manytouch.recording.records import ChunkLocation, MessageLocation, opened, read_chunk, scan
from manytouch.values import (
    Contacts,
    Detections,
    Frame,
    Layout,
    Reading,
    Sensor,
    Status,
    Surface,
    TrackedGrid,
)

MOST_LOST_FRAMES = 100_000


@dataclass(frozen=True, slots=True)
class FramePlace:
    """A recorded frame.

    Attributes:
        sequence: its number.
        timestamp_ns: its time, from the start of the recording.
        location: of its message; None where that is damaged.
    """

    sequence: int
    timestamp_ns: int
    location: MessageLocation | None


class Recording:
    """A recording on disk.

    A damaged part of the file costs what is in it: frames in it have no image, and readings in it have the
    status `decode_error`. Where frames were not processed before such a part, theirs have it too.

    Attributes:
        path: the file.
        rig_sensor: which sensor of a rig it is; None for the recording of one sensor.
        is_complete: whether the file was closed; a truncated file is read up to its last whole message.
        about: of the first session: source, method, parameters, versions.
        sensor: of the first session.
        method: of all sessions; None where it was changed.
        started_unix_ns: time of timestamp 0.
        frames: in order, also those that are damaged.
        damaged_bytes: size of what is not whole.
        damaged_frames: number of frames that are lost with it.
        damaged_readings: number of readings of other frames that are lost with it.
    """

    def __init__(self, path: Path, sensor: str | None = None) -> None:
        """Check and index a file.

        Args:
            path: the file.
            sensor: which sensor of the recording of a rig.

        Raises:
            SourceError: the sensor is not in it, or none is given for a rig; it is not an MCAP
                file or cannot be read, no session or no frame in it is whole, or the number of a frame is too
                large.
            MissingExtraError: the packages for recordings are not installed.
        """
        try:
            import zstandard  # noqa: F401
            from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
        except ImportError as error:
            raise MissingExtraError("playback", "mcap") from error
        self._image = CompressedImage
        self.path, self.rig_sensor = path, sensor
        found = scan(path)
        prefix = _prefix(path, found.sensors, sensor)
        self.is_complete = found.is_complete
        self.damaged_bytes = sum(end - begin for begin, end in found.damaged)
        self._cached: tuple[ChunkLocation | None, bytes] = (None, b"")
        sessions = self._sessions(found.topic(prefix + SESSION))
        self.sensor, self.about = sessions[0]
        methods = {about.get("method") for _, about in sessions}
        self.method: str | None = methods.pop() if len(methods) == 1 else None
        self.started_unix_ns: int = self.about["started_unix_ns"]
        camera, readings = (self._by_sequence(found.topic(prefix + each)) for each in (CAMERA, READING))
        if not camera:
            raise self._is_empty()
        self._readings = {place.sequence: place for place in readings}
        lost = _lost_frames(camera, found.damaged)
        self.frames: Sequence[FramePlace] = sorted([*camera, *lost], key=lambda place: place.sequence)
        lost_readings = _lost_readings(camera, readings, found.damaged)
        self._lost = {place.sequence for place in lost} | lost_readings
        self.damaged_frames, self.damaged_readings = len(lost), len(lost_readings)

    def __len__(self) -> int:
        return len(self.frames)

    def timestamp_ns(self, position: int) -> int:
        """Time of the frame at a position, from the start of the recording."""
        return self.frames[position].timestamp_ns

    def has_reading(self, position: int) -> bool:
        """Whether the frame at a position was processed, or it or its reading is damaged."""
        sequence = self.frames[position].sequence
        return sequence in self._readings or sequence in self._lost

    def frame(self, position: int) -> Frame:
        """The frame at a position, not yet decoded; without bytes if it had no image, or is damaged."""
        place, camera, encoded = self.frames[position], "", None
        if place.location is not None:
            try:
                message = self._image.FromString(self._data(place.location))
                camera, encoded = str(message.frame_id), bytes(message.data) or None
            except Exception:  # noqa: BLE001 - of protobuf, whose types depend on its implementation
                encoded = None
        return Frame(
            index=place.sequence,
            timestamp_ns=place.timestamp_ns,
            camera=camera,
            image=None,
            encoded=encoded,
        )

    def reading(self, frame: Frame) -> Reading | None:
        """The recorded reading of a frame; None if the frame was not processed.

        A damaged one has the status `decode_error`.
        """
        layout = self.sensor.layout
        place = self._readings.get(frame.index)
        if place is None:
            is_lost = frame.index in self._lost
            return _damaged_reading(frame, layout) if is_lost and layout is not None else None
        try:
            return decode_reading(self._message(place), frame, layout)
        except (SourceError, ValueError):
            return None if layout is None else _damaged_reading(frame, layout)

    def bad_readings(self) -> Iterator[int]:
        """Numbers of the frames whose readings have the right checksum and cannot be read."""
        for number, place in self._readings.items():
            frame = Frame(index=number, timestamp_ns=place.timestamp_ns, camera="", image=None)
            try:
                decode_reading(self._message(place), frame, self.sensor.layout)
            except (SourceError, ValueError):
                yield number

    @property
    def damage(self) -> str | None:
        """A sentence about what is not whole, or None."""
        if self.damaged_bytes == 0:
            return (
                None
                if self.is_complete
                else f"{self.path.name} was cut off; its {len(self)} whole frames are replayed"
            )
        lost = f", and {self.damaged_frames} of {len(self)} frames are lost" if self.damaged_frames else ""
        lost += f", and the readings of {self.damaged_readings} frames" if self.damaged_readings else ""
        cut = "" if self.is_complete else ", and it was cut off"
        return f"{self.damaged_bytes} bytes of {self.path.name} are damaged{lost}{cut}; the rest is replayed"

    def _sessions(self, locations: Sequence[MessageLocation]) -> list[tuple[Sensor, dict[str, Any]]]:
        """Sensor and properties of each session that is whole; at least one."""
        errors: list[SourceError] = []
        sessions: list[tuple[Sensor, dict[str, Any]]] = []
        for location in locations:
            try:
                sessions.append(decode_session(self._data(location)))
            except SourceError as error:
                errors.append(error)
        if sessions:
            return sessions
        if errors:
            raise SourceError(f"{str(self.path)!r} cannot be replayed: {errors[0]}") from errors[0]
        raise self._is_empty()

    def _is_empty(self) -> SourceError:
        why = "" if self.is_complete else ", because it is truncated"
        why = ", because it is damaged" if self.damaged_bytes else why
        return SourceError(
            f"{str(self.path)!r} contains no frame with its session{why}; give a recording of manytouch run "
            "--record"
        )

    def _by_sequence(self, locations: Sequence[MessageLocation]) -> list[FramePlace]:
        """One place per number; the first of several."""
        found: dict[int, FramePlace] = {}
        for location in locations:
            if location.sequence > MAX_FRAME_INDEX:
                raise SourceError(
                    f"{str(self.path)!r} has a frame with the number {location.sequence}, larger than "
                    f"{MAX_FRAME_INDEX}: record it again, with numbers from 0"
                )
            timestamp_ns = location.log_ns - self.started_unix_ns
            if abs(timestamp_ns) < MAX_FRAME_TIME_NS:
                found.setdefault(location.sequence, FramePlace(location.sequence, timestamp_ns, location))
        return sorted(found.values(), key=lambda place: place.sequence)

    def _message(self, place: FramePlace) -> bytes:
        return b"" if place.location is None else self._data(place.location)

    def _data(self, location: MessageLocation) -> bytes:
        """The data of a message; ValueError where the file has changed."""
        chunk, data = self._cached
        if chunk != location.chunk:
            begin = location.chunk.begin
            with opened(self.path) as file:
                file.seek(begin)
                content = file.read(location.chunk.end - begin)
            data = read_chunk(content, ChunkLocation(0, len(content)))
            self._cached = location.chunk, data
        return data[location.offset : location.offset + location.length]


def open_recording(path: Path) -> Recording:
    """The recording at a path; a sensor of a rig as in hand.mcap#index.

    Raises:
        SourceError: the file does not exist; see also `Recording`.
    """
    bare, mark, sensor = str(path).rpartition("#")
    if path.is_file() or not mark:
        bare, sensor = str(path), ""
    if not Path(bare).is_file():
        raise SourceError(
            f"{bare!r} is not a file: give recordings (.mcap), of a rig with the name of a sensor, such as "
            "hand.mcap#index"
        )
    return Recording(Path(bare), sensor or None)


def _prefix(path: Path, sensors: Sequence[str], sensor: str | None) -> str:
    """Start of the topics of one sensor of a rig; empty for the recording of a single sensor."""
    if sensor is None and not sensors:
        return ""
    if sensor in sensors:
        return f"/{sensor}"
    if not sensors:
        raise SourceError(f"{str(path)!r} is the recording of one sensor: omit #{sensor}")
    raise SourceError(
        f"{str(path)!r} has the sensors {', '.join(sensors)}: give one as in {path.name}#{sensors[0]}"
    )


def _lost_frames(camera: Sequence[FramePlace], damaged: Sequence[tuple[int, int]]) -> list[FramePlace]:
    """Frames whose numbers are absent where the file is damaged, evenly timed between their neighbours."""
    found: list[FramePlace] = []
    for before, after in pairwise(camera):
        missing = after.sequence - before.sequence - 1
        if before.location is None or after.location is None:
            continue
        begin, end = sorted((before.location.chunk.end, after.location.chunk.begin))
        is_damaged = any(begin <= at < end for at, _ in damaged)
        if is_damaged and missing > 0 and len(found) + missing <= MOST_LOST_FRAMES:
            step_ns = (after.timestamp_ns - before.timestamp_ns) / (missing + 1)
            found += [
                FramePlace(before.sequence + k, before.timestamp_ns + round(k * step_ns), None)
                for k in range(1, missing + 1)
            ]
    return found


def _lost_readings(
    camera: Sequence[FramePlace], readings: Sequence[FramePlace], damaged: Sequence[tuple[int, int]]
) -> set[int]:
    """Numbers of frames without reading, where the file is damaged between the readings before and after."""
    numbers, damaged_at = [place.sequence for place in readings], [begin for begin, _ in damaged]
    found: set[int] = set()
    for place in camera if damaged else ():
        following = bisect_left(numbers, place.sequence)
        if following < len(numbers) and numbers[following] == place.sequence:
            continue
        begin = max(_end_of(place), _end_of(readings[following - 1]) if following else 0)
        end = _end_of(readings[following]) if following < len(readings) else math.inf
        first, last = sorted((begin, end))
        if bisect_left(damaged_at, first) < bisect_left(damaged_at, last):
            found.add(place.sequence)
    return found


def _end_of(place: FramePlace) -> int:
    """End of the chunk of a message in the file, in bytes."""
    return 0 if place.location is None else place.location.chunk.end


def _damaged_reading(frame: Frame, layout: Layout) -> Reading:
    """A reading of a frame that cannot be read."""
    markers = len(layout.rest_mm)
    nothing = np.full((markers, 3), np.nan)
    return Reading(
        frame=frame,
        detections=Detections(
            centre_px=np.empty((0, 2)),
            covariance_px2=np.empty((0, 2, 2)),
            area_px2=np.empty(0),
            contrast=np.empty(0),
            status=Status.DECODE_ERROR,
        ),
        grid=TrackedGrid(
            position_px=np.full((markers, 2), np.nan),
            covariance_px2=np.full((markers, 2, 2), np.nan),
            is_seen=np.zeros(markers, dtype=np.bool_),
            frames_unseen=np.ones(markers, dtype=np.int64),
            status=Status.DECODE_ERROR,
            timestamp_ns=frame.timestamp_ns,
        ),
        surface=Surface(
            position_mm=nothing,
            displacement_mm=nothing,
            covariance_mm2=np.full((markers, 3, 3), np.nan),
            layout=layout,
            status=Status.DECODE_ERROR,
        ),
        contacts=Contacts(status=Status.DECODE_ERROR),
        milliseconds=0.0,
    )
