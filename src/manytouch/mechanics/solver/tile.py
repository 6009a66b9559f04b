"""The one inner loop of all dense work here: a product that is added to a tile of a matrix.

numba leaves a tile in memory while it sums it up; written as vector instructions it stays in registers, which
is two to four times faster. LLVM fits the vectors to whatever the machine has.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

ROWS = 8


def _tile(columns: int) -> Callable[..., None]:
    """A compiled function that adds a product to a tile of ROWS x columns."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        c, c_at, c_stride, a, a_at, a_stride, b, b_at, b_stride, count = args
        number = context.get_value_type(signature.args[0].dtype)
        vector, index = ir.VectorType(number, columns), ir.IntType(64)
        to, left, right = (
            context.make_array(signature.args[k])(context, builder, array).data
            for k, array in ((0, c), (3, a), (6, b))
        )
        size = context.get_abi_sizeof(number)

        def at(data: Any, place: Any) -> Any:
            return builder.bitcast(builder.gep(data, [place]), vector.as_pointer())

        rows = [
            at(to, builder.add(c_at, builder.mul(c_stride, ir.Constant(index, row)))) for row in range(ROWS)
        ]
        begin = [builder.load(row, align=size) for row in rows]
        entry, loop, done = builder.block, *(builder.append_basic_block(name) for name in ("loop", "done"))
        builder.branch(loop)
        builder.position_at_end(loop)
        k, place_a, place_b = (builder.phi(index) for _ in range(3))
        sums = [builder.phi(vector) for _ in range(ROWS)]
        strip = builder.load(at(right, place_b), align=size)
        nothing, first = ir.Constant(vector, ir.Undefined), ir.Constant(ir.IntType(32), 0)
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), columns), None)
        added = []
        for row, total in enumerate(sums):
            factor = builder.load(builder.gep(left, [builder.add(place_a, ir.Constant(index, row))]))
            spread = builder.shuffle_vector(builder.insert_element(nothing, factor, first), nothing, lanes)
            product = builder.fmul(spread, strip, flags=["fast"])
            added.append(builder.fadd(total, product, flags=["fast"]))
        further = builder.add(k, ir.Constant(index, 1))
        for phi, start, following in (
            (k, ir.Constant(index, 0), further),
            (place_a, a_at, builder.add(place_a, a_stride)),
            (place_b, b_at, builder.add(place_b, b_stride)),
            *zip(sums, begin, added, strict=True),
        ):
            phi.add_incoming(start, entry)
            phi.add_incoming(following, loop)
        builder.cbranch(builder.icmp_signed("<", further, count), loop, done)
        builder.position_at_end(done)
        for row, total in zip(rows, added, strict=True):
            builder.store(total, row, align=size)
        return context.get_dummy_value()

    # numba wants every argument by name
    def typed(typing, c, c_at, c_stride, a, a_at, a_stride, b, b_at, b_stride, count):  # type: ignore[no-untyped-def]  # noqa: PLR0917
        place = types.int64
        signature = types.void(c, place, place, a, place, place, b, place, place, place)
        return signature, generate

    added: Callable[..., None] = intrinsic(typed)
    return added


add_product = _tile(32)
"""add_product(c, c_at, c_stride, a, a_at, a_stride, b, b_at, b_stride, count): c += a^T b, 8 x 32 of it.

Flat C-contiguous arrays of one precision; to c[c_at + row c_stride + column] is added the sum over
k < count of a[a_at + k a_stride + row] b[b_at + k b_stride + column]. count is 1 or more.
"""

add_product_16 = _tile(16)
"""The same on 8 rows x 16 columns."""
