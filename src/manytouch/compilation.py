"""How functions are compiled by numba, so that mypy checks their bodies and their calls.

A compiled function is written with two decorators::

    @kernel(fastmath=REORDER)
    @no_type_check
    def add(values: Float32[np.ndarray, " n"]) -> float: ...

Its arguments are numbers, arrays and `typing.NamedTuple`s of these.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.core.options import DefaultOptions
from numba.extending import intrinsic

from manytouch.kernels.cache import provide_folder
from manytouch.kernels.libraries import (
    KernelCompiler,
    bind_calls_within_modules,
    compile_parts_without_code,
)
from manytouch.kernels.loading import keep_in_files

THREADS = 2  # of `in_threads`
Function = TypeVar("Function", bound=Callable[..., Any])
Item = TypeVar("Item")
Result = TypeVar("Result")
Named = TypeVar("Named", bound=tuple[Any, ...])

# Floating-point options: sums may be reordered, which SIMD needs; NaN and infinity keep their meaning.
REORDER = {"reassoc", "contract", "nsz", "arcp"}

# Conversions as compiled code has them. To mypy the results are plain numbers, whose arithmetic it knows.
# Unsigned indices are not checked for being negative, which keeps loops over them in SIMD registers.
f32 = cast(Callable[[float], float], np.float32)
f64 = cast(Callable[[float], float], np.float64)
i64 = cast(Callable[[int], int], np.int64)
u64 = cast(Callable[[int], int], np.uint64)


def kernels_folder() -> str:
    """Folder of the machine code; empty if it is kept next to the sources."""
    return str(_config.CACHE_DIR)


def no_type_check(function: Function) -> Function:
    """Excludes a function from run-time type checks, which numba cannot compile; mypy still checks it.

    The import hook of jaxtyping recognises the decorator by this name.
    """
    return function


def kernel(**options: Any) -> Callable[[Function], Function]:
    """Decorator that compiles a function without the interpreter lock and caches the machine code.

    What Python calls, and what other compiled functions call, are compiled separately: the latter is part of
    the code of its callers and has none of its own (`kernels.libraries`).
    """
    is_kept = options.pop("cache", True)
    common = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    compile_whole = njit(**{"pipeline_class": KernelCompiler, **common})

    def compiled(function: Function) -> Function:
        whole: Any = compile_whole(function)
        if is_kept:
            keep_in_files(whole)

        @cache
        def part() -> Any:  # made once it is needed: most programs load all code and compile nothing
            return njit(**{**common, "no_cpython_wrapper": True})(function)

        def call_template(arguments: Any, named: Any) -> Any:
            # a specialisation for True and one for False would be compiled in addition to that for a variable
            kinds = [types.boolean if isinstance(kind, types.BooleanLiteral) else kind for kind in arguments]
            return part().get_call_template(tuple(kinds), named)

        def overload(signature: Any) -> Any:
            return part().get_overload(signature)

        whole.get_call_template, whole.get_overload, whole.part = call_template, overload, part
        return cast(Function, whole)

    return compiled


def inlined_kernel(**options: Any) -> Callable[[Function], Function]:
    """Decorator for small kernels that are called once per dot: inlined, without reference counts.

    Counting the references to arrays at each call takes as long as the work itself. Such a kernel must only
    use arrays that its caller keeps, and create none. Without numba's internal switch it is correct, but
    slower.
    """
    uncounted = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
    return kernel(forceinline=True, **uncounted, **options)


def plain(named: Named) -> Named:
    """The values of a NamedTuple as a plain tuple, for an argument of a kernel that is called in each frame.

    numba takes half of the time to recognise its type. The kernel makes the NamedTuple again, which costs
    nothing: `dots = DotArrays(*dots)`.
    """
    return cast(Named, tuple(named))


def in_threads(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Results of a function that spends its time in kernels, in the order of the items.

    For work that is done once, when a recording begins; frames are computed in one thread.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(function, items))


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


_config: Any = config  # numba sets its attributes while it runs
_config.CACHE_DIR = provide_folder(_config.CACHE_DIR)
bind_calls_within_modules()
compile_parts_without_code()
