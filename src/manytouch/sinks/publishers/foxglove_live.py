"""Readings for Foxglove and Lichtblick, live over the WebSocket server of the Foxglove SDK.

    /camera     foxglove.CompressedImage    the image as the camera sent it, else JPEG
    /surface    foxglove.PointCloud         the markers, with depth
    /mesh       foxglove.SceneUpdate        the surface as triangles, at most `MESHES_PER_S` per second
    /reading    JSON                        `Reading.to_dict()`
    /calibration, /transform                of the camera, once per second, for clients that come later

The topics, except /mesh, are those of recordings. A message is made only while a client subscribes to it.
"""

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from manytouch.errors import MissingExtraError, OutputError
from manytouch.geometry.surface_sampling import SurfaceSampler, sampler_on
from manytouch.pipeline import Controls
from manytouch.recording import CALIBRATION, CAMERA, READING, SURFACE, TRANSFORM
from manytouch.recording.messages import camera_messages, surface_message
from manytouch.sinks.display_grid import grid_corners
from manytouch.sinks.publishers.address import OutputAddress
from manytouch.sinks.publishers.images import ImageTurns, encoded_image
from manytouch.sinks.recorder import started_unix_ns
from manytouch.values import Layout, Reading, Sensor

PORT = 8765
MESH = "/mesh"
MESHES_PER_S = 5.0
MESH_POINTS = (61, 41)  # along x and y
STATIC_INTERVAL_S = 1.0
COLOUR = (0.55, 0.65, 0.75, 1.0)
WIRE_POINT = np.dtype(
    [("tag", "u1"), ("bytes", "u1"), *((n, k) for c in "xyz" for n, k in ((f"tag_{c}", "u1"), (c, "<f8")))]
)
READING_SCHEMA = {
    "type": "object",
    "title": "manytouch.LiveReading",
    "properties": {
        "frame": {"type": "integer"},
        "time_s": {"type": "number"},
        "status": {"type": "string"},
        "contacts": {"type": "array", "items": {"type": "object"}},
    },
}


class FoxglovePublisher:
    """Serves readings from its construction until `close`.

    Attributes:
        channels: of the server by topic; each states whether a client reads it.
    """

    def __init__(self, address: OutputAddress, controls: Controls) -> None:
        """Start serving.

        Args:
            address: `foxglove://HOST:PORT?images=RATE`; absent: 127.0.0.1, 8765 and `IMAGES_PER_S`. Everyone
                who can reach the address may read; nothing can be changed through it.
            controls: the session.

        Raises:
            ManytouchError: the rate of images is wrong.
            OutputError: the address is not available.
            MissingExtraError: foxglove-sdk is not installed.
        """
        try:
            import foxglove
        except ImportError:
            raise MissingExtraError("Foxglove", "foxglove-sdk", "connect") from None
        self._controls, self._turns = controls, ImageTurns(address)
        self._context = context = foxglove.Context()  # the channels end with it
        port = PORT if address.port is None else address.port
        self._host = address.host or "127.0.0.1"
        self.channels = _channels(context)
        try:
            self._server: Any = foxglove.start_server(
                name="manytouch", host=self._host, port=port, context=context
            )
        except Exception as error:
            raise OutputError(
                f"{address.text!r} is not available ({error}): choose another port, and as host an address "
                "of this computer, such as 127.0.0.1 or 0.0.0.0"
            ) from error
        self._epoch_ns: int | None = None
        self._next_mesh_s = self._next_static_s = 0.0
        self._mesh: _Mesh | None = None

    @property
    def port(self) -> int:
        """The port that is served."""
        return int(self._server.port)

    @property
    def description(self) -> str:
        """The address to open in Foxglove."""
        return f"open the connection ws://{self._host}:{self.port} in Foxglove or Lichtblick"

    def publish(self, reading: Reading) -> None:
        """Send what of a reading is subscribed to."""
        frame, now_s = reading.frame, time.monotonic()
        if self._epoch_ns is None:
            self._epoch_ns = started_unix_ns(frame)
        log_ns = self._epoch_ns + frame.timestamp_ns
        self._log(READING, log_ns, lambda: json.dumps(reading.to_dict()).encode())
        self._log(SURFACE, log_ns, lambda: surface_message(reading, log_ns).SerializeToString())
        if self.channels[CAMERA].has_sinks() and self._turns.take(frame):
            self._log(CAMERA, log_ns, lambda: _image(frame.camera, self._turns.encoded(frame), log_ns))
        layout = reading.surface.layout
        if now_s >= self._next_mesh_s and layout is not None:
            self._next_mesh_s = now_s + 1.0 / MESHES_PER_S
            self._log(MESH, log_ns, lambda: self._mesh_of(layout)(reading, log_ns))
        if now_s >= self._next_static_s:
            self._next_static_s = now_s + STATIC_INTERVAL_S
            camera = self._controls.sensor.camera
            for topic, describe in camera_messages(camera):
                self._log(topic, log_ns, describe(camera, frame.camera, log_ns).SerializeToString)

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def _log(self, topic: str, log_ns: int, make: Callable[[], bytes]) -> None:
        channel = self.channels[topic]
        if channel.has_sinks():
            channel.log(make(), log_time=log_ns)

    def _mesh_of(self, layout: Layout) -> "_Mesh":
        if self._mesh is None or self._mesh.layout is not layout:
            self._mesh = _Mesh(layout)
        return self._mesh


