"""Product of two thin matrices added to a tile of a third one, as SIMD instructions, and its scalar twin.

numba keeps a tile in memory while it adds to it. As LLVM vectors the tile stays in registers, which is two to
four times faster (ADR 0025). Its 8 rows of 8 numbers fit into the 16 registers of processors with AVX2;
wider tiles do not.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from jaxtyping import Float
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from manytouch.compilation import kernel, no_type_check

ROWS = 8
COLUMNS = 8

Flat = Float[np.ndarray, " n"]


class At(NamedTuple):
    """Where a matrix begins in a flat array, and the distance between its rows."""

    start: int
    stride: int


def _tile() -> Callable[[Flat, At, Flat, At, Flat, At, int], None]:
    """The compiled function."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        c, c_at, a, a_at, b, b_at, count = args
        (c_start, c_stride), (a_start, a_stride), (b_start, b_stride) = (
            (builder.extract_value(at, 0), builder.extract_value(at, 1)) for at in (c_at, a_at, b_at)
        )
        number = context.get_value_type(signature.args[0].dtype)
        vector, index = ir.VectorType(number, COLUMNS), ir.IntType(64)
        to, left, right = (
            context.make_array(signature.args[k])(context, builder, array).data
            for k, array in ((0, c), (2, a), (4, b))
        )
        size = context.get_abi_sizeof(number)

        def pointer(data: Any, place: Any) -> Any:
            return builder.bitcast(builder.gep(data, [place]), vector.as_pointer())

        rows = [
            pointer(to, builder.add(c_start, builder.mul(c_stride, ir.Constant(index, row))))
            for row in range(ROWS)
        ]
        begin = [builder.load(row, align=size) for row in rows]
        entry, loop, done = builder.block, *(builder.append_basic_block(name) for name in ("loop", "done"))
        builder.branch(loop)
        builder.position_at_end(loop)
        k, place_a, place_b = (builder.phi(index) for _ in range(3))
        sums = [builder.phi(vector) for _ in range(ROWS)]
        strip = builder.load(pointer(right, place_b), align=size)
        nothing, first = ir.Constant(vector, ir.Undefined), ir.Constant(ir.IntType(32), 0)
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), COLUMNS), None)
        added = []
        for row, total in enumerate(sums):
            factor = builder.load(builder.gep(left, [builder.add(place_a, ir.Constant(index, row))]))
            spread = builder.shuffle_vector(builder.insert_element(nothing, factor, first), nothing, lanes)
            product = builder.fmul(spread, strip, flags=["fast"])
            added.append(builder.fadd(total, product, flags=["fast"]))
        further = builder.add(k, ir.Constant(index, 1))
        for phi, start, following in (
            (k, ir.Constant(index, 0), further),
            (place_a, a_start, builder.add(place_a, a_stride)),
            (place_b, b_start, builder.add(place_b, b_stride)),
            *zip(sums, begin, added, strict=True),
        ):
            phi.add_incoming(start, entry)
            phi.add_incoming(following, loop)
        builder.cbranch(builder.icmp_signed("<", further, count), loop, done)
        builder.position_at_end(done)
        for row, total in zip(rows, added, strict=True):
            builder.store(total, row, align=size)
        return context.get_dummy_value()

    # numba reads the names of the arguments
    def typed(typing: Any, c: Any, c_at: Any, a: Any, a_at: Any, b: Any, b_at: Any, count: Any) -> Any:  # noqa: PLR0917
        return types.void(c, c_at, a, a_at, b, b_at, types.int64), generate

    return cast(Callable[[Flat, At, Flat, At, Flat, At, int], None], intrinsic(typed))


add_product = _tile()
"""add_product(c, c_at, a, a_at, b, b_at, count) adds a^T b to 8 x 8 entries of c; see its scalar twin."""


@kernel()
@no_type_check
def add_product_scalar(c: Flat, c_at: At, a: Flat, a_at: At, b: Flat, b_at: At, count: int) -> None:  # noqa: PLR0917
    """Scalar twin of `add_product`.

    To c[c_at.start + row c_at.stride + column] is added the sum over k < count of
    a[a_at.start + k a_at.stride + row] b[b_at.start + k b_at.stride + column], for 8 rows and 8 columns.

    Args:
        c, a, b: C-contiguous arrays of one precision.
        c_at, a_at, b_at: where in them.
        count: rows of a and b, at least 1.
    """
    for row in range(ROWS):
        for column in range(COLUMNS):
            total = c[c_at.start + row * c_at.stride + column]
            for k in range(count):
                total += a[a_at.start + k * a_at.stride + row] * b[b_at.start + k * b_at.stride + column]
            c[c_at.start + row * c_at.stride + column] = total
