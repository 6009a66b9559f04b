"""What all dots of a picture together say of its noise and light, and each one's covariance, compiled.

Light's own noise grows with its level: the grounds around the dots and the dots' cores show how. How uneven
light usually is shows in the slopes of all cores; that of one, which is noisy, is shrunk accordingly.
See docs/derivations/detection.md.
"""

import math
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.compilation import LEAF
from manytouch.detection.light import core_reach

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


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _usual(note, out, column, level):
    """Mean variance of ground or core without outliers, and its mean grey level; -1 where none is known."""
    limit, variance, grey = np.inf, -1.0, 0.0
    for _ in range(3):
        total = total_grey = 0.0
        number = 0
        for i in range(note.shape[0]):
            one = column == CORE and note[i, CORE_SPREAD] == 0.0
            most = (OUTLIER_OF_ONE if one else OUTLIER) * limit
            if not np.isnan(out[i, 0]) and 0.0 <= note[i, column] <= most:
                total += note[i, column]
                total_grey += note[i, GROUND] + level * note[i, HEIGHT]
                number += 1
        if number == 0:
            break
        variance, grey = total / number, total_grey / number
        limit = variance
    return variance, grey


@njit(**LEAF)
@no_type_check
def _slope2(note, i, radius):
    """Mean square, along an axis, of what a core's slope makes of its contrast over a radius."""
    share = radius / note[i, HEIGHT]
    return 0.5 * share * share * (note[i, RISE_X] * note[i, RISE_X] + note[i, RISE_Y] * note[i, RISE_Y])


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _evenness(note, out, radius, core):
    """The usual `_slope2` without what noise makes of it, and that from which on one is not usual."""
    limit, usual = np.inf, EVEN * EVEN
    for _ in range(3):
        all_squares, noisy, number = EVEN_DOTS * EVEN * EVEN, 0.0, EVEN_DOTS
        for i in range(note.shape[0]):
            if not np.isnan(out[i, 0]) and note[i, CORE_SPREAD] > 0.0:
                square = _slope2(note, i, radius[i])
                if square <= limit:
                    share = radius[i] / note[i, HEIGHT]
                    all_squares += square
                    noisy += 2.0 * share * share * core / note[i, CORE_SPREAD]
                    number += 1.0
        limit = STEEP * all_squares / number
        usual = max(all_squares - noisy, EVEN_DOTS * EVEN * EVEN) / number
    return usual, limit


@njit(**LEAF)
@no_type_check
def _is_clear(note, i, radius):
    """Is the core free of the dot's edge, however the dot was squeezed?"""
    middle, half = 0.5 * (note[i, EXX] + note[i, EYY]), 0.5 * (note[i, EXX] - note[i, EYY])
    off = math.sqrt(half * half + note[i, EXY] * note[i, EXY])
    # the half axes of an ellipse are as the roots of its moments
    least = math.sqrt(note[i, AREA] / math.pi * math.sqrt(max(middle - off, 0.0) / (middle + off)))
    return least > core_reach(radius) + CLEAR


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def settle(note, radius, least, is_light, out):
    """Adds to `out`, rows of `kernels.measure_dots`, what noise and the slopes of the light do to centres.

    Args:
        note: of all dots, as `take_note` left them.
        radius: expected ones.
        least: smallest variance of a pixel.
        is_light: does a dot's core get more light than its ground?
        out: centres and covariances are changed.
    """
    ground, ground_grey = _usual(note, out, VARIANCE, 0.0)
    core, core_grey = _usual(note, out, CORE, 1.0)
    ground = max(ground, least)
    core = ground if core < 0.0 else max(core, least)
    if (core < ground) == is_light:
        # noise does not fall with light: one of them is clipped, and tells nothing
        core = ground = max(core, ground)
    growth = (core - ground) / max(core_grey - ground_grey, 1.0)
    even, steep = _evenness(note, out, radius, core)
    for i in range(note.shape[0]):
        if np.isnan(out[i, 0]):
            continue
        height, exx, exy, eyy = note[i, HEIGHT], note[i, EXX], note[i, EXY], note[i, EYY]
        here = max(ground + growth * (note[i, GROUND] - ground_grey), least)
        there = max(here + growth * height, least)
        if note[i, VARIANCE] > TEXTURE * here:
            there += note[i, VARIANCE] - here
            here = note[i, VARIANCE]
        scale = note[i, SCALE]
        slopes = 2.0 * here / note[i, SPREAD] if note[i, SPREAD] > 0.0 else 0.0
        if note[i, CORE_SPREAD] > 0.0:
            expected, noisy = even * (height / radius[i]) ** 2, 2.0 * there / note[i, CORE_SPREAD]
            is_steep = _slope2(note, i, radius[i]) > steep and _is_clear(note, i, radius[i])
            share = 1.0 if is_steep else expected / (expected + noisy)
            slopes += share * noisy
            back = 0.5 * scale * (1.0 - share)
            out[i, 0] += back * (exx * note[i, RISE_X] + exy * note[i, RISE_Y])
            out[i, 1] += back * (exy * note[i, RISE_X] + eyy * note[i, RISE_Y])
        passed = 0.0
        threshold = LOW * height
        if threshold * threshold < 36.0 * max(here, there):
            rest = max(note[i, WINDOW] - 0.5 * (exx + eyy), 0.0)
            inside = note[i, AREA] * note[i, AREA] / (4.0 * math.pi) - 0.25 * (exx + eyy)
            inside = min(max(inside, 0.0), rest)
            passed = (rest - inside) * here * _tail(threshold / math.sqrt(here))
            passed += inside * there * _tail(threshold / math.sqrt(there))
        edge, tilt = 0.5 * (here + there), 0.25 * slopes
        scale *= scale
        out[i, 2] += scale * (edge * exx + passed + tilt * (exx * exx + exy * exy))
        out[i, 3] += scale * (edge * exy + tilt * exy * (exx + eyy))
        out[i, 4] += scale * (edge * eyy + passed + tilt * (eyy * eyy + exy * exy))
