"""The renderer's loops over pixels, compiled; the formulae are in `discs`."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from manytouch.compilation import kernel, no_type_check, u64

REACH = 4.5  # standard deviations beyond which the point spread is taken as 0
TABLE_STEPS = 256  # entries of the profile's table per standard deviation
SMALL = 0.12  # blur against radius of curvature from where on dots are integrated over their chords
NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)


@cache
def profile_table() -> np.ndarray:
    """(2, k) float32 of Phi(-x) and phi(x) for x from -REACH to REACH."""
    x = np.linspace(-REACH, REACH, int(2 * REACH * TABLE_STEPS) + 1)
    density = np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi)
    return np.stack([ndtr(-x), density]).astype(np.float32)


@cache
def normal_quantiles() -> np.ndarray:
    """(65536,) float32: the middles of equally likely slices of the standard normal distribution."""
    return np.asarray(ndtri((np.arange(65536) + 0.5) / 65536), dtype=np.float32)


@kernel()
@no_type_check
def _interpolate(row: np.ndarray, x: float) -> float:
    place = (x + REACH) * TABLE_STEPS
    if place <= 0.0:
        return float(row[0])
    index = int(place)
    if index >= row.shape[0] - 1:
        return float(row[-1])
    share = place - index
    return float((1.0 - share) * row[index] + share * row[index + 1])


class _Ellipse(NamedTuple):
    """One dot in the image, from its centre.

    Attributes:
        ixx, ixy, iyx, iyy: unit disc from image.
        mxx, mxy, myy: of the quadratic form that is 1 on its boundary.
        blur: standard deviation of the point spread, px.
        is_small: whether it is integrated over its chords.
        inner, outer: values of the form below which it is white, above which it is black.
        reach_x, reach_y: half extents, px, blur included.
    """

    ixx: float
    ixy: float
    iyx: float
    iyy: float
    mxx: float
    mxy: float
    myy: float
    blur: float
    is_small: bool
    inner: float
    outer: float
    reach_x: float
    reach_y: float


class _Chords(NamedTuple):
    """Chords along x of an ellipse, one per node of the quadrature, for the pixels of one row.

    Attributes:
        centre, reach: (20,) middle from the ellipse's centre and half length, px.
        weight: (20,) of the quadrature, times the point spread over y.
        cosine: (20,) of the angle of the chord's end.
    """

    centre: np.ndarray
    reach: np.ndarray
    weight: np.ndarray
    cosine: np.ndarray


@kernel()
@no_type_check
def _find_chords(dy: float, dot: _Ellipse, table: np.ndarray, chords: _Chords) -> float:
    """Fill the chords that a row at dy from the centre needs; the factor of their sum, 0 without chords."""
    extent = math.sqrt(dot.mxx / (dot.mxx * dot.myy - dot.mxy * dot.mxy))
    low = max((dy - REACH * dot.blur) / extent, -1.0)
    high = min((dy + REACH * dot.blur) / extent, 1.0)
    if low >= high:
        return 0.0
    begin, end = math.asin(low), math.asin(high)
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    for node in range(NODES.shape[0]):
        angle = middle + half * NODES[node]
        y, cosine = extent * math.sin(angle), math.cos(angle)
        chords.centre[node] = -dot.mxy * y / dot.mxx
        chords.reach[node] = cosine / math.sqrt(dot.mxx)
        chords.weight[node] = WEIGHTS[node] * _interpolate(table[1], (dy - y) / dot.blur)
        chords.cosine[node] = cosine
    return half * extent


@kernel()
@no_type_check
def _over_chords(dx: float, blur: float, factor: float, table: np.ndarray, chords: _Chords) -> float:
    """The blurred ellipse at dx from its centre in the row of the chords, weighted over y."""
    total = 0.0
    for node in range(NODES.shape[0]):
        from_centre = dx - chords.centre[node]
        chord = _interpolate(table[0], (from_centre - chords.reach[node]) / blur) - _interpolate(
            table[0], (from_centre + chords.reach[node]) / blur
        )
        total += chords.weight[node] * chord * chords.cosine[node]
    return total * factor / blur


@kernel()
@no_type_check
def _along_normals(
    dot: _Ellipse,
    first: int,
    x: float,
    dy: float,
    table: np.ndarray,
    work: np.ndarray,
    parts: np.ndarray,
    count: int,
) -> None:
    """The blurred ellipse at pixels of a row, where its boundary is nearly straight.

    All but the look-up in the table becomes SIMD instructions.

    Args:
        dot: the ellipse.
        first: column of the first pixel.
        x, dy: column of the centre, and row of the pixels from there.
        table: see `profile_table`.
        work: (4, k) work space.
        parts: (k,) result.
        count: number of pixels.
    """
    mxx, mxy, myy, blur, inner, outer = dot.mxx, dot.mxy, dot.myy, dot.blur, dot.inner, dot.outer
    determinant, last = mxx * myy - mxy * mxy, table.shape[1] - 1
    place, bend, fixed, is_edge = work[0], work[1], work[2], work[3]
    for n in range(count):
        dx = (first + n) - x
        square = mxx * dx * dx + 2.0 * mxy * dx * dy + myy * dy * dy
        gx, gy = mxx * dx + mxy * dy, mxy * dx + myy * dy
        level = math.sqrt(max(dx * gx + dy * gy, 1e-30))
        steepness = math.sqrt(gx * gx + gy * gy) / level
        scaled = (level - 1.0) / steepness / blur
        place[n] = min(max((scaled + REACH) * TABLE_STEPS, 0.0), float(last))
        curvature = determinant / steepness**3  # infinite in the centre
        is_out, is_in = scaled >= REACH or square > outer, scaled <= -REACH or square <= inner
        is_on_edge = not (is_in or is_out)
        bend[n] = 0.5 * blur * curvature if is_on_edge else 0.0
        is_edge[n] = 1.0 if is_on_edge else 0.0
        fixed[n] = 1.0 if is_in and not is_out else 0.0
    below, density = table[0], table[1]
    for n in range(count):
        index = u64(min(int(place[n]), last - 1))
        share = place[n] - index
        edge = (1.0 - share) * below[index] + share * below[index + u64(1)]
        bell = (1.0 - share) * density[index] + share * density[index + u64(1)]
        parts[n] = fixed[n] + is_edge[n] * (edge - bend[n] * bell)


@kernel(forceinline=True)
@no_type_check
def _ellipse(shape: np.ndarray, area: float, blur: float) -> _Ellipse:
    """The ellipse of a shape (2, 2) with a determinant that is not 0."""
    a, b, c, d = shape[0, 0], shape[0, 1], shape[1, 0], shape[1, 1]
    ixx, ixy, iyx, iyy = d / area, -b / area, -c / area, a / area
    mxx, mxy, myy = ixx * ixx + iyx * iyx, ixx * ixy + iyx * iyy, ixy * ixy + iyy * iyy
    spread = 0.5 * (mxx + myy) + math.sqrt(0.25 * (mxx - myy) ** 2 + mxy * mxy)
    minor = 1.0 / math.sqrt(spread)
    is_small = blur * abs(area) > SMALL * minor**3  # |area| / minor^3 is the largest curvature
    inner = max(1.0 - REACH * blur / minor, 0.0) ** 2
    outer = (1.0 + REACH * blur / minor) ** 2
    reach_x, reach_y = math.hypot(a, b) + REACH * blur, math.hypot(c, d) + REACH * blur
    return _Ellipse(ixx, ixy, iyx, iyy, mxx, mxy, myy, blur, is_small, inner, outer, reach_x, reach_y)


@kernel()
@no_type_check
def add_discs(
    coverage: np.ndarray,
    centre: np.ndarray,
    shape: np.ndarray,
    contrast: np.ndarray,
    cut: np.ndarray,
    blurs: np.ndarray,
    table: np.ndarray,
) -> None:
    """Lay blurred ellipses over a coverage, one after the other.

    Args:
        coverage: (h, w) float32, changed.
        centre: (n, 2) px.
        shape: (n, 2, 2) image from unit disc, px.
        contrast: (n,).
        cut: (n, 3) the part that is printed, see `render_discs`.
        blurs: (n,) px.
        table: see `profile_table`.
    """
    rows, columns = coverage.shape
    nodes = NODES.shape[0]
    chords = _Chords(np.empty(nodes), np.empty(nodes), np.empty(nodes), np.empty(nodes))
    work, parts = np.empty((4, columns)), np.empty(columns)
    for number in range(centre.shape[0]):
        x, y = centre[number, 0], centre[number, 1]
        area = shape[number, 0, 0] * shape[number, 1, 1] - shape[number, 0, 1] * shape[number, 1, 0]
        if not (area != 0.0 and math.isfinite(area + x + y)):
            continue
        dot = _ellipse(shape[number], area, blurs[number])
        cut_x, cut_y, cut_at = cut[number, 0], cut[number, 1], cut[number, 2]
        normal_px = math.hypot(cut_x * dot.ixx + cut_y * dot.iyx, cut_x * dot.ixy + cut_y * dot.iyy)
        first_row, last_row = max(math.ceil(y - dot.reach_y), 0), math.floor(y + dot.reach_y) + 1
        first_column, last_column = max(math.ceil(x - dot.reach_x), 0), math.floor(x + dot.reach_x) + 1
        for row in range(first_row, min(last_row, rows)):
            dy = row - y
            factor = 1.0
            if dot.is_small:
                factor = _find_chords(dy, dot, table, chords)
                if factor == 0.0:
                    continue
            count = max(min(last_column, columns) - first_column, 0)
            if dot.is_small:
                for n in range(count):
                    dx = (first_column + n) - x
                    square = dot.mxx * dx * dx + 2.0 * dot.mxy * dx * dy + dot.myy * dy * dy
                    parts[n] = (
                        0.0 if square > dot.outer else _over_chords(dx, dot.blur, factor, table, chords)
                    )
            else:
                _along_normals(dot, first_column, x, dy, table, work, parts, count)
            if normal_px > 0.0 and math.isfinite(cut_at):
                for n in range(count):
                    dx = (first_column + n) - x
                    along_x, along_y = dot.ixx * dx + dot.ixy * dy, dot.iyx * dx + dot.iyy * dy
                    along = cut_x * along_x + cut_y * along_y
                    parts[n] *= _interpolate(table[0], (along - cut_at) / normal_px / dot.blur)
            for n in range(count):
                column = first_column + n
                coverage[row, column] += (1.0 - coverage[row, column]) * parts[n] * contrast[number]


@kernel()
@no_type_check
def _mix_bits(word: np.uint64) -> np.uint64:
    """SplitMix64's finaliser (Steele, Lea and Flood 2014, doi:10.1145/2660193.2660195)."""
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


