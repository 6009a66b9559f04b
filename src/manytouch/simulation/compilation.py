"""Compilation of the simulation's kernels, with types that checkers can read."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(**options: Any) -> Callable[[Function], Function]:
    """Compile a function with numba and cache the machine code on disk.

    Runtime checkers wrap functions in Python code, which numba cannot compile; the wrappers are removed.

    Args:
        options: further options of `numba.njit`.

    Returns:
        A decorator. The compiled function takes positional arguments only.
    """

    def compile_function(function: Function) -> Function:
        compiled: Function = njit(cache=True, **options)(inspect.unwrap(function))
        return compiled

    return compile_function
