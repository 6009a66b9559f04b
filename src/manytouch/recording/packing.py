"""Values to JSON and back, to the last bit.

A value becomes an object with its `type` and its fields; an array its type, shape and bytes in base64
(little-endian, row by row); a number that JSON does not know, "nan" or "inf" in an object.
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
    Surface,
    TrackedGrid,
)
from manytouch.values.arrays import read_only

_VALUES: dict[str, Any] = {
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
_ARRAYS = ("float64", "float32", "int64", "int32", "uint8", "bool")


def packed(value: Any) -> Any:
    """A value as JSON knows it.

    Raises:
        TypeError: it holds something that is no value.
    """
    if value is None or (isinstance(value, bool | int | str) and not isinstance(value, Enum)):
        return value
    if isinstance(value, np.generic):
        return packed(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else {"number": str(value)}
    if isinstance(value, tuple | list):
        return [packed(each) for each in value]
    return _packed_object(value)


def _packed_object(value: Any) -> dict[str, Any]:
    if isinstance(value, np.ndarray):
        whole = np.ascontiguousarray(value)
        little = whole.astype(whole.dtype.newbyteorder("<"), copy=False)
        encoded = base64.b64encode(little.tobytes()).decode("ascii")
        return {"array": str(value.dtype), "shape": list(value.shape), "base64": encoded}
    if isinstance(value, Mapping):
        return {"mapping": {str(key): packed(each) for key, each in value.items()}}
    name = type(value).__name__
    if isinstance(value, Enum):
        return {"type": name, "value": value.value}
    if dataclasses.is_dataclass(value) and name in _VALUES:
        held = {field.name: packed(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"type": name, **held}
    raise TypeError(f"{name} is no value that a recording holds")


def unpacked(held: Any) -> Any:
    """The value that was packed; sequences come back as tuples, arrays read-only.

    Raises:
        SourceError: it is not what `packed` makes, or of a later version.
    """
    if isinstance(held, list):
        return tuple(unpacked(each) for each in held)
    if not isinstance(held, dict):
        return held
    try:
        return _object(held)
    except (KeyError, TypeError, ValueError) as error:
        raise SourceError(
            f"a recorded value cannot be read ({error}): it is damaged, or of a later version of manytouch"
        ) from error


def _object(held: dict[str, Any]) -> Any:
    if "array" in held:
        if held["array"] not in _ARRAYS:
            raise ValueError(f"array of {held['array']}")
        little = np.dtype(held["array"]).newbyteorder("<")
        flat = np.frombuffer(base64.b64decode(held["base64"]), dtype=little)
        return read_only(flat.astype(held["array"]).reshape(held["shape"]))
    if "number" in held:
        return float(held["number"])
    if "mapping" in held:
        return {key: unpacked(each) for key, each in held["mapping"].items()}
    if held["type"] == "Phase":
        return Phase(held["value"])
    fields = {name: unpacked(each) for name, each in held.items() if name != "type"}
    return _VALUES[held["type"]](**fields)
