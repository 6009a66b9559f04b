"""How the small kernels that run once for each dot are compiled, and what they ask of the processor."""

# mypy: disable-error-code="no-untyped-def"

from typing import Any, no_type_check

from llvmlite import ir
from numba import types
from numba.core.options import DefaultOptions
from numba.extending import intrinsic

# The sums may run in lanes; NaN and infinity stay what they are.
FAST = {"reassoc", "contract", "nsz", "arcp"}

# Counting references to arrays at each call costs as much as the work itself, and these kernels only read
# and write arrays that their caller holds. The switch is numba's own: without it they are right, but slower.
LEAF: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "forceinline": True}
if hasattr(DefaultOptions, "_nrt"):
    LEAF["_nrt"] = False


@intrinsic
@no_type_check
def prefetch(typing, array, index):
    """Asks for the memory around a place of an array before it is needed; any place is allowed."""

    def code(context, builder, signature, arguments):
        held = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        shape = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        fetch = builder.module.declare_intrinsic("llvm.prefetch", [byte], shape)
        place = builder.bitcast(builder.gep(held.data, [arguments[1]]), byte)
        # to read, to be kept in all caches, as data
        builder.call(fetch, [place, number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp), code
