"""Messages of a recording, in the schemas that the docstring of the package lists."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.errors import SourceError
from manytouch.geometry.camera import camera_matrix
from manytouch.recording import CALIBRATION, SCHEMA, TRANSFORM
from manytouch.recording.compression import compressed, decompressed
from manytouch.recording.json_codec import from_json, to_json
from manytouch.recording.packed import PackedBlock
from manytouch.recording.validation import require_reading, require_sensor
from manytouch.values import (
    Camera,
    Contact,
    Contacts,
    Frame,
    Layout,
    OutlineRing,
    Reading,
    Sensor,
    Surface,
)
from manytouch.values.arrays import read_only

CLOUD_STEP_MM = 2.0**-9  # of /surface, which other programs draw; it compresses to a third
DIGITS = 6  # of the main numbers, as in contacts.csv; `values` contains all
_NUMBER = {"type": ["number", "null"]}
_VALUE = {"type": "object", "description": "a value of manytouch; arrays are described, and are in the block"}
_OUTLINE = {
    "type": ["array", "null"],
    "description": "rings of the contact's region",
    "items": {
        "type": "object",
        "properties": {
            "is_hole": {"type": "boolean"},
            "points_mm": {"type": "array", "items": {"type": "array", "items": {"type": "number"}}},
        },
    },
}
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
                    **dict.fromkeys(
                        ("half_major_mm", "half_minor_mm", "orientation_rad", "shape_probability"), _NUMBER
                    ),
                    "shape": {"type": ["string", "null"]},
                    "outline": _OUTLINE,
                },
            },
        },
        "values": {
            "type": "object",
            "properties": dict.fromkeys(("detections", "grid", "surface", "contacts"), _VALUE),
        },
        "block": {
            "type": "object",
            "description": "arrays of the values: all first bytes of an array, then all second ones, ...",
            "properties": {"bytes": {"type": "integer"}, "zstd_base64": {"type": "string"}},
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
    """Encode a reading without its frame, and without the layout, which is part of the recorded sensor.

    Arrays are packed (`manytouch.recording.packed`).
    """
    block = PackedBlock()
    detections, grid, surface = reading.detections, reading.grid, reading.surface
    values = {
        "detections": to_json(detections, block),
        "grid": to_json(grid, block),
        "surface": to_json(_without_layout(surface), block),
        "contacts": to_json(_without_outlines(reading.contacts), block),
    }
    return _bytes(
        {
            "frame": reading.frame.index,
            "time_s": reading.frame.timestamp_ns * 1e-9,
            "status": reading.status,
            "milliseconds": reading.milliseconds,
            "markers_seen": int(grid.is_seen.sum()),
            "contacts": [_contact(contact) for contact in reading.contacts.contacts],
            "values": values,
            "position_from_rest": _is_rest_plus_displacement(surface),
            "block": {
                "bytes": len(block.content),
                "zstd_base64": base64.b64encode(compressed(bytes(block.content))).decode("ascii"),
            },
        }
    )


def decode_reading(message: bytes, frame: Frame, layout: Layout | None) -> Reading:
    """Decode the reading of a frame of a sensor with this layout; also one of earlier versions.

    Raises:
        SourceError: the message is damaged, or was written by a later version.
    """
    encoded = json_object(message)
    try:
        block = _unpacked_block(encoded["block"]) if "block" in encoded else b""
        values = {name: from_json(each, block) for name, each in encoded["values"].items()}
        surface = replace(values["surface"], layout=layout)
        if encoded.get("position_from_rest") is True and layout is not None:
            surface = replace(surface, position_mm=read_only(layout.rest_mm + surface.displacement_mm))
        values["surface"] = surface
        values["contacts"] = _with_outlines(values["contacts"], encoded.get("contacts", []))
        reading = Reading(frame=frame, milliseconds=float(encoded["milliseconds"]), **values)
        return require_reading(reading, layout)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise SourceError(f"a recorded reading cannot be read ({error}): it is damaged") from error


def decode_session(message: bytes) -> tuple[Sensor, dict[str, Any]]:
    """The sensor of a session, and the other fields of its schema.

    Raises:
        SourceError: the message is damaged, or was written by a later version.
    """
    about = json_object(message)
    try:
        schema, started_ns = about["schema"], about["started_unix_ns"]
        is_known = type(schema) is int and schema <= SCHEMA and type(started_ns) is int
        if not (is_known and 0 <= started_ns < 2**63 and isinstance(about["method"], str)):
            raise SourceError(
                f"the session has schema {str(schema)[:20]}, and {SCHEMA} is known: it is damaged, or was "
                "written by a later version of manytouch"
            )
        return require_sensor(from_json(about.pop("sensor"))), about
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise SourceError(f"the recorded session cannot be read ({error}): it is damaged") from error


def json_object(message: bytes) -> dict[str, Any]:
    """The object of a JSON message.

    Raises:
        SourceError: the message is not one.
    """
    try:
        found = json.loads(message, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise SourceError(f"a message is not JSON ({error}): the recording is damaged") from error
    if not isinstance(found, dict):
        raise SourceError("a message is not an object of JSON: the recording is damaged")
    return found


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


def _is_rest_plus_displacement(surface: Surface) -> bool:
    layout = surface.layout
    if layout is None or layout.rest_mm.shape != surface.displacement_mm.shape:
        return False
    return np.array_equal(surface.position_mm, layout.rest_mm + surface.displacement_mm, equal_nan=True)


def _without_layout(surface: Surface) -> Surface:
    """The surface to store; positions that follow from displacements repeat these, which costs no space."""
    if _is_rest_plus_displacement(surface):
        return replace(surface, layout=None, position_mm=surface.displacement_mm)
    return replace(surface, layout=None)


def _without_outlines(contacts: Contacts) -> Contacts:
    """The contacts to store; their outlines are stored as plain numbers, which other programs read."""
    return replace(contacts, contacts=tuple(replace(each, outline=None) for each in contacts.contacts))


def _with_outlines(contacts: Contacts, described: Sequence[Mapping[str, Any]]) -> Contacts:
    """The contacts with the outlines of their descriptions."""
    if not contacts.contacts or any(each.outline is not None for each in contacts.contacts):
        return contacts  # of a recording that contains the outlines twice
    outlines = {each["contact"]: each.get("outline") for each in described}
    return replace(
        contacts,
        contacts=tuple(replace(each, outline=_outline(outlines.get(each.id))) for each in contacts.contacts),
    )


def _outline(rings: Sequence[Mapping[str, Any]] | None) -> tuple[OutlineRing, ...] | None:
    if rings is None:
        return None
    found = ((np.array(ring["points_mm"], dtype=np.float64), ring["is_hole"]) for ring in rings)
    return tuple(
        OutlineRing(point_mm=read_only(point_mm.reshape(-1, 2)), is_hole=is_hole)
        for point_mm, is_hole in found
    )


def _unpacked_block(encoded: Mapping[str, Any]) -> bytes:
    """The packed arrays; their size is checked before it is allocated."""
    if type(encoded["bytes"]) is not int:
        raise SourceError("the size of a reading is not a number: the recording is damaged")
    data = base64.b64decode(encoded["zstd_base64"], validate=True)
    return decompressed("zstd", data, encoded["bytes"])


def encode_session(sensor: Sensor, about: Mapping[str, Any]) -> bytes:
    """Encode what produced the readings; `about` has all fields of the schema except the sensor."""
    return _bytes({**about, "sensor": to_json(sensor)})


def surface_message(reading: Reading, log_ns: int) -> Any:
    """The markers in the sheet frame as a foxglove.PointCloud of x, y, z, depth in float32."""
    from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
    from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

    surface = reading.surface
    points = np.column_stack([surface.position_mm, -surface.displacement_mm[:, 2]])
    points = (np.round(points / CLOUD_STEP_MM) * CLOUD_STEP_MM).astype("<f4")
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


def camera_messages(camera: Camera) -> tuple[tuple[str, Callable[[Camera, str, int], Any]], ...]:
    """Topics and messages that describe a camera; none for several views, whose pictures are one image."""
    if camera.views:
        return ()
    return (CALIBRATION, calibration_message), (TRANSFORM, transform_message)


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
        "half_major_mm": contact.half_major_mm,
        "half_minor_mm": contact.half_minor_mm,
        "orientation_rad": contact.orientation_rad,
        "shape_probability": contact.shape_probability,
    }
    known = {
        name: float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for name, value in numbers.items()
    }
    return {
        "contact": contact.id,
        "phase": contact.phase.value,
        **known,
        "shape": None if contact.shape is None else contact.shape.value,
        "outline": None
        if contact.outline is None
        else [
            {"is_hole": ring.is_hole, "points_mm": np.round(ring.point_mm, 3).tolist()}
            for ring in contact.outline
        ],
    }


def _bytes(encoded: Any) -> bytes:
    return json.dumps(encoded, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode("utf-8")
