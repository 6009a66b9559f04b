"""What all dots of a picture together say of its noise and light, and each one's covariance, compiled.

Light's own noise grows with its level: the grounds around the dots and the dots' cores show how. How uneven
light usually is shows in the slopes of all cores; that of one, which is noisy, is shrunk accordingly.
See docs/derivations/detection.md.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import FAST, LEAF
from manytouch.detection.measurement.background_fit import core_reach

LOW, HIGH = 0.15, 0.85  # soft threshold on the share of dot in a pixel
GAIN = 1.0 / (HIGH - LOW)
# places in a note: second moments of edge and window, GAIN / (height area), area; then as in `light`
NOTES = 14
EXX, EXY, EYY, WINDOW, SCALE, AREA, GROUND = range(7)
HEIGHT, RISE_X, RISE_Y, VARIANCE, SPREAD, CORE_SPREAD, CORE = range(7, NOTES)
EVEN = 0.03  # of the contrast: change of light over a radius that is usual,
EVEN_DOTS = 1.0  # known from so many dots
STEEP = 9.0  # of the mean square of a slope; noise reaches it once in 8000 dots
CLEAR = 1.9  # px between core and rim
# of the mean variance: 64 plain pixels seldom reach the first, a single square the second
OUTLIER, OUTLIER_OF_ONE = 1.6, 9.0
TEXTURE = 2.0  # of the usual variance: from where on a ground is rough in itself


@njit(**LEAF)
@no_type_check
def take_note(sums, light, reach2, note):
    """What `settle` has to know of a dot; see `kernels._moments` and `light.fit_light`."""
    dx, dy, count = sums[1] / sums[0], sums[2] / sums[0], sums[3]
    note[EXX] = sums[6] - 2.0 * dx * sums[4] + count * dx * dx
    note[EYY] = sums[8] - 2.0 * dy * sums[5] + count * dy * dy
    note[EXY] = sums[7] - dx * sums[5] - dy * sums[4] + count * dx * dy
    note[WINDOW] = 0.25 * math.pi * reach2 * reach2
    note[SCALE], note[AREA] = GAIN / (light[3] * sums[0]), sums[0]
    note[GROUND], note[HEIGHT], note[RISE_X], note[RISE_Y] = light[0], light[3], light[4], light[5]
    note[VARIANCE], note[SPREAD], note[CORE_SPREAD], note[CORE] = light[6], light[7], light[8], light[9]


@njit(**LEAF)
@no_type_check
def _tail(z):
    """E[max(n - z, 0)^2] of a standard normal n: noise that passes the soft threshold."""
    if z > 6.0:
        return 0.0
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return (1.0 + z * z) * 0.5 * math.erfc(z / math.sqrt(2.0)) - z * density


@njit(**LEAF)
@no_type_check
def take_nothing(note):
    """For `settle`, where there is no dot."""
    note[:] = 0.0
    note[VARIANCE] = note[CORE] = -1.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _sums_within(variance, ground, height, spread, level, limit, limit_of_one):
    """Number of the variances (n,) within their limit, and sums of them and of their grey levels."""
    number = total = grey = 0.0
    for i in range(np.uint64(len(variance))):
        most = limit if spread[i] > 0.0 else limit_of_one
        is_usual = 0.0 <= variance[i] <= most
        number += 1.0 if is_usual else 0.0
        total += variance[i] if is_usual else 0.0
        grey += ground[i] + level * height[i] if is_usual else 0.0
    return number, total, grey


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _usual(note, column, level):
    """Mean variance of ground or core without outliers, and its mean grey level; -1 where none is known."""
    limit, variance, grey = np.inf, -1.0, 0.0
    of_one = OUTLIER_OF_ONE if column == CORE else OUTLIER
    for _ in range(3):
        number, total, total_grey = _sums_within(
            note[column],
            note[GROUND],
            note[HEIGHT],
            note[CORE_SPREAD],
            level,
            OUTLIER * limit,
            of_one * limit,
        )
        if number == 0.0:
            break
        variance, grey = total / number, total_grey / number
        limit = variance
    return variance, grey


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _slopes(height, rise_x, rise_y, spread, radius, core, square, noisy):
    """Mean squares (n,), along an axis, of what the cores' slopes, and noise in them, make over a radius.

    In parts of the contrast; the first is -1 where no slope is known. `core` is the usual variance there.
    """
    for i in range(np.uint64(len(height))):
        share = radius[i] / height[i]
        share *= share
        is_known = spread[i] > 0.0
        square[i] = 0.5 * share * (rise_x[i] * rise_x[i] + rise_y[i] * rise_y[i]) if is_known else -1.0
        noisy[i] = 2.0 * share * core / spread[i] if is_known else 0.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
@no_type_check
def _slopes_within(square, noisy, limit):
    """Number of the slopes within the limit, and sums of their squares and of the noise in these."""
    number = squares = noise = 0.0
    for i in range(np.uint64(len(square))):
        is_usual = 0.0 <= square[i] <= limit
        number += 1.0 if is_usual else 0.0
        squares += square[i] if is_usual else 0.0
        noise += noisy[i] if is_usual else 0.0
    return number, squares, noise


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _evenness(square, noisy):
    """The usual mean square of a slope without what noise makes of it, and that from which on one is not."""
    limit, usual = np.inf, EVEN * EVEN
    for _ in range(3):
        number, squares, noise = _slopes_within(square, noisy, limit)
        number, squares = number + EVEN_DOTS, squares + EVEN_DOTS * EVEN * EVEN
        limit = STEEP * squares / number
        usual = max(squares - noise, EVEN_DOTS * EVEN * EVEN) / number
    return usual, limit


@njit(**LEAF)
@no_type_check
def _is_clear(exx, exy, eyy, area, radius):
    """Is the core free of the dot's edge, however the dot was squeezed?"""
    middle, half = 0.5 * (exx + eyy), 0.5 * (exx - eyy)
    off = math.sqrt(half * half + exy * exy)
    # the half axes of an ellipse are as the roots of its moments
    least = math.sqrt(area / math.pi * math.sqrt(max(middle - off, 0.0) / (middle + off)))
    return least > core_reach(radius) + CLEAR


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def settle(note, radius, least, is_light, out):
    """Adds to `out`, rows of `kernels.measure_dots`, what noise and the slopes of the light do to centres.

    Args:
        note: (NOTES, n) of all dots, as `take_note` and `take_nothing` left them.
        radius: expected ones.
        least: smallest variance of a pixel.
        is_light: does a dot's core get more light than its ground?
        out: centres and covariances are changed.
    """
    ground, ground_grey = _usual(note, VARIANCE, 0.0)
    core, core_grey = _usual(note, CORE, 1.0)
    ground = max(ground, least)
    core = ground if core < 0.0 else max(core, least)
    if (core < ground) == is_light:
        # noise does not fall with light: one of them is clipped, and tells nothing
        core = ground = max(core, ground)
    growth = (core - ground) / max(core_grey - ground_grey, 1.0)
    square, noisy = np.empty(len(out)), np.empty(len(out))
    _slopes(note[HEIGHT], note[RISE_X], note[RISE_Y], note[CORE_SPREAD], radius, core, square, noisy)
    even, steep = _evenness(square, noisy)
    for i in range(len(out)):
        if np.isnan(out[i, 0]):
            continue
        height, exx, exy, eyy = note[HEIGHT, i], note[EXX, i], note[EXY, i], note[EYY, i]
        here = max(ground + growth * (note[GROUND, i] - ground_grey), least)
        there = max(here + growth * height, least)
        if note[VARIANCE, i] > TEXTURE * here:
            there += note[VARIANCE, i] - here
            here = note[VARIANCE, i]
        scale = note[SCALE, i]
        slopes = 2.0 * here / note[SPREAD, i] if note[SPREAD, i] > 0.0 else 0.0
        if note[CORE_SPREAD, i] > 0.0:
            expected, noise = even * (height / radius[i]) ** 2, 2.0 * there / note[CORE_SPREAD, i]
            is_steep = square[i] > steep and _is_clear(exx, exy, eyy, note[AREA, i], radius[i])
            share = 1.0 if is_steep else expected / (expected + noise)
            slopes += share * noise
            back = 0.5 * scale * (1.0 - share)
            out[i, 0] += back * (exx * note[RISE_X, i] + exy * note[RISE_Y, i])
            out[i, 1] += back * (exy * note[RISE_X, i] + eyy * note[RISE_Y, i])
        passed = 0.0
        threshold = LOW * height
        if threshold * threshold < 36.0 * max(here, there):
            rest = max(note[WINDOW, i] - 0.5 * (exx + eyy), 0.0)
            inside = note[AREA, i] * note[AREA, i] / (4.0 * math.pi) - 0.25 * (exx + eyy)
            inside = min(max(inside, 0.0), rest)
            passed = (rest - inside) * here * _tail(threshold / math.sqrt(here))
            passed += inside * there * _tail(threshold / math.sqrt(there))
        edge, tilt = 0.5 * (here + there), 0.25 * slopes
        scale *= scale
        out[i, 2] += scale * (edge * exx + passed + tilt * (exx * exx + exy * exy))
        out[i, 3] += scale * (edge * exy + tilt * exy * (exx + eyy))
        out[i, 4] += scale * (edge * eyy + passed + tilt * (eyy * eyy + exy * exy))
