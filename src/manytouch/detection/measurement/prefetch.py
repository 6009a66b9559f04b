"""Prefetch instructions of the processor: memory is requested before it is needed.

The only effect is on speed, so there is nothing to compare with a scalar version: without it results are the
same. numba has no function for it; the intrinsic is written in LLVM IR.
"""

from typing import Any

import numpy as np
from jaxtyping import Shaped
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from manytouch.compilation import inlined_kernel, no_type_check
from manytouch.detection.measurement.records import Pixels

LINE = 64  # bytes that are read from memory at once


@intrinsic
@no_type_check
def prefetch(typing: Any, array: Any, index: Any) -> Any:
    """Requests the memory at a position of an array; any position is allowed."""

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


@inlined_kernel()
@no_type_check
def prefetch_window(pixels: Pixels, x: float, y: float, reach: int) -> None:
    """Requests each cache line of a window that is measured soon.

    A new image is in memory, not in the cache, and no processor foresees where dots are.
    """
    if not (abs(x) < 1e6 and abs(y) < 1e6):
        return
    flat: Shaped[np.ndarray, " k"] = pixels.flat
    channels, width = pixels.channels, pixels.width
    line, first = LINE // flat.itemsize, (int(y) - reach) * width + int(x) - reach
    for row in range(first, first + (2 * reach + 1) * width, width):
        for at in range(row * channels, (row + 2 * reach) * channels + line, line):
            prefetch(flat, at)  # type: ignore[call-arg]  # numba adds the first argument
