"""ROS 2 messages of a reading.

NAME/wrench             geometry_msgs/WrenchStamped    sum of all contacts, about the origin of the sheet
NAME/contacts           sensor_msgs/PointCloud2        a point per contact, fields `CONTACT_FIELDS`
NAME/surface            sensor_msgs/PointCloud2        a point per marker: x, y, z, depth, pressure
NAME/contact_markers    visualization_msgs/MarkerArray an arrow per contact along its force
NAME/image/compressed   sensor_msgs/CompressedImage    the camera's JPEG or PNG; else JPEG, in bags PNG
NAME/camera_info        sensor_msgs/CameraInfo
/diagnostics            diagnostic_msgs/DiagnosticArray
/tf_static              tf2_msgs/TFMessage             NAME_camera to NAME_sheet, and a parent to NAME_camera
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.errors import MissingExtraError
from manytouch.geometry.camera import camera_matrix
from manytouch.geometry.surface_sampling import SurfaceSampler, sampler_at
from manytouch.sinks.ros2.prepared import (
    FILLER,
    PreparedCloud,
    with_last_bytes,
    with_stamp,
    without_last_length,
)
from manytouch.values import ESTIMATES, Contact, Health, Phase, Reading, Sensor, Status

M_PER_MM, PA_PER_KPA = 1e-3, 1e3
STDS_TO_SI = {
    **dict.fromkeys(("x", "y", "depth"), M_PER_MM),
    **dict.fromkeys(("normal_force", "shear_x", "shear_y"), 1.0),
    **{"torque": M_PER_MM, "area": M_PER_MM**2},
}
STD_PLACES = [ESTIMATES.index(name) for name in STDS_TO_SI]
STD_FACTORS = np.array(list(STDS_TO_SI.values()))
CONTACT_FIELDS = (
    *("x", "y", "z", "depth", "fx", "fy", "fz", "torque", "area"),
    *(f"{name}_std" for name in STDS_TO_SI),
)
SURFACE_FIELDS = ("x", "y", "z", "depth", "pressure")
CONTACT_POINT = np.dtype([("id", "<u4"), ("phase", "<u4"), *((name, "<f4") for name in CONTACT_FIELDS)])
SURFACE_POINT = np.dtype([(name, "<f4") for name in SURFACE_FIELDS])
PHASES = {Phase.START: 0, Phase.MOVE: 1, Phase.END: 2}
ARROW_M_PER_N, ARROW_SHAFT_M, ARROW_HEAD_M = 0.01, 0.001, 0.002
UINT32, FLOAT32 = 6, 7  # sensor_msgs/PointField
UNKNOWN_SCALE = (
    "lengths are not in metres: a pitch is published as 0.001, since the scale of the sensor is not known "
    "(--pitch-mm or a sensor file states it)"
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RosMessage:
    """A message and its topic.

    Attributes:
        topic: name with a leading "/".
        type: such as "geometry_msgs/msg/WrenchStamped".
        cdr: the message, serialized.
    """

    topic: str
    type: str
    cdr: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """Pose of the sheet in another frame: x_parent = R x_sheet + t.

    Attributes:
        parent: name of the frame.
        translation_mm, rotation_vector: t, and R in rad (Rodrigues).
    """

    parent: str
    translation_mm: tuple[float, ...]
    rotation_vector: tuple[float, ...]


@cache
def typestore() -> Any:
    """Message types of ROS 2 Jazzy.

    Raises:
        MissingExtraError: rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("ROS 2", "rosbags", "connect") from None
    return get_typestore(Stores.ROS2_JAZZY)


