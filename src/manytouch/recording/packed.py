"""Arrays of a message packed into one block of bytes.

Numbers are rounded to float32 and some of them further (`SIGNIFICANT_BITS`), and stored component by
component with all first bytes before all second ones, which zstd then halves.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from manytouch.limits import MAX_MESSAGE_BYTES
from manytouch.values.arrays import read_only

FLOAT32_BITS = 24
COVARIANCES = ("covariance", "covariance_px2", "covariance_mm2")
SIGNIFICANT_BITS = {
    **dict.fromkeys(("covariance_px2", "covariance_mm2"), 9),
    **dict.fromkeys(("area_px2", "contrast"), 10),
    **dict.fromkeys(("covariance", "force_over_E_mm2"), 12),
    **dict.fromkeys(("displacement_mm", "coefficient_mm"), 16),
}
"""Significant bits by name of the field, where they are fewer than those of float32. They round a number by
up to 0.1 % (9 bits), 0.05 % (10), 0.012 % (12) and 8 ppm (16), far below its standard deviation."""
STORED_AS = {"float64": "float32", "int64": "int32", "bool": "uint8"}
_READ_AS = {stored: kind for kind, stored in STORED_AS.items()}


class PackedBlock:
    """The arrays of one message.

    Attributes:
        content: their bytes, one array after the other.
    """

    def __init__(self) -> None:
        self.content = bytearray()

    def pack(self, array: np.ndarray, field: str = "") -> dict[str, Any]:
        """Append an array; returns its description for JSON.

        Args:
            array: to be stored.
            field: its name, which decides how it is rounded.

        Raises:
            TypeError: its type is not one of `STORED_AS`.
        """
        stored = STORED_AS.get(str(array.dtype))
        if stored is None:
            raise TypeError(f"a recording cannot store an array of {array.dtype}")
        described = {"packed": stored, "shape": list(array.shape), "at": len(self.content)}
        bits = SIGNIFICANT_BITS.get(field, FLOAT32_BITS)
        if field in COVARIANCES and array.ndim > 1 and _is_symmetric(array):
            described["symmetric"] = True
            rows, columns = np.triu_indices(array.shape[-1])
            array = array[..., rows, columns]
        with np.errstate(over="ignore"):
            numbers = array.astype(np.dtype(stored).newbyteorder("<"))
        if bits < FLOAT32_BITS:
            numbers = _rounded(numbers, bits)
        flat = np.ascontiguousarray(numbers.T).reshape(-1)
        self.content += flat.view(np.uint8).reshape(-1, numbers.itemsize).T.tobytes()
        return described


def unpack(described: Mapping[str, Any], content: bytes) -> np.ndarray:
    """The array that `PackedBlock.pack` described, in its former type; read-only.

    Raises:
        KeyError, TypeError, ValueError: it is not one, or is not inside the block.
    """
    kind, shape = _READ_AS[described["packed"]], described["shape"]
    if not isinstance(shape, list) or not all(type(each) is int and 0 <= each < 2**31 for each in shape):
        raise ValueError(f"shape {shape!r}")
    stored = np.dtype(described["packed"]).newbyteorder("<")
    side = None
    packed_shape = tuple(shape)
    if described.get("symmetric") is True:
        side = shape[-1] if len(shape) > 1 and shape[-1] == shape[-2] else -1
        packed_shape = (*shape[:-2], side * (side + 1) // 2)
    count, begin = math.prod(packed_shape), described["at"]
    end = begin + count * stored.itemsize
    if side == -1 or not 0 <= begin <= end <= len(content) or math.prod(shape) * 8 > MAX_MESSAGE_BYTES:
        raise ValueError(f"{count} numbers at {begin} of {len(content)} bytes")
    planes = np.frombuffer(content, np.uint8, count * stored.itemsize, begin).reshape(stored.itemsize, count)
    flat = np.ascontiguousarray(planes.T).reshape(-1).view(stored).astype(kind)
    numbers = np.ascontiguousarray(flat.reshape(packed_shape[::-1]).T)
    if side is None:
        return read_only(numbers)
    whole = np.empty(shape)
    rows, columns = np.triu_indices(side)
    whole[..., rows, columns] = whole[..., columns, rows] = numbers
    return read_only(whole)


def _is_symmetric(array: np.ndarray) -> bool:
    is_square = array.shape[-1] == array.shape[-2]
    return is_square and np.array_equal(array, array.swapaxes(-1, -2), equal_nan=True)


def _rounded(numbers: np.ndarray, bits: int) -> np.ndarray:
    """float32 rounded to a number of significant bits."""
    dropped = 24 - bits
    whole = np.ascontiguousarray(numbers).view(np.uint32)
    half = np.uint32(1 << (dropped - 1))
    rounded = ((whole + half) >> np.uint32(dropped)) << np.uint32(dropped)
    return np.where(np.isfinite(numbers), rounded.view(np.float32), numbers)
