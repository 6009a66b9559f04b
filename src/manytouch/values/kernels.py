"""Marks functions that numba compiles, which run-time type checkers must leave alone and mypy must not."""

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    Function = TypeVar("Function")

    def no_type_check(function: Function) -> Function:
        """`typing.no_type_check` at run time; mypy checks the function."""
        return function

else:
    from typing import no_type_check

Floats = NDArray[np.float64]
"""A float64 array of any shape; the docstring of the kernel states the shape."""
Integers = NDArray[np.signedinteger[Any]]
"""An int32 or int64 array of any shape."""
Flags = NDArray[np.bool_]
"""A bool array of any shape."""

__all__ = ["Flags", "Floats", "Integers", "no_type_check"]
