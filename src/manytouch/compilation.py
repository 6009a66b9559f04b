"""How functions are compiled by numba, so that mypy checks their bodies and their calls.

A compiled function is written with two decorators::

    @kernel(fastmath=REORDER)
    @no_type_check
    def add(values: Float32[np.ndarray, " n"]) -> float: ...

Its arguments are numbers, arrays and `typing.NamedTuple`s of these.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core.options import DefaultOptions
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])

# Floating-point options: sums may be reordered, which SIMD needs; NaN and infinity keep their meaning.
REORDER = {"reassoc", "contract", "nsz", "arcp"}

# Conversions as compiled code has them. To mypy the results are plain numbers, whose arithmetic it knows.
# Unsigned indices are not checked for being negative, which keeps loops over them in SIMD registers.
f32 = cast(Callable[[float], float], np.float32)
f64 = cast(Callable[[float], float], np.float64)
i64 = cast(Callable[[int], int], np.int64)
u64 = cast(Callable[[int], int], np.uint64)


def no_type_check(function: Function) -> Function:
    """Excludes a function from run-time type checks, which numba cannot compile; mypy still checks it.

    The import hook of jaxtyping recognises the decorator by this name.
    """
    return function


def kernel(**options: Any) -> Callable[[Function], Function]:
    """Decorator that compiles a function without the interpreter lock and caches the machine code."""
    compile_function = njit(**{"cache": True, "nogil": True, "error_model": "numpy", **options})
    return cast(Callable[[Function], Function], compile_function)


def inlined_kernel(**options: Any) -> Callable[[Function], Function]:
    """Decorator for small kernels that are called once per dot: inlined, without reference counts.

    Counting the references to arrays at each call takes as long as the work itself. Such a kernel must only
    use arrays that its caller keeps, and create none. Without numba's internal switch it is correct, but
    slower.
    """
    uncounted = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
    return kernel(forceinline=True, **uncounted, **options)


@intrinsic
@no_type_check
def prefetch(typing: Any, array: Any, index: Any) -> Any:
    """Requests the memory at a position of an array before it is needed; any position is allowed.

    numba has no function for this instruction of the processor. It changes no result.
    """

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        shape = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        request = builder.module.declare_intrinsic("llvm.prefetch", [byte], shape)
        place = builder.bitcast(builder.gep(values.data, [arguments[1]]), byte)
        # to read, to be kept in all caches, as data
        builder.call(request, [place, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp), code
