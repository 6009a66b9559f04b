"""Sums over the pixels around a dot, in strips of 16 columns: one SIMD vector for each row.

This is the innermost loop of detection, and the only one that is written in LLVM IR: the sums stay in
registers, which the compiler does not achieve with plain loops (docs/decisions/0006-detection.md). Per pixel
of grey level v

    w = min(max((v - ground) brightness - start, 0), 1),

with planes for ground and brightness, is added up in each column. Running sums of running sums of the rows
are the first and second moments along y, without a multiplication. `strip_sums_scalar` is the same in plain
loops.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from jaxtyping import Float32, Shaped, UInt16
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from manytouch.compilation import kernel, no_type_check

STRIP = 16  # columns
GROUND, BRIGHT, START, LEFT = 0, 3, 6, 7  # places in `planes`: each plane at the first pixel, per column, row
S0, SX, SXX, R1, RX, R2, EDGE = range(7)  # places in `sums`: see `strip_sums`
FLOAT, VECTOR, COUNT = ir.FloatType(), ir.VectorType(ir.FloatType(), STRIP), ir.IntType(32)
FREE = ("reassoc", "contract", "nsz", "arcp")


@no_type_check
def _broadcast(builder: Any, value: Any) -> Any:
    """The same number in all lanes."""
    none = ir.Constant(VECTOR, ir.Undefined)
    one = builder.insert_element(none, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, none, ir.Constant(ir.VectorType(ir.IntType(32), STRIP), [0] * STRIP))


@no_type_check
def _constant(value: float) -> Any:
    return ir.Constant(VECTOR, [float(value)] * STRIP)


@no_type_check
def _grey(builder: Any, pointer: Any, kind: Any, context: Any) -> Any:
    """The pixels of a row of the strip as floats."""
    row = ir.VectorType(context.get_data_type(kind.dtype), STRIP)
    pixel = builder.load(builder.bitcast(pointer, row.as_pointer()), align=1)
    return pixel if kind.dtype == types.float32 else builder.uitofp(pixel, VECTOR)


@no_type_check
def _count(builder: Any, lanes: Any, number: Any) -> None:
    """Adds the number of true lanes in integer units, since those that add floats are busy."""
    true_lanes = builder.ctpop(builder.bitcast(lanes, ir.IntType(STRIP)))
    builder.store(builder.add(builder.load(number), builder.zext(true_lanes, COUNT)), number)


@intrinsic
@no_type_check
def _strip_sums(
    typing: Any, flat: Any, first: Any, width: Any, strips: Any, rows: Any, mask: Any, planes: Any, sums: Any
) -> Any:
    """Writes `sums` over a window of a flat image whose rows are `width` pixels apart.

    Of pixels at columns x (from `planes[LEFT]` on) and in row j of n: S0, SX, SXX = sum of w, w x, w x^2;
    R1, RX, R2 = sum of u w, u w x and u (u + 1) / 2 w, with u = n - j; EDGE = number with 0 < w < 1.

    Args:
        flat: pixels, (k,) uint8, uint16 or float32.
        first: the window's first pixel.
        strips, rows: size of the window, in strips and pixels.
        mask: (strips, rows) uint16, one bit for each pixel that counts, flat.
        planes: (8,) float32, see above.
    """

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = [
            context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
            for kind, value in zip(signature.args, arguments, strict=True)
        ]
        pixels, begin, apart, across, down, bits, plane, out = data
        index = begin.type
        given = [builder.load(builder.gep(plane, [ir.Constant(index, k)])) for k in range(8)]
        step = ir.Constant(VECTOR, [float(k) for k in range(STRIP)])
        total = [cgutils.alloca_once_value(builder, _constant(0.0)) for _ in range(EDGE)]
        edges = cgutils.alloca_once_value(builder, ir.Constant(COUNT, 0))
        with cgutils.for_range(builder, across) as strip:
            offset = builder.mul(strip.index, ir.Constant(index, STRIP))
            column = builder.fadd(_broadcast(builder, builder.sitofp(offset, FLOAT)), step)
            run = [cgutils.alloca_once(builder, VECTOR) for _ in range(5)]
            for k in range(3):
                builder.store(_constant(0.0), run[k])
            for k, at in ((3, GROUND), (4, BRIGHT)):
                slope = builder.fmul(_broadcast(builder, given[at + 1]), column, flags=FREE)
                builder.store(builder.fadd(_broadcast(builder, given[at]), slope, flags=FREE), run[k])
            start = _broadcast(builder, given[START])
            down_slopes = [_broadcast(builder, given[GROUND + 2]), _broadcast(builder, given[BRIGHT + 2])]
            place = cgutils.alloca_once_value(builder, builder.add(begin, offset))
            with cgutils.for_range(builder, down) as row:
                at = builder.load(place)
                builder.store(builder.add(at, apart), place)
                grey = _grey(builder, builder.gep(pixels, [at]), signature.args[0], context)
                ground, bright = builder.load(run[3]), builder.load(run[4])
                weight = builder.fmul(builder.fsub(grey, ground, flags=FREE), bright, flags=FREE)
                weight = builder.fsub(weight, start, flags=FREE)
                counts = builder.bitcast(
                    builder.load(builder.gep(bits, [builder.add(builder.mul(strip.index, down), row.index)])),
                    ir.VectorType(ir.IntType(1), STRIP),
                )
                some = builder.and_(counts, builder.fcmp_ordered(">", weight, _constant(0.0)))
                less = builder.fcmp_ordered("<", weight, _constant(1.0))
                weight = builder.select(less, weight, _constant(1.0))
                weight = builder.select(some, weight, _constant(0.0))
                _count(builder, builder.and_(some, less), edges)
                added = weight
                for each in run[:3]:
                    added = builder.fadd(builder.load(each), added)
                    builder.store(added, each)
                for k, slope in zip((3, 4), down_slopes, strict=True):
                    builder.store(builder.fadd(builder.load(run[k]), slope), run[k])
            column = builder.fadd(column, _broadcast(builder, given[LEFT]))
            once, twice, thrice = (builder.load(each) for each in run[:3])
            first = builder.fmul(once, column, flags=FREE)
            second, mixed = (builder.fmul(each, column, flags=FREE) for each in (first, twice))
            parts = [once, first, second, twice, mixed, thrice]
            for each, added in zip(total, parts, strict=True):
                builder.store(builder.fadd(builder.load(each), added), each)
        shape = ir.FunctionType(FLOAT, [FLOAT, VECTOR])
        name = f"llvm.vector.reduce.fadd.v{STRIP}f32"
        add = cgutils.get_or_insert_function(builder.module, shape, name)
        for k, each in enumerate(total):
            summed = builder.call(add, [ir.Constant(FLOAT, 0.0), builder.load(each)], fastmath=FREE)
            builder.store(summed, builder.gep(out, [ir.Constant(index, k)]))
        counted = builder.uitofp(builder.load(edges), FLOAT)
        builder.store(counted, builder.gep(out, [ir.Constant(index, EDGE)]))
        return context.get_dummy_value()

    size = types.intp
    return types.void(flat, size, size, size, size, mask, planes, sums), code


strip_sums = cast(Callable[..., None], _strip_sums)


@kernel()
@no_type_check
def strip_sums_scalar(
    flat: Shaped[np.ndarray, " k"],
    first: int,
    width: int,
    strips: int,
    rows: int,
    mask: UInt16[np.ndarray, " bits"],
    planes: Float32[np.ndarray, "8"],
    sums: Float32[np.ndarray, "8"],
) -> None:
    """As `strip_sums`, pixel by pixel in double precision: what the other is tested against."""
    total = np.zeros(7)
    for row in range(rows):
        for column in range(STRIP * strips):
            ground = planes[GROUND] + planes[GROUND + 1] * column + planes[GROUND + 2] * row
            bright = planes[BRIGHT] + planes[BRIGHT + 1] * column + planes[BRIGHT + 2] * row
            weight = (flat[first + row * width + column] - ground) * bright - planes[START]
            bits = mask[(column // STRIP) * rows + row]
            if (bits >> (column % STRIP)) & 1 == 0 or weight <= 0.0:
                continue
            if weight < 1.0:
                total[EDGE] += 1.0
            weight = min(weight, 1.0)
            x, u = column + planes[LEFT], rows - row
            total[S0] += weight
            total[SX] += weight * x
            total[SXX] += weight * x * x
            total[R1] += u * weight
            total[RX] += u * weight * x
            total[R2] += 0.5 * u * (u + 1) * weight
    sums[:7] = total
