"""Encode values as JSON and decode them again, bit for bit.

A value is encoded as an object with its `type` and its fields; an array as its data type, its shape and its
bytes in base64 (little-endian, row by row); a number that JSON does not have as an object with its name.
"""

import base64
import dataclasses
import math
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np

from manytouch.errors import SourceError
from manytouch.values import (
    Camera,
    Contact,
    Contacts,
    Detections,
    Layout,
    Phase,
    Sensor,
    Sheet,
    SheetSpline,
    Status,
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import read_only

RECORDED_TYPES: dict[str, Any] = {
    each.__name__: each
    for each in (
        Camera,
        Contact,
        Contacts,
        Detections,
        Layout,
        Sensor,
        Sheet,
        SheetSpline,
        Surface,
        TrackedGrid,
    )
}
_ENUMS: dict[str, Any] = {Phase.__name__: Phase}
_ARRAYS = ("float64", "float32", "int64", "int32", "uint8", "bool")


def to_json(value: Any) -> Any:
    """Encode a value as objects, lists, strings and numbers of JSON.

    Raises:
        TypeError: it contains something that recordings do not store.
    """
    if value is None or (isinstance(value, bool | int | str) and not isinstance(value, Enum)):
        return value
    if isinstance(value, Status):
        return value.value
    if isinstance(value, np.generic):
        return to_json(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else {"number": str(value)}
    if isinstance(value, tuple | list):
        return [to_json(each) for each in value]
    return _object_to_json(value)


def _object_to_json(value: Any) -> dict[str, Any]:
    if isinstance(value, np.ndarray):
        whole = np.ascontiguousarray(value)
        little = whole.astype(whole.dtype.newbyteorder("<"), copy=False)
        content = base64.b64encode(little.tobytes()).decode("ascii")
        return {"array": str(value.dtype), "shape": list(value.shape), "base64": content}
    if isinstance(value, Mapping):
        return {"mapping": {str(key): to_json(each) for key, each in value.items()}}
    name = type(value).__name__
    if isinstance(value, Enum):
        return {"type": name, "value": value.value}
    if dataclasses.is_dataclass(value) and name in RECORDED_TYPES:
        encoded = {field.name: to_json(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"type": name, **encoded}
    raise TypeError(f"a recording cannot store a {name}")


def from_json(encoded: Any) -> Any:
    """Decode a value; sequences become tuples, arrays are read-only.

    Raises:
        SourceError: it was not encoded by `to_json`, or by a later version.
    """
    if isinstance(encoded, list):
        return tuple(from_json(each) for each in encoded)
    if not isinstance(encoded, dict):
        return encoded
    try:
        return _object_from_json(encoded)
    except (KeyError, TypeError, ValueError) as error:
        raise SourceError(
            f"a recorded value cannot be read ({error}): the recording is damaged, or was written by a "
            "later version of manytouch"
        ) from error


def _object_from_json(encoded: dict[str, Any]) -> Any:
    if "array" in encoded:
        if encoded["array"] not in _ARRAYS:
            raise ValueError(f"array of {encoded['array']}")
        little = np.dtype(encoded["array"]).newbyteorder("<")
        flat = np.frombuffer(base64.b64decode(encoded["base64"]), dtype=little)
        return read_only(flat.astype(encoded["array"]).reshape(encoded["shape"]))
    if "number" in encoded:
        return float(encoded["number"])
    if "mapping" in encoded:
        return {key: from_json(each) for key, each in encoded["mapping"].items()}
    if encoded["type"] in _ENUMS:
        return _ENUMS[encoded["type"]](encoded["value"])
    fields = {name: from_json(each) for name, each in encoded.items() if name != "type"}
    if "length_unit" in fields:  # recordings of version 0.1
        fields["scale_is_known"] = fields.pop("length_unit") == "mm"
    if "status" in fields:
        fields["status"] = Status(fields["status"])
    return RECORDED_TYPES[encoded["type"]](**fields)
