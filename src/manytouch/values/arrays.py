"""Array types of the values, and functions that make arrays read-only and numbers those of Python."""

from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8, UInt16
from numpy.typing import NDArray

Points2 = Float64[np.ndarray, "n 2"]
Covariances2 = Float64[np.ndarray, "n 2 2"]
Matrices2 = Float64[np.ndarray, "n 2 2"]
Points3 = Float64[np.ndarray, "n 3"]
Covariances3 = Float64[np.ndarray, "n 3 3"]
Scalars = Float64[np.ndarray, " n"]
Mask = Bool[np.ndarray, " n"]
Counts = Int64[np.ndarray, " n"]
GreyImage = UInt8[np.ndarray, "h w"] | UInt16[np.ndarray, "h w"]
ColourImage = UInt8[np.ndarray, "h w 3"] | UInt16[np.ndarray, "h w 3"]
Image = GreyImage | ColourImage

# Arrays of any shape, for compiled functions and their typed inputs, whose docstrings state the shapes.
Floats = NDArray[np.float64]
Integers = NDArray[np.signedinteger[Any]]
Flags = NDArray[np.bool_]

Array = TypeVar("Array", bound=np.ndarray)


def plain(value: Any) -> Any:
    """A number of numpy as one of Python; a list or an array as a tuple of them; all else as it is."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    return tuple(plain(each) for each in value) if isinstance(value, list | tuple) else value


def read_only(array: Array) -> Array:
    """The same array, no longer writable through this reference (no copy)."""
    array.setflags(write=False)
    return array


def read_only_view(array: Array) -> Array:
    """A view of the array that is not writable; the array itself stays as it is (no copy).

    numba compiles a function once for writable arrays and once more for read-only ones: pass it always the
    same kind.
    """
    return read_only(array.view())


def reduced(value: Any) -> tuple[Any, ...]:
    """The `__reduce__` of a value with arrays: those that are read-only stay so in copies.

    numpy makes the arrays of a copy, or of a value from a pickle, writable.
    """
    members = [getattr(value, field.name) for field in fields(value)]
    is_read_only = [isinstance(each, np.ndarray) and not each.flags.writeable for each in members]
    return _restored, (type(value), members, is_read_only)


def _restored(kind: Any, members: list[Any], is_read_only: list[bool]) -> Any:
    value = object.__new__(kind)
    for field, member, is_locked in zip(fields(kind), members, is_read_only, strict=True):
        object.__setattr__(value, field.name, read_only(member) if is_locked else member)
    return value
