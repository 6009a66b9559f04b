"""The renderer's loops over pixels, compiled; see `render` for what they mean."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments
# no_type_check keeps checkers of annotations, which numba cannot compile, out of them

import math
from functools import cache
from typing import no_type_check

import numpy as np
from numba import njit
from scipy.special import ndtr, ndtri

REACH = 4.5  # standard deviations beyond which the point spread is nothing
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


@njit(cache=True)
@no_type_check
def _looked_up(row: np.ndarray, x: float) -> float:
    place = (x + REACH) * TABLE_STEPS
    if place <= 0.0:
        return float(row[0])
    index = int(place)
    if index >= row.shape[0] - 1:
        return float(row[-1])
    share = place - index
    return float((1.0 - share) * row[index] + share * row[index + 1])


@njit(cache=True)
@no_type_check
def _over_chords(
    dx: float, dy: float, mxx: float, mxy: float, determinant: float, blur: float, table: np.ndarray
) -> float:
    """The blurred ellipse at (dx, dy) from its centre: its chords along x, weighted over y."""
    extent = math.sqrt(mxx / determinant)
    low = max((dy - REACH * blur) / extent, -1.0)
    high = min((dy + REACH * blur) / extent, 1.0)
    if low >= high:
        return 0.0
    begin, end = math.asin(low), math.asin(high)
    middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
    total = 0.0
    for node in range(NODES.shape[0]):
        angle = middle + half * NODES[node]
        y, cosine = extent * math.sin(angle), math.cos(angle)
        centre, reach = -mxy * y / mxx, cosine / math.sqrt(mxx)
        chord = _looked_up(table[0], (dx - centre - reach) / blur) - _looked_up(
            table[0], (dx - centre + reach) / blur
        )
        total += WEIGHTS[node] * _looked_up(table[1], (dy - y) / blur) * chord * cosine
    return total * half * extent / blur


@njit(cache=True)
@no_type_check
def _along_normal(
    dx: float, dy: float, mxx: float, mxy: float, myy: float, blur: float, table: np.ndarray
) -> float:
    """The blurred ellipse at (dx, dy) from its centre, where its boundary is nearly straight."""
    gx, gy = mxx * dx + mxy * dy, mxy * dx + myy * dy
    level = math.sqrt(max(dx * gx + dy * gy, 1e-30))
    steepness = math.sqrt(gx * gx + gy * gy) / level
    scaled = (level - 1.0) / steepness / blur
    if scaled >= REACH:
        return 0.0
    if scaled <= -REACH:
        return 1.0
    curvature = (mxx * myy - mxy * mxy) / steepness**3
    return _looked_up(table[0], scaled) - 0.5 * blur * curvature * _looked_up(table[1], scaled)


@njit(cache=True)
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
    """Lay blurred ellipses over a coverage (h, w), one after the other."""
    rows, columns = coverage.shape
    for dot in range(centre.shape[0]):
        blur = blurs[dot]
        a, b, c, d = shape[dot, 0, 0], shape[dot, 0, 1], shape[dot, 1, 0], shape[dot, 1, 1]
        area = a * d - b * c
        if not (area != 0.0 and math.isfinite(area + centre[dot, 0] + centre[dot, 1])):
            continue
        ixx, ixy, iyx, iyy = d / area, -b / area, -c / area, a / area  # unit disc from image
        mxx, mxy, myy = ixx * ixx + iyx * iyx, ixx * ixy + iyx * iyy, ixy * ixy + iyy * iyy
        spread = 0.5 * (mxx + myy) + math.sqrt(0.25 * (mxx - myy) ** 2 + mxy * mxy)
        minor = 1.0 / math.sqrt(spread)
        is_small = blur * abs(area) > SMALL * minor**3  # |area| / minor^3 is the largest curvature
        inner = max(1.0 - REACH * blur / minor, 0.0) ** 2
        outer = (1.0 + REACH * blur / minor) ** 2
        reach_x, reach_y = math.hypot(a, b) + REACH * blur, math.hypot(c, d) + REACH * blur
        normal_px = math.hypot(cut[dot, 0] * ixx + cut[dot, 1] * iyx, cut[dot, 0] * ixy + cut[dot, 1] * iyy)
        for row in range(
            max(math.ceil(centre[dot, 1] - reach_y), 0), min(math.floor(centre[dot, 1] + reach_y) + 1, rows)
        ):
            dy = row - centre[dot, 1]
            for column in range(
                max(math.ceil(centre[dot, 0] - reach_x), 0),
                min(math.floor(centre[dot, 0] + reach_x) + 1, columns),
            ):
                dx = column - centre[dot, 0]
                square = mxx * dx * dx + 2.0 * mxy * dx * dy + myy * dy * dy
                if square > outer:
                    continue
                part = 1.0
                if is_small:
                    part = _over_chords(dx, dy, mxx, mxy, mxx * myy - mxy * mxy, blur, table)
                elif square > inner:
                    part = _along_normal(dx, dy, mxx, mxy, myy, blur, table)
                if normal_px > 0.0 and math.isfinite(cut[dot, 2]):
                    along = cut[dot, 0] * (ixx * dx + ixy * dy) + cut[dot, 1] * (iyx * dx + iyy * dy)
                    part *= _looked_up(table[0], (along - cut[dot, 2]) / normal_px / blur)
                coverage[row, column] += (1.0 - coverage[row, column]) * part * contrast[dot]


@njit(cache=True)
@no_type_check
def _mixed(word: np.uint64) -> np.uint64:
    """SplitMix64's finaliser (Steele, Lea and Flood 2014, doi:10.1145/2660193.2660195)."""
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@njit(cache=True)
@no_type_check
def photograph(
    pixels: np.ndarray,
    coverage: np.ndarray,
    ground: np.ndarray,
    dot: np.ndarray,
    light: np.ndarray,
    glare_x: np.ndarray,
    glare_y: np.ndarray,
    shadow_x: np.ndarray,
    shadow_y: np.ndarray,
    noise: np.ndarray,
    seed: np.uint64,
    is_noisy: bool,
    quantiles: np.ndarray,
    scale: np.float32,
) -> None:
    """Fill pixels (h, w, c) with a coverage (h, w) between ground and dot, lit and noisy.

    light is (tilt_x, tilt_y, vignetting, gain), noise is (variance, variance per level). The noise of a
    pixel depends on the seed and its place alone.
    """
    rows, columns, channels = pixels.shape
    largest = np.float32(255.0) * scale
    start = _mixed(seed + np.uint64(0x9E3779B97F4A7C15))
    for row in range(rows):
        y = np.float32((2 * row + 1 - rows) / rows)
        for column in range(columns):
            x = np.float32((2 * column + 1 - columns) / columns)
            bright = light[3] * (np.float32(1) + light[0] * x + light[1] * y)
            bright *= np.float32(1) - light[2] * np.float32(0.5) * (x * x + y * y)
            for spot in range(shadow_x.shape[0]):
                bright *= np.float32(1) - shadow_x[spot, column] * shadow_y[spot, row]
            added = np.float32(0)
            for spot in range(glare_x.shape[0]):
                added += glare_x[spot, column] * glare_y[spot, row]
            for channel in range(channels):
                level = (
                    ground[channel] + (dot[channel] - ground[channel]) * coverage[row, column]
                ) * bright + added
                if is_noisy:
                    place = np.uint64((row * columns + column) * channels + channel)
                    word = _mixed(start + place * np.uint64(0x9E3779B97F4A7C15))
                    deviation = math.sqrt(noise[0] + noise[1] * max(level, np.float32(0)))
                    level += deviation * quantiles[word >> np.uint64(48)]
                pixels[row, column, channel] = min(
                    max(level * scale + np.float32(0.5), np.float32(0)), largest
                )