def warm_up(reading: Reading, sensor: Sensor) -> tuple[bytes, ...]:
    """The messages of a reading."""
    layout = sensor.layout
    return (
        json.dumps(reading.to_dict()).encode(),
        bytes(surface_message(reading, 0).SerializeToString()),
        _image(reading.frame.camera, encoded_image(reading.frame), 0),
        *(() if layout is None else (_Mesh(layout)(reading, 0),)),
        *(
            describe(sensor.camera, "", 0).SerializeToString()
            for _, describe in camera_messages(sensor.camera)
        ),
    )


class _Mesh:
    """Makes triangles of surfaces of one layout."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        low, high = grid_corners(layout)
        x_mm, y_mm = (
            np.linspace(begin, end, count) for begin, end, count in zip(low, high, MESH_POINTS, strict=True)
        )
        self._rest_mm = np.stack([*np.meshgrid(x_mm, y_mm), np.zeros(MESH_POINTS[::-1])], axis=-1)
        self._sampler: SurfaceSampler = sampler_on(layout, x_mm, y_mm)
        self._update = _empty_mesh(_triangles(*MESH_POINTS))

    def __call__(self, reading: Reading, log_ns: int) -> bytes:
        moved_mm = np.nan_to_num(self._sampler.displacement(reading.surface))
        update = type(self._update).FromString(self._update.SerializeToString())
        update.entities[0].timestamp.FromNanoseconds(log_ns)
        update.entities[0].triangles[0].MergeFromString(_encoded_points(self._rest_mm + moved_mm))
        return bytes(update.SerializeToString())


def _empty_mesh(triangles: list[int]) -> Any:
    """A SceneUpdate of one mesh without its points."""
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    update = SceneUpdate()
    shape = update.entities.add(frame_id="sheet", id="surface", frame_locked=True).triangles.add()
    shape.pose.orientation.w = 1.0
    shape.color.r, shape.color.g, shape.color.b, shape.color.a = COLOUR
    shape.indices.extend(triangles)
    return update


def _encoded_points(point_mm: np.ndarray) -> bytes:
    """The field `points` of a TriangleListPrimitive for points (..., 3), in the wire format of protobuf.

    Made at once; a thousand calls of `add` would keep the interpreter from the session for 2 ms.
    """
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    shape = SceneUpdate.DESCRIPTOR.fields_by_name["entities"].message_type.fields_by_name["triangles"]
    field = shape.message_type.fields_by_name["points"]
    numbers = [field.message_type.fields_by_name[name].number for name in "xyz"]
    encoded = np.empty(point_mm.size // 3, WIRE_POINT)
    encoded["tag"], encoded["bytes"] = field.number << 3 | 2, WIRE_POINT.itemsize - 2
    for axis, (name, number) in enumerate(zip("xyz", numbers, strict=True)):
        encoded[f"tag_{name}"], encoded[name] = number << 3 | 1, point_mm.reshape(-1, 3)[:, axis]
    return encoded.tobytes()


def _triangles(columns: int, rows: int) -> list[int]:
    """Indices of the corners of two triangles per cell of a grid."""
    place = np.arange(rows * columns).reshape(rows, columns)
    here, right, below, across = place[:-1, :-1], place[:-1, 1:], place[1:, :-1], place[1:, 1:]
    corners = np.stack([here, right, below, right, across, below], axis=-1)
    return [int(corner) for corner in corners.ravel()]


def _image(camera: str, encoded: tuple[bytes, str], log_ns: int) -> bytes:
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

    data, kind = encoded
    message = CompressedImage(frame_id=camera, data=data, format=kind)
    message.timestamp.FromNanoseconds(log_ns)
    return bytes(message.SerializeToString())


def _channels(context: Any) -> dict[str, Any]:
    """A channel per topic, with the schemas of recordings."""
    from foxglove import Channel, Schema
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
    from mcap_protobuf.schema import build_file_descriptor_set

    kinds: dict[str, Any] = {
        CAMERA: CompressedImage,
        SURFACE: PointCloud,
        MESH: SceneUpdate,
        CALIBRATION: CameraCalibration,
        TRANSFORM: FrameTransform,
    }
    found = {
        topic: Channel(
            topic,
            message_encoding="protobuf",
            schema=Schema(
                name=kind.DESCRIPTOR.full_name,
                encoding="protobuf",
                data=build_file_descriptor_set(kind).SerializeToString(),
            ),
            context=context,
        )
        for topic, kind in kinds.items()
    }
    schema = Schema(
        name=str(READING_SCHEMA["title"]), encoding="jsonschema", data=json.dumps(READING_SCHEMA).encode()
    )
    return found | {READING: Channel(READING, message_encoding="json", schema=schema, context=context)}
