"""The loop over all dots of an image, compiled; see `centroid` for what is measured."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Int8, Int64, Shaped

from manytouch.compilation import inlined_kernel, kernel, no_type_check, prefetch
from manytouch.detection.measurement.background_fit import (
    MOST_SAMPLES,
    GeneralScratch,
    choose_offsets,
    walk_to_dot,
)
from manytouch.detection.measurement.covariance import add_noise, store_dot, store_nothing, store_position
from manytouch.detection.measurement.general_dots import measure_general
from manytouch.detection.measurement.plain_dots import measure_plain, walk_to_plain_dot
from manytouch.detection.measurement.records import (
    AT_BORDER,
    FOUND,
    NO_DOT,
    DotStatistics,
    Pixels,
    Samples,
    X,
    Y,
)
from manytouch.detection.measurement.sampling_pattern import (
    LANES,
    PARTS,
    SamplingPatterns,
    load_pattern,
    window_radius,
)
from manytouch.detection.measurement.simd_strip_sums import STRIP

AHEAD = 3  # dots whose memory is requested early
LINE = 64  # bytes that are read from memory at once


class Expected(NamedTuple):
    """Expected positions and radii (n,), px."""

    x: Float64[np.ndarray, " n"]
    y: Float64[np.ndarray, " n"]
    radius: Float64[np.ndarray, " n"]


class PlainScratch(NamedTuple):
    """Memory for the measurement of plain dots.

    Attributes:
        offset: (288,) of the samples in the image.
        samples: (3, 4, 96).
        grey: (k,) window of a coloured image.
        work: (2, 8).
    """

    offset: Int64[np.ndarray, " k"]
    samples: Float32[np.ndarray, "3 4 lanes"]
    grey: Float32[np.ndarray, " k"]
    work: Float32[np.ndarray, "2 8"]


@inlined_kernel()
@no_type_check
def _prefetch_window(pixels: Pixels, x: float, y: float, reach: int) -> None:
    """Requests each cache line of a window that is measured soon.

    A new image is in memory, not in the cache, and no processor foresees where dots are.
    """
    if not (abs(x) < 1e6 and abs(y) < 1e6):
        return
    flat, channels, width = pixels.flat, pixels.channels, pixels.width
    line, first = LINE // flat.itemsize, (int(y) - reach) * width + int(x) - reach
    for row in range(first, first + (2 * reach + 1) * width, width):
        for at in range(row * channels, (row + 2 * reach) * channels + line, line):
            prefetch(flat, at)  # type: ignore[call-arg]  # numba adds the first argument


@inlined_kernel()
@no_type_check
def _measure_plain_dots(
    pixels: Pixels, expected: Expected, patterns: SamplingPatterns, options: tuple[float, int],
    scratch: PlainScratch, statistics: DotStatistics, status: Int8[np.ndarray, " n"],
    out: Float64[np.ndarray, "n 9"],
) -> None:  # fmt: skip
    """Measures plain dots; of others, `out` contains the position up to which they were followed."""
    noise, steps = options
    width, height = pixels.width, pixels.height
    stride, loaded = (width * pixels.channels, pixels.channels), patterns.row[0]
    pattern = load_pattern(patterns, loaded, stride, scratch.offset, scratch.samples)
    for i in range(len(expected.x)):
        soon = i + AHEAD
        if soon < len(expected.x):
            reach = patterns.reach[patterns.row[soon]]
            _prefetch_window(pixels, expected.x[soon], expected.y[soon], reach)
        x, y, radius = expected.x[i], expected.y[i], expected.radius[i]
        status[i] = NO_DOT
        if x >= -0.5 and y >= -0.5 and x <= width - 0.5 and y <= height - 0.5:
            if patterns.row[i] != loaded:
                loaded = patterns.row[i]
                pattern = load_pattern(patterns, loaded, stride, scratch.offset, scratch.samples)
            x, y, is_inside = walk_to_plain_dot(pixels, x, y, radius, steps, pattern)
            status[i] = AT_BORDER
            if is_inside:
                dot = measure_plain(pixels, x, y, radius, noise, pattern, scratch.grey, scratch.work)
                status[i] = dot.status
                if dot.status == FOUND:
                    store_dot(dot, i, statistics)
                    store_position(dot, radius, (width, height), i, out)
        if status[i] != FOUND:
            store_nothing(i, statistics, out)
            out[i, X], out[i, Y] = x, y


@kernel()
@no_type_check
def _measure_general_dots(
    pixels: Pixels, expected: Expected, options: tuple[float, int], statistics: DotStatistics,
    status: Int8[np.ndarray, " n"], out: Float64[np.ndarray, "n 9"],
) -> None:  # fmt: skip
    """Measures the dots that are not plain, and clears the rows of those that were not found."""
    noise, steps = options
    scratch, chosen_radius = _general_scratch(expected.radius), 0.0
    for i in range(len(expected.x)):
        if status[i] < NO_DOT:
            x, y, radius = out[i, X], out[i, Y], expected.radius[i]
            if radius != chosen_radius:
                chosen_radius = radius
                choose_offsets(radius, scratch)
            if steps > 0 and status[i] == AT_BORDER:
                x, y = walk_to_dot(pixels, x, y, radius, steps, scratch)
            dot = measure_general(pixels, x, y, radius, noise, scratch)
            status[i] = dot.status
            if dot.status == FOUND:
                store_dot(dot, i, statistics)
                store_position(dot, radius, (pixels.width, pixels.height), i, out)
        if status[i] != FOUND:
            out[i, X] = out[i, Y] = np.nan


@kernel()
@no_type_check
def _general_scratch(radius: Float64[np.ndarray, " n"]) -> GeneralScratch:
    side = 2 * int(window_radius(max(radius.max(), 1.0)) + 3.0) + 1
    memory = np.empty((9, MOST_SAMPLES), dtype=np.float32)
    return GeneralScratch(
        np.empty((3, 2, MOST_SAMPLES), dtype=np.int32),
        np.zeros(3, dtype=np.int64),
        Samples(memory[0], memory[1], memory[2], memory[3]),
        Samples(memory[4], memory[5], memory[6], memory[7]),
        memory[8],
        np.empty(side * side, dtype=np.float32),
        np.empty(side * side, dtype=np.int64),
    )


@kernel()
@no_type_check
def measure_dots(
    image: Shaped[np.ndarray, "h wc"],
    weights: Float32[np.ndarray, " c"],
    near: Float64[np.ndarray, "n 2"],
    radius: Float64[np.ndarray, " n"],
    patterns: SamplingPatterns,
    options: tuple[float, int],
    out: Float64[np.ndarray, "n 9"],
) -> None:
    """Measures the dots near some positions.

    Args:
        image: (h, w * c).
        weights: (c,) signed.
        near, radius: expected positions and radii, px.
        patterns: `sampling_patterns` of the radii.
        options: noise of a pixel (grey levels of 255), and number of steps of a walk to the dot.
        out: written; columns as in `records`, NaN where there is no dot.
    """
    patterns = SamplingPatterns(*patterns)
    number, channels = near.shape[0], weights.shape[0]
    if number == 0:
        return
    pixels = Pixels(image, image.reshape(-1), weights, image.shape[1] // channels, image.shape[0], channels)
    expected = Expected(near[:, 0], near[:, 1], radius)
    scratch = PlainScratch(
        np.empty(PARTS * LANES, dtype=np.int64),
        np.empty((PARTS, 4, LANES), dtype=np.float32),
        np.empty(STRIP * patterns.mask.shape[1] if channels > 1 else 0, dtype=np.float32),
        np.empty((2, 8), dtype=np.float32),
    )
    memory = np.empty((17, number))
    statistics = DotStatistics(
        memory[0], memory[1], memory[2], memory[3], memory[4], memory[5], memory[6], memory[7],
        memory[8], memory[9], memory[10], memory[11], memory[12], memory[13],
        memory[14], memory[15], memory[16],
    )  # fmt: skip
    status = np.empty(number, dtype=np.int8)
    _measure_plain_dots(pixels, expected, patterns, options, scratch, statistics, status, out)
    if (status != FOUND).any():
        _measure_general_dots(pixels, expected, options, statistics, status, out)
    add_noise(statistics, radius, weights.sum() >= 0.0, options[0], out)
