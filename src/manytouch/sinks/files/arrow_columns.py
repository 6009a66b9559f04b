"""Columns of Arrow tables from arrays of numpy.

`pyarrow.array` imports pandas where that is installed, which takes 0.4 s and 45 MB; buffers do not.
"""

from typing import Any

import numpy as np
import pyarrow as pa

NUMBERS: dict[pa.DataType, type[np.generic]] = {
    pa.int32(): np.int32,
    pa.float32(): np.float32,
    pa.float64(): np.float64,
}


def arrow_column(values: np.ndarray, kind: pa.DataType) -> Any:
    """Copy n numbers or Booleans to a column; NaN becomes an empty value.

    Args:
        values: (n,) of any type that numpy converts to `kind`.
        kind: pa.int32(), pa.float32(), pa.float64() or pa.bool_().
    """
    empty = np.isnan(values) if values.dtype.kind == "f" else np.zeros(len(values), dtype=bool)
    if kind == pa.bool_():
        content = _bits(values.astype(bool))
    else:
        content = pa.py_buffer(np.where(empty, 0, values).astype(NUMBERS[kind]).tobytes())
    is_there = _bits(~empty) if empty.any() else None
    return pa.Array.from_buffers(kind, len(values), [is_there, content])


def _bits(values: np.ndarray) -> pa.Buffer:
    return pa.py_buffer(np.packbits(values, bitorder="little").tobytes())


def point_lists(points: list[np.ndarray]) -> Any:
    """A column whose values are lists of points, from n arrays (k, 2), as float32."""
    ends = np.cumsum([0, *(len(each) for each in points)])
    numbers = arrow_column(np.concatenate(points).ravel(), pa.float32())
    pairs: Any = pa.FixedSizeListArray.from_arrays(numbers, 2)
    return pa.ListArray.from_arrays(arrow_column(ends, pa.int32()), pairs)
