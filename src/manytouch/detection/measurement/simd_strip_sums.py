"""Sums over the pixels around a dot, in strips of 16 columns: one vector of the processor for each row.

This is the innermost loop of detection, and the only one that is written in LLVM's own language: all that is
summed stays in registers, which no compiler of plain loops manages. Per pixel of a grey level v it does

    w = min(max((v - ground) brightness - start, 0), 1),

ground and brightness planes, and adds it up in each column; running sums of running sums of the rows hold the
first and second moments along y, without a multiplication.
"""

# mypy: disable-error-code="no-untyped-def"
# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import no_type_check

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

STRIP = 16  # columns
GROUND, BRIGHT, START, LEFT = 0, 3, 6, 7  # places in `planes`: each plane at the first pixel, per column, row
S0, SX, SXX, R1, RX, R2, EDGE = range(7)  # places in `sums`: see `strip_sums`
FLOAT, VECTOR, COUNT = ir.FloatType(), ir.VectorType(ir.FloatType(), STRIP), ir.IntType(32)
FREE = ("reassoc", "contract", "nsz", "arcp")


@no_type_check
def _all(builder, value):
    """The same number in all lanes."""
    none = ir.Constant(VECTOR, ir.Undefined)
    one = builder.insert_element(none, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, none, ir.Constant(ir.VectorType(ir.IntType(32), STRIP), [0] * STRIP))


@no_type_check
def _number(value):
    return ir.Constant(VECTOR, [float(value)] * STRIP)


@no_type_check
def _grey(builder, pointer, kind, context):
    """The pixels of a row of the strip as floats."""
    row = ir.VectorType(context.get_data_type(kind.dtype), STRIP)
    pixel = builder.load(builder.bitcast(pointer, row.as_pointer()), align=1)
    return pixel if kind.dtype == types.float32 else builder.uitofp(pixel, VECTOR)


@no_type_check
def _count(builder, lanes, number):
    """Adds how many lanes are true, beside the sums: the units that add numbers are the busy ones."""
    here = builder.ctpop(builder.bitcast(lanes, ir.IntType(STRIP)))
    builder.store(builder.add(builder.load(number), builder.zext(here, COUNT)), number)


@intrinsic
@no_type_check
def strip_sums(typing, flat, first, width, strips, rows, mask, planes, sums):
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

    def code(context, builder, signature, arguments):
        data = [
            context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
            for kind, value in zip(signature.args, arguments, strict=True)
        ]
        pixels, begin, apart, across, down, bits, plane, out = data
        index = begin.type
        given = [builder.load(builder.gep(plane, [ir.Constant(index, k)])) for k in range(8)]
        step = ir.Constant(VECTOR, [float(k) for k in range(STRIP)])
        total = [cgutils.alloca_once_value(builder, _number(0.0)) for _ in range(EDGE)]
        edges = cgutils.alloca_once_value(builder, ir.Constant(COUNT, 0))
        with cgutils.for_range(builder, across) as strip:
            offset = builder.mul(strip.index, ir.Constant(index, STRIP))
            column = builder.fadd(_all(builder, builder.sitofp(offset, FLOAT)), step)
            run = [cgutils.alloca_once(builder, VECTOR) for _ in range(5)]
            for k in range(3):
                builder.store(_number(0.0), run[k])
            for k, at in ((3, GROUND), (4, BRIGHT)):
                slope = builder.fmul(_all(builder, given[at + 1]), column, flags=FREE)
                builder.store(builder.fadd(_all(builder, given[at]), slope, flags=FREE), run[k])
            start = _all(builder, given[START])
            down_slopes = [_all(builder, given[GROUND + 2]), _all(builder, given[BRIGHT + 2])]
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
                some = builder.and_(counts, builder.fcmp_ordered(">", weight, _number(0.0)))
                less = builder.fcmp_ordered("<", weight, _number(1.0))
                weight = builder.select(less, weight, _number(1.0))
                weight = builder.select(some, weight, _number(0.0))
                _count(builder, builder.and_(some, less), edges)
                added = weight
                for each in run[:3]:
                    added = builder.fadd(builder.load(each), added)
                    builder.store(added, each)
                for k, slope in zip((3, 4), down_slopes, strict=True):
                    builder.store(builder.fadd(builder.load(run[k]), slope), run[k])
            column = builder.fadd(column, _all(builder, given[LEFT]))
            once, twice, thrice = (builder.load(each) for each in run[:3])
            moment = builder.fmul(once, column, flags=FREE)
            second, mixed = (builder.fmul(each, column, flags=FREE) for each in (moment, twice))
            parts = [once, moment, second, twice, mixed, thrice]
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