class RosMessages:
    """Makes the messages of one sensor."""

    def __init__(self, sensor: Sensor, name: str = "manytouch", mount: Mount | None = None) -> None:
        """Prepare.

        Args:
            sensor: with its layout.
            name: of the topics and frames.
            mount: pose of the sheet in another frame.
        """
        self.sensor = sensor
        self._mount = mount
        self._name = name
        self._types = typestore().types
        self._clouds: dict[tuple[str, int], PreparedCloud] = {}
        self._headings: dict[str, bytes] = {}
        self._camera_info: bytes | None = None
        self._sampler: SurfaceSampler | None = None
        layout = sensor.layout
        if layout is not None:
            self._sampler = sampler_at(layout, np.ascontiguousarray(layout.rest_mm[:, :2]))

    def topic(self, name: str) -> str:
        """Name of a topic of this sensor."""
        return f"/{self._name}/{name}"

    def wrench(self, reading: Reading, stamp_ns: int) -> RosMessage:
        """Resultant of all contacts that are present; NaN where a force is unknown."""
        force_N, torque_Nmm = np.zeros(3), np.zeros(3)
        for contact in reading.contacts.touching:
            x_mm, y_mm = contact.centre_mm
            force_N += contact.force_N
            x_N, y_N, z_N = contact.force_N
            torque_Nmm += (y_mm * z_N, -x_mm * z_N, x_mm * y_N - y_mm * x_N + contact.torque_Nmm)
        wrench = self._new(
            "geometry_msgs/msg/Wrench",
            force=self._vector(force_N),
            torque=self._vector(torque_Nmm * M_PER_MM),
        )
        return self._stamped("wrench", "geometry_msgs/msg/WrenchStamped", stamp_ns, wrench=wrench)

    def contacts(self, reading: Reading, stamp_ns: int) -> RosMessage:
        """The contacts as points, also those that just ended."""
        contacts = reading.contacts.contacts
        rows = [(each.id, PHASES[each.phase], *_contact_numbers(each)) for each in contacts]
        return self._cloud("contacts", np.array(rows, CONTACT_POINT), stamp_ns)

    def surface(self, reading: Reading, stamp_ns: int) -> RosMessage:
        """The markers in the sheet frame, with depth, and pressure where the method estimates it."""
        surface = reading.surface
        points = np.empty((len(surface.position_mm), len(SURFACE_FIELDS)), "<f4")
        np.multiply(surface.position_mm, M_PER_MM, out=points[:, :3], casting="same_kind")
        np.multiply(surface.displacement_mm[:, 2], -M_PER_MM, out=points[:, 3], casting="same_kind")
        points[:, 4] = np.nan
        if self._sampler is not None and surface.spline is not None:
            points[:, 4] = self._sampler.pressure_kPa(surface) * PA_PER_KPA
        return self._cloud("surface", points.view(SURFACE_POINT)[:, 0], stamp_ns)

    def markers(self, reading: Reading, stamp_ns: int) -> RosMessage:
        """An arrow per contact for rviz, which lasts until the next message."""
        header = self._header(stamp_ns, "sheet")
        markers = [self._marker(header, 0, action=3)]
        for contact in reading.contacts.touching:
            tip_m = np.array([*contact.centre_mm, -contact.depth_mm]) * M_PER_MM
            force_N = np.nan_to_num(contact.force_N)
            ends_m = (tip_m - force_N * ARROW_M_PER_N, tip_m)
            points = [
                self._new("geometry_msgs/msg/Point", **dict(zip("xyz", end.tolist(), strict=True)))
                for end in ends_m
            ]
            markers.append(self._marker(header, contact.id, action=0, points=points))
        return self._serialized(
            self.topic("contact_markers"), "visualization_msgs/msg/MarkerArray", markers=markers
        )

    def image(self, encoded: bytes, kind: str, stamp_ns: int) -> RosMessage:
        """An encoded image; `kind` is "jpeg" or "png"."""
        type_name = "sensor_msgs/msg/CompressedImage"
        if kind not in self._headings:
            nothing = np.zeros(0, np.uint8)
            empty = self._stamped("", type_name, 0, frame="camera", format=kind, data=nothing)
            self._headings[kind] = without_last_length(empty.cdr)
        heading = with_stamp(self._headings[kind], stamp_ns)
        return RosMessage(
            topic=self.topic("image/compressed"), type=type_name, cdr=with_last_bytes(heading, encoded)
        )

    def camera_info(self, stamp_ns: int) -> RosMessage:
        """Intrinsic parameters, with the distortion models of ROS."""
        type_name = "sensor_msgs/msg/CameraInfo"
        if self._camera_info is None:
            self._camera_info = self._new_camera_info(type_name).cdr
        return RosMessage(
            topic=self.topic("camera_info"), type=type_name, cdr=with_stamp(self._camera_info, stamp_ns)
        )

    def _new_camera_info(self, type_name: str) -> RosMessage:
        camera = self.sensor.camera
        matrix = camera_matrix(camera)
        roi = self._new(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        return self._stamped(
            "camera_info",
            type_name,
            0,
            frame="camera",
            height=camera.height_px,
            width=camera.width_px,
            distortion_model="plumb_bob" if camera.model == "pinhole" else "equidistant",
            d=np.asarray(camera.distortion, np.float64),
            k=matrix.ravel().astype(np.float64),
            r=np.eye(3).ravel(),
            p=np.column_stack([matrix, np.zeros(3)]).ravel().astype(np.float64),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )

    def transform(self, stamp_ns: int) -> RosMessage:
        """Pose of the sheet in the camera frame, and of the camera in its parent if known, for /tf_static."""
        camera, mount = self.sensor.camera, self._mount
        # Rotation of SciPy takes no arrays that are read-only, as those of a sensor are
        of_sheet = Rotation.from_rotvec(camera.rotation_vector.copy()), camera.translation_mm.copy()
        transforms = [self._transform(stamp_ns, f"{self._name}_camera", f"{self._name}_sheet", *of_sheet)]
        if mount is not None and self.sensor.length_unit == "mm":
            turn = Rotation.from_rotvec(mount.rotation_vector) * of_sheet[0].inv()
            move_mm = np.array(mount.translation_mm) - turn.apply(of_sheet[1])
            transforms.append(self._transform(stamp_ns, mount.parent, f"{self._name}_camera", turn, move_mm))
        return self._serialized("/tf_static", "tf2_msgs/msg/TFMessage", transforms=transforms)

    def _transform(self, stamp_ns: int, parent: str, child: str, turn: Rotation, move_mm: np.ndarray) -> Any:
        x, y, z, w = turn.as_quat().tolist()
        return self._new(
            "geometry_msgs/msg/TransformStamped",
            header=self._header_of(stamp_ns, parent),
            child_frame_id=child,
            transform=self._new(
                "geometry_msgs/msg/Transform",
                translation=self._vector(move_mm * M_PER_MM),
                rotation=self._new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
            ),
        )

    def diagnostics(self, health: Health, status: Status, stamp_ns: int) -> RosMessage:
        """State of the session: level 1 for a status of a frame or a doubt, 2 without source."""
        doubts = [str(status)] if status is not Status.OK else []
        doubts += [] if health.reference_warning is None else [health.reference_warning]
        doubts += [] if self.sensor.length_unit == "mm" else [UNKNOWN_SCALE]
        level = 2 if health.source_state != "ok" else int(bool(doubts))
        values: Mapping[str, object] = {
            "fps": f"{health.readings_per_s:.1f}",
            "latency_ms_p50": f"{health.latency_ms_p50:.1f}",
            "latency_ms_p99": f"{health.latency_ms_p99:.1f}",
            "frames": health.frames,
            "dropped": health.dropped,
            "markers_seen": health.markers_seen,
            "markers": health.markers,
            "method": health.method,
            **{f"dropped by {output.name}": output.dropped for output in health.outputs},
        }
        entry = self._new(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=level,
            name=self._name,
            message=health.source_state if health.source_state != "ok" else "; ".join(doubts) or str(status),
            hardware_id=self.sensor.name,
            values=[
                self._new("diagnostic_msgs/msg/KeyValue", key=key, value=str(value))
                for key, value in values.items()
            ],
        )
        return self._serialized(
            "/diagnostics",
            "diagnostic_msgs/msg/DiagnosticArray",
            header=self._header(stamp_ns, "sheet"),
            status=[entry],
        )

    def _new(self, type_name: str, /, **fields: object) -> Any:
        return self._types[type_name](**fields)

    def _header(self, stamp_ns: int, frame: str) -> Any:
        return self._header_of(stamp_ns, f"{self._name}_{frame}")

    def _header_of(self, stamp_ns: int, frame_id: str) -> Any:
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        stamp = self._new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return self._new("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def _stamped(
        self, topic: str, type_name: str, stamp_ns: int, *, frame: str = "sheet", **fields: object
    ) -> RosMessage:
        header = self._header(stamp_ns, frame)
        return self._serialized(self.topic(topic), type_name, header=header, **fields)

    def _serialized(self, topic: str, type_name: str, /, **fields: object) -> RosMessage:
        cdr = bytes(typestore().serialize_cdr(self._new(type_name, **fields), type_name))
        return RosMessage(topic=topic, type=type_name, cdr=cdr)

    def _vector(self, values: np.ndarray) -> Any:
        return self._new("geometry_msgs/msg/Vector3", **dict(zip("xyz", values.tolist(), strict=True)))

    def _cloud(self, topic: str, points: np.ndarray, stamp_ns: int) -> RosMessage:
        """A cloud of records of uint32 and float32 fields; all but points and stamp is made once."""
        type_name, key = "sensor_msgs/msg/PointCloud2", (topic, len(points))
        if key not in self._clouds:
            filled = np.full(points.nbytes, FILLER, np.uint8)
            made = self._stamped(topic, type_name, 0, data=filled, **self._described(points))
            self._clouds[key] = PreparedCloud(made.cdr, points.nbytes)
        return RosMessage(
            topic=self.topic(topic), type=type_name, cdr=self._clouds[key](stamp_ns, points.tobytes())
        )

    def _described(self, points: np.ndarray) -> dict[str, Any]:
        described: Mapping[str, Any] = points.dtype.fields or {}
        return {
            "height": 1,
            "width": len(points),
            "fields": [
                self._new(
                    "sensor_msgs/msg/PointField",
                    name=name,
                    offset=int(entry[1]),
                    datatype=UINT32 if entry[0].kind == "u" else FLOAT32,
                    count=1,
                )
                for name, entry in described.items()
            ],
            "is_bigendian": False,
            "point_step": points.dtype.itemsize,
            "row_step": points.nbytes,
            "is_dense": False,
        }

    def _marker(self, header: Any, number: int, *, action: int, points: Sequence[Any] = ()) -> Any:
        return self._types["visualization_msgs/msg/Marker"](
            header=header, id=number, action=action, points=list(points), **self._arrow
        )

    @cached_property
    def _arrow(self) -> dict[str, object]:
        """What all arrows have in common."""
        nothing = self._new("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        image = self._new(
            "sensor_msgs/msg/CompressedImage",
            header=self._new("std_msgs/msg/Header", stamp=nothing, frame_id=""),
            format="",
            data=np.zeros(0, np.uint8),
        )
        return {
            "ns": "contacts",
            "type": 0,
            "pose": self._new(
                "geometry_msgs/msg/Pose",
                position=self._new("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0),
                orientation=self._new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            ),
            "scale": self._vector(np.array([ARROW_SHAFT_M, ARROW_HEAD_M, 0.0])),
            "color": self._new("std_msgs/msg/ColorRGBA", r=0.9, g=0.3, b=0.1, a=1.0),
            "lifetime": self._new("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            "frame_locked": False,
            "colors": [],
            "texture_resource": "",
            "texture": image,
            "uv_coordinates": [],
            "text": "",
            "mesh_resource": "",
            "mesh_file": self._new(
                "visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, np.uint8)
            ),
            "mesh_use_embedded_materials": False,
        }


def _contact_numbers(contact: Contact) -> tuple[float, ...]:
    """Values of `CONTACT_FIELDS`, in SI units."""
    return (
        *(contact.centre_mm * M_PER_MM).tolist(),
        -contact.depth_mm * M_PER_MM,
        contact.depth_mm * M_PER_MM,
        *contact.force_N.tolist(),
        contact.torque_Nmm * M_PER_MM,
        contact.area_mm2 * M_PER_MM**2,
        *(np.sqrt(contact.covariance[STD_PLACES, STD_PLACES]) * STD_FACTORS).tolist(),
    )
