"""Messages of a recording, in the schemas that the docstring of the package lists."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.geometry.camera import camera_matrix
from manytouch.recording.json_codec import from_json, to_json
from manytouch.values import Camera, Contact, Frame, Layout, Reading, Sensor

_NUMBER = {"type": ["number", "null"]}
_VALUE = {"type": "object", "description": "a value of manytouch, bit for bit"}
READING_SCHEMA: dict[str, Any] = {
    "type": "object",
    "title": "manytouch.Reading",
    "required": ["frame", "time_s", "status", "milliseconds", "markers_seen", "contacts", "values"],
    "properties": {
        "frame": {"type": "integer"},
        "time_s": {"type": "number"},
        "status": {"type": "string"},
        "milliseconds": {"type": "number"},
        "markers_seen": {"type": "integer"},
        "contacts": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "contact": {"type": "integer"},
                    "phase": {"type": "string"},
                    **dict.fromkeys(
                        ("x_mm", "y_mm", "depth_mm", "normal_force_N", "shear_x_N", "shear_y_N"), _NUMBER
                    ),
                    **dict.fromkeys(("area_mm2", "torque_Nmm", "depth_std_mm"), _NUMBER),
                },
            },
        },
        "values": {
            "type": "object",
            "properties": dict.fromkeys(("detections", "grid", "surface", "contacts"), _VALUE),
        },
    },
}
SESSION_SCHEMA: dict[str, Any] = {
    "type": "object",
    "title": "manytouch.Session",
    "required": ["schema", "started_unix_ns", "source", "method", "parameters", "versions", "sensor"],
    "properties": {
        "schema": {"type": "integer"},
        "started_unix_ns": {"type": "integer"},
        "source": {"type": "object"},
        "method": {"type": "string"},
        "parameters": {"type": "object"},
        "versions": {"type": "object"},
        "sensor": _VALUE,
    },
}


def encode_reading(reading: Reading) -> bytes:
    """Encode a reading without its frame, and without the layout, which is part of the recorded sensor."""
    return _bytes(
        {
            "frame": reading.frame.index,
            "time_s": reading.frame.timestamp_ns * 1e-9,
            "status": reading.status,
            "milliseconds": reading.milliseconds,
            "markers_seen": int(reading.grid.is_seen.sum()),
            "contacts": [_contact(contact) for contact in reading.contacts.contacts],
            "values": {
                "detections": to_json(reading.detections),
                "grid": to_json(reading.grid),
                "surface": to_json(replace(reading.surface, layout=None)),
                "contacts": to_json(reading.contacts),
            },
        }
    )


def decode_reading(message: bytes, frame: Frame, layout: Layout | None) -> Reading:
    """Decode the reading of a frame of a sensor with this layout.

    Raises:
        SourceError: the message is damaged, or was written by a later version.
    """
    encoded = json.loads(message)
    values = {name: from_json(each) for name, each in encoded["values"].items()}
    values["surface"] = replace(values["surface"], layout=layout)
    return Reading(frame=frame, milliseconds=float(encoded["milliseconds"]), **values)


def encode_session(sensor: Sensor, about: Mapping[str, Any]) -> bytes:
    """Encode what produced the readings; `about` has all fields of the schema except the sensor."""
    return _bytes({**about, "sensor": to_json(sensor)})


def surface_message(reading: Reading, log_ns: int) -> Any:
    """The markers in the sheet frame as a foxglove.PointCloud of x, y, z, depth in float32."""
    from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

    surface = reading.surface
    points = np.column_stack([surface.position_mm, -surface.displacement_mm[:, 2]]).astype("<f4")
    cloud = PointCloud(frame_id="sheet", point_stride=16, data=points.tobytes())
    cloud.timestamp.FromNanoseconds(log_ns)
    cloud.pose.orientation.w = 1.0
    for index, name in enumerate(("x", "y", "z", "depth")):
        cloud.fields.add(name=name, offset=4 * index, type=PackedElementField.FLOAT32)
    return cloud


def calibration_message(camera: Camera, frame_id: str, log_ns: int) -> Any:
    """The intrinsic parameters of the camera as a foxglove.CameraCalibration."""
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration

    projection = np.column_stack([camera_matrix(camera), np.zeros(3)])
    message = CameraCalibration(
        frame_id=frame_id,
        width=camera.width_px,
        height=camera.height_px,
        distortion_model="kannala_brandt" if camera.model == "fisheye" else "plumb_bob",
        D=camera.distortion.tolist(),
        K=camera_matrix(camera).ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=projection.ravel().tolist(),
    )
    message.timestamp.FromNanoseconds(log_ns)
    return message


def transform_message(camera: Camera, frame_id: str, log_ns: int) -> Any:
    """The pose of the sheet in the camera frame as a foxglove.FrameTransform, in the units of /surface."""
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform

    message = FrameTransform(parent_frame_id=frame_id, child_frame_id="sheet")
    message.timestamp.FromNanoseconds(log_ns)
    x, y, z = camera.translation_mm.tolist()
    message.translation.x, message.translation.y, message.translation.z = x, y, z
    rotation = message.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = (
        Rotation.from_rotvec(camera.rotation_vector.copy()).as_quat().tolist()
    )
    return message


def _contact(contact: Contact) -> dict[str, Any]:
    x, y = contact.centre_mm
    shear_x, shear_y, force_z = contact.force_N
    numbers = {
        "x_mm": x,
        "y_mm": y,
        "depth_mm": contact.depth_mm,
        "normal_force_N": -force_z,
        "shear_x_N": shear_x,
        "shear_y_N": shear_y,
        "area_mm2": contact.area_mm2,
        "torque_Nmm": contact.torque_Nmm,
        "depth_std_mm": contact.std("depth"),
    }
    known = {name: float(value) if np.isfinite(value) else None for name, value in numbers.items()}
    return {"contact": contact.id, "phase": contact.phase.value, **known}


def _bytes(encoded: Any) -> bytes:
    return json.dumps(encoded, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode("utf-8")