class Levels(NamedTuple):
    """Grey levels of 255 of each channel, and the light on them; float32.

    Attributes:
        ground, dot: (c,).
        light: (4,) tilt_x, tilt_y, vignetting, gain.
    """

    ground: np.ndarray
    dot: np.ndarray
    light: np.ndarray


class Spots(NamedTuple):
    """Patches of light and of shadow as outer products of factors over columns and over rows; float32.

    Attributes:
        glare_x, shadow_x: (s, w).
        glare_y, shadow_y: (s, h).
    """

    glare_x: np.ndarray
    glare_y: np.ndarray
    shadow_x: np.ndarray
    shadow_y: np.ndarray


class Noise(NamedTuple):
    """Noise of a picture.

    Attributes:
        is_noisy: whether there is any.
        seed: of the picture.
        variance: (2,) float32, constant part and part per grey level.
        quantiles: (65536,) float32, see `normal_quantiles`.
    """

    is_noisy: bool
    seed: np.uint64
    variance: np.ndarray
    quantiles: np.ndarray


@kernel()
@no_type_check
def photograph(
    pixels: np.ndarray,
    coverage: np.ndarray,
    levels: Levels,
    spots: Spots,
    noise: Noise,
    scale: np.float32,
) -> None:
    """Fill pixels with a coverage between ground and dot, lit and noisy.

    The noise of a pixel depends on the seed and its place alone. Each loop over a row does one thing, so that
    it becomes SIMD instructions.

    Args:
        pixels: (h, w, c) uint8 or uint16, filled.
        coverage: (h, w) float32, 0 to 1.
        levels: of ground and dots, and their light.
        spots: added light and shadows.
        noise: of the picture.
        scale: 1 for uint8, 257 for uint16.
    """
    rows, columns, channels = pixels.shape
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    largest = np.float32(255.0) * scale
    tilt_x, tilt_y, vignetting, gain = levels.light[0], levels.light[1], levels.light[2], levels.light[3]
    constant, per_level = noise.variance[0], noise.variance[1]
    start = _mix_bits(noise.seed + np.uint64(0x9E3779B97F4A7C15))
    tilted, x2 = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for column in range(columns):
        x = np.float32((2 * column + 1 - columns) / columns)
        tilted[column], x2[column] = tilt_x * x, x * x
    bright, added, level = (
        np.empty(columns, np.float32),
        np.empty(columns, np.float32),
        np.empty(columns, np.float32),
    )
    for row in range(rows):
        y = np.float32((2 * row + 1 - rows) / rows)
        y2, tilted_y = y * y, tilt_y * y
        for column in range(columns):
            light = gain * (one + tilted[column] + tilted_y)
            bright[column] = light * (one - vignetting * half * (x2[column] + y2))
            added[column] = zero
        for spot in range(spots.shadow_x.shape[0]):
            for column in range(columns):
                bright[column] *= one - spots.shadow_x[spot, column] * spots.shadow_y[spot, row]
        for spot in range(spots.glare_x.shape[0]):
            for column in range(columns):
                added[column] += spots.glare_x[spot, column] * spots.glare_y[spot, row]
        for channel in range(channels):
            ground = levels.ground[channel]
            contrast = levels.dot[channel] - ground
            for column in range(columns):
                level[column] = (ground + contrast * coverage[row, column]) * bright[column] + added[column]
            if noise.is_noisy:
                first = np.uint64(row * columns * channels + channel)
                for column in range(columns):
                    place = first + np.uint64(column) * np.uint64(channels)
                    word = _mix_bits(start + place * np.uint64(0x9E3779B97F4A7C15))
                    variance = constant + per_level * max(level[column], zero)
                    level[column] += math.sqrt(variance) * noise.quantiles[word >> np.uint64(48)]
            for column in range(columns):
                pixels[row, column, channel] = min(max(level[column] * scale + half, zero), largest)
