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
    camera_messages,
    encode_reading,
    encode_session,
    surface_message,
)
from manytouch.values import Camera, Frame, Reading, Sensor

EACH_MESSAGE = 1  # byte of a chunk, so that every message closes one


def require_mcap() -> None:
    """Check that the packages for recording are installed.

    Raises:
        MissingExtraError: one is not installed.
    """
    try:
        import foxglove_schemas_protobuf  # noqa: F401
        import mcap_protobuf  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("recording", "mcap") from error


@runtime_checkable
class OutputFile(Protocol):
    """The methods of a file that the writer uses."""

    def write(self, data: bytes) -> int: ...

    def flush(self) -> None: ...

    def tell(self) -> int: ...

    def truncate(self, size: int) -> int: ...

    def close(self) -> None: ...


class RecordingWriter:
    """Writes messages into an open file; each call passes all its data to the operating system.

    Errors of the file (OSError) are raised; the file is then valid up to `valid_bytes`.
    """

    def __init__(self, file: OutputFile, *, started_unix_ns: int) -> None:
        """Write the start of the recording.

        Args:
            file: open for writing, at its start.
            started_unix_ns: Unix time at timestamp 0.

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
        self._writer = Writer(
            file,  # type: ignore[arg-type]
            chunk_size=EACH_MESSAGE,
            compression=CompressionType.ZSTD,
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
        self._unwritten_camera: Camera | None = None
        self._first_session: bytes | None = None
        self._last_ns = 0
        self.valid_bytes = 0

    def session(self, sensor: Sensor, about: Mapping[str, Any]) -> None:
        """Write what produces the readings that follow."""
        session = {**about, "started_unix_ns": self._started_ns}
        encoded = encode_session(sensor, session)
        self._first_session = self._first_session or encoded
        self._add(SESSION, encoded, self._started_ns + self._last_ns, 0)
        self._unwritten_camera = sensor.camera

    def frame(self, frame: Frame, encoded: bytes, suffix: str) -> None:
        """Write a frame.

        Args:
            frame: index, time and camera of the frame.
            encoded: JPEG or PNG, empty if the frame has no image.
            suffix: "jpeg" or "png".
        """
        self._last_ns = frame.timestamp_ns
        log_ns = self._started_ns + frame.timestamp_ns
        name = frame.camera.encode(errors="replace").decode()  # of a file it may be no Unicode
        if self._unwritten_camera is not None:
            camera, self._unwritten_camera = self._unwritten_camera, None
            for topic, describe in camera_messages(camera):
                described = describe(camera, name, log_ns).SerializeToString()
                self._add(topic, described, log_ns, frame.index)
        message = self._image(frame_id=name, data=encoded, format=suffix)
        message.timestamp.FromNanoseconds(log_ns)
        self._add(CAMERA, message.SerializeToString(), log_ns, frame.index)

    def reading(self, reading: Reading) -> None:
        """Write the reading of a frame."""
        log_ns = self._started_ns + reading.frame.timestamp_ns
        cloud = surface_message(reading, log_ns).SerializeToString()
        self._add(SURFACE, cloud, log_ns, reading.frame.index)
        self._add(READING, encode_reading(reading), log_ns, reading.frame.index)

    def log(self, sentence: str) -> None:
        """Write a message of the session."""
        log_ns = self._started_ns + self._last_ns
        message = self._log(level=self._log.Level.INFO, message=sentence, name="manytouch")
        message.timestamp.FromNanoseconds(log_ns)
        self._add(LOG, message.SerializeToString(), log_ns, 0)

    def finish(self) -> None:
        """Write the first session again, for the case that its copy is damaged, and the index of the file."""
        if self._first_session is not None:
            self._add(SESSION, self._first_session, self._started_ns + self._last_ns, 0)
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.flush()
        self.valid_bytes = self._file.tell()

    def _add(self, topic: str, data: bytes, log_ns: int, sequence: int) -> None:
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=log_ns,
            publish_time=log_ns,
            data=data,
            sequence=sequence,
        )
        self._file.flush()
        self.valid_bytes = self._file.tell()
