"""Writes a recording, message by message."""

import json
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from manytouch.errors import MissingExtraError
from manytouch.recording import (
    CALIBRATION,
    CAMERA,
    LOG,
    PROFILE,
    READING,
    SESSION,
    SURFACE,
    TRANSFORM,
)
from manytouch.recording.messages import (
    READING_SCHEMA,
    SESSION_SCHEMA,
    calibration_message,
    reading_bytes,
    session_bytes,
    surface_message,
    transform_message,
)
from manytouch.values import Camera, Frame, Reading, Sensor

CHUNK = 2**14  # bytes; a frame and its reading are more, so that hardly anything waits in memory
FAST_FPS = 10.0


def require_mcap() -> None:
    """Refuse to record where the packages for it are missing.

    Raises:
        MissingExtraError: they are.
    """
    try:
        import foxglove_schemas_protobuf  # noqa: F401
        import mcap_protobuf  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("recording", "mcap", "record") from error


@runtime_checkable
class OutputFile(Protocol):
    """What is used of a file."""

    def write(self, data: bytes) -> int: ...

    def flush(self) -> None: ...

    def tell(self) -> int: ...

    def truncate(self, size: int) -> int: ...

    def close(self) -> None: ...


class RecordingWriter:
    """Messages into an open file; after each call all of it is with the operating system.

    What the file raises (OSError) goes to the caller; the file is then good up to `whole_bytes`.
    """

    def __init__(self, file: OutputFile, *, started_unix_ns: int, fps: float | None) -> None:
        """Begin.

        Args:
            file: open for writing, at its beginning.
            started_unix_ns: time of day at timestamp 0.
            fps: expected rate; below `FAST_FPS` every message is a chunk of its own.

        Raises:
            MissingExtraError: the packages for recording are not installed.
        """
        require_mcap()
        from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
        from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
        from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
        from foxglove_schemas_protobuf.Log_pb2 import Log
        from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
        from mcap.writer import CompressionType, Writer
        from mcap_protobuf.schema import register_schema

        self._file = file
        self._started_ns = started_unix_ns
        self._image, self._log = CompressedImage, Log
        is_fast = fps is not None and fps >= FAST_FPS
        self._writer = Writer(
            file,  # type: ignore[arg-type]
            chunk_size=CHUNK if is_fast else 1,
            compression=CompressionType.NONE,
        )
        self._writer.start(profile=PROFILE, library="manytouch")
        schemas = {
            topic: register_schema(self._writer, kind)
            for topic, kind in (
                (CAMERA, CompressedImage),
                (SURFACE, PointCloud),
                (LOG, Log),
                (CALIBRATION, CameraCalibration),
                (TRANSFORM, FrameTransform),
            )
        }
        self._channels = {
            topic: self._writer.register_channel(topic=topic, message_encoding="protobuf", schema_id=number)
            for topic, number in schemas.items()
        }
        for topic, schema in ((READING, READING_SCHEMA), (SESSION, SESSION_SCHEMA)):
            number = self._writer.register_schema(
                name=schema["title"], encoding="jsonschema", data=json.dumps(schema).encode()
            )
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding="json", schema_id=number
            )
        self._untold: Camera | None = None
        self._last_ns = 0
        self.whole_bytes = 0

    def session(self, sensor: Sensor, about: Mapping[str, Any]) -> None:
        """What makes the readings that follow."""
        told = {**about, "started_unix_ns": self._started_ns}
        self._add(SESSION, session_bytes(sensor, told), self._started_ns + self._last_ns, 0)
        self._untold = sensor.camera

    def frame(self, frame: Frame, encoded: bytes, suffix: str) -> None:
        """A frame.

        Args:
            frame: its numbers.
            encoded: JPEG or PNG, empty where there is no picture.
            suffix: "jpeg" or "png".
        """
        self._last_ns = frame.timestamp_ns
        log_ns = self._started_ns + frame.timestamp_ns
        if self._untold is not None:
            camera, self._untold = self._untold, None
            for topic, tell in ((CALIBRATION, calibration_message), (TRANSFORM, transform_message)):
                self._add(topic, tell(camera, frame.camera, log_ns).SerializeToString(), log_ns, frame.index)
        message = self._image(frame_id=frame.camera, data=encoded, format=suffix)
        message.timestamp.FromNanoseconds(log_ns)
        self._add(CAMERA, message.SerializeToString(), log_ns, frame.index)

    def reading(self, reading: Reading) -> None:
        """What was read from a frame."""
        log_ns = self._started_ns + reading.frame.timestamp_ns
        cloud = surface_message(reading, log_ns).SerializeToString()
        self._add(SURFACE, cloud, log_ns, reading.frame.index)
        self._add(READING, reading_bytes(reading), log_ns, reading.frame.index)

    def log(self, sentence: str) -> None:
        """Something there is to tell."""
        log_ns = self._started_ns + self._last_ns
        message = self._log(level=self._log.Level.INFO, message=sentence, name="manytouch")
        message.timestamp.FromNanoseconds(log_ns)
        self._add(LOG, message.SerializeToString(), log_ns, 0)

    def finish(self) -> None:
        """Write the index at the end."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.flush()
        self.whole_bytes = self._file.tell()

    def _add(self, topic: str, data: bytes, log_ns: int, sequence: int) -> None:
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=log_ns,
            publish_time=log_ns,
            data=data,
            sequence=sequence % 2**32,
        )
        self._file.flush()
        self.whole_bytes = self._file.tell()
