"""Encode values as JSON and decode them again.

A value is encoded as an object with its `type` and its fields; a number that JSON does not have as an object
with its name. An array is encoded as its data type, its shape and its bytes in base64 (little-endian, row by
row), bit for bit; or, rounded, as its place in a block of packed arrays (`packed`).

Recordings use it for readings and sensors, `session.result_hashes` for what is hashed, and `batch.settings`
for the sensor that is sent to workers.
"""

import base64
import dataclasses
import math
from collections.abc import Mapping
from datetime import date, time
from enum import Enum
from typing import Any

import numpy as np

from manytouch.errors import ManytouchError, SourceError
from manytouch.recording.packed import PackedBlock, unpack
from manytouch.values import (
    Camera,
    Contact,
    Contacts,
    ContactShape,
    Detections,
    Interpolation,
    Layout,
    OutlineRing,
    Phase,
    Sensor,
    Sheet,
    SheetSpline,
    Status,
    Surface,
    TrackedGrid,
    View,
)
from manytouch.values.arrays import read_only

RECORDED_TYPES: dict[str, Any] = {
    each.__name__: each
    for each in (
        Camera,
        Contact,
        Contacts,
        Detections,
        Interpolation,
        Layout,
        OutlineRing,
        Sensor,
        Sheet,
        SheetSpline,
        Surface,
        TrackedGrid,
        View,
    )
}
_ENUMS: dict[str, Any] = {each.__name__: each for each in (ContactShape, Phase)}
_ARRAYS = ("float64", "float32", "int64", "int32", "uint8", "bool")


def to_json(value: Any, block: PackedBlock | None = None) -> Any:
    """Encode a value as objects, lists, strings and numbers of JSON.

    Args:
        value: to be encoded.
        block: the block of the message, to which the arrays are appended, rounded; its content has to be
            stored with the message. None: arrays are encoded bit for bit, in the result itself.

    Raises:
        TypeError: it contains a value of a type that is not listed here.
    """
    if value is None or (isinstance(value, bool | int | str) and not isinstance(value, Enum)):
        return value
    if isinstance(value, Status):
        return value.value
    if isinstance(value, np.generic):
        return to_json(value.item(), block)
    if isinstance(value, float):
        return value if math.isfinite(value) else {"number": str(value)}
    if isinstance(value, tuple | list):
        return [to_json(each, block) for each in value]
    return _object_to_json(value, block)


def _object_to_json(value: Any, block: PackedBlock | None) -> dict[str, Any] | str:
    if isinstance(value, np.ndarray):
        if block is not None:
            return block.pack(value)
        whole = np.ascontiguousarray(value)
        little = whole.astype(whole.dtype.newbyteorder("<"), copy=False)
        content = base64.b64encode(little.tobytes()).decode("ascii")
        return {"array": str(value.dtype), "shape": list(value.shape), "base64": content}
    if isinstance(value, Mapping):
        return {"mapping": {str(key): to_json(each, block) for key, each in value.items()}}
    name = type(value).__name__
    if isinstance(value, Enum):
        return {"type": name, "value": value.value}
    if dataclasses.is_dataclass(value) and name in RECORDED_TYPES:
        encoded: dict[str, Any] = {"type": name}
        for field in dataclasses.fields(value):
            member = getattr(value, field.name)
            if block is not None and isinstance(member, np.ndarray):
                encoded[field.name] = block.pack(member, field.name)
            else:
                encoded[field.name] = to_json(member, block)
        return encoded
    if isinstance(value, date | time):  # TOML has them, and the provenance of a sensor file is free
        return value.isoformat()
    raise TypeError(f"a value of type {name} cannot be encoded")


def from_json(encoded: Any, block: bytes = b"") -> Any:
    """Decode a value; sequences become tuples, arrays are read-only.

    Args:
        encoded: from `to_json`.
        block: content of the `PackedBlock` that `to_json` filled; empty if it had none.

    Raises:
        SourceError: it was not encoded by `to_json`, or by that of a later version.
    """
    if isinstance(encoded, list):
        return tuple(from_json(each, block) for each in encoded)
    if not isinstance(encoded, dict):
        return encoded
    try:
        return _object_from_json(encoded, block)
    except SourceError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError, ManytouchError) as error:
        raise SourceError(
            f"an encoded value cannot be read ({error}): it is damaged, or was written by a later version of "
            "manytouch"
        ) from error


def _object_from_json(encoded: dict[str, Any], block: bytes) -> Any:
    if "packed" in encoded:
        return unpack(encoded, block)
    if "array" in encoded:
        if encoded["array"] not in _ARRAYS:
            raise ValueError(f"array of {encoded['array']}")
        little = np.dtype(encoded["array"]).newbyteorder("<")
        flat = np.frombuffer(base64.b64decode(encoded["base64"]), dtype=little)
        return read_only(flat.astype(encoded["array"]).reshape(encoded["shape"]))
    if "number" in encoded:
        return float(encoded["number"])
    if "mapping" in encoded:
        return {key: from_json(each, block) for key, each in encoded["mapping"].items()}
    if encoded["type"] in _ENUMS:
        return _ENUMS[encoded["type"]](encoded["value"])
    fields = {name: from_json(each, block) for name, each in encoded.items() if name != "type"}
    if "length_unit" in fields:  # instead of `scale_is_known`, before version 0.2
        fields["scale_is_known"] = fields.pop("length_unit") == "mm"
    if "status" in fields:
        fields["status"] = Status(fields["status"])
    return RECORDED_TYPES[encoded["type"]](**fields)
