"""The outline of a blob, along rays from its middle: is it a dot, or only a gap, an edge, a ridge?

A dot's brightness falls to the ground in every direction. Between dots, along ridges, at edges and in
corners there are directions in which it does not.
"""

# ruff: noqa: PLR0912, PLR0915, PLR0917 - compiled functions are long and called with positional arguments

import math
from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.values.arrays import Points2, Scalars

RAYS = 24
STEPS = 26
REACH = 2.6  # radii
FITTING_RADIUS_PX = 4.0  # octave in which rays are sampled: radius at least this, where there is one


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Outlines:
    """What rays tell of blobs; NaN where nothing could be told.

    Attributes:
        place_px: (n, 2) centroid of the outline.
        radius_px: (n,) of the disc of the same area.
        contrast: (n,) level of the core against the ground, grey levels of 255, positive.
        openness: (n,) share of the directions without a fall.
        aspect: (n,) long against short axis of the outline.
        fill: (n,) share of the outline's area that is lighter than half the contrast; a glint lowers it
            little, the gap between two dots much.
        roughness: (n,) deviation of the outline from an ellipse, in radii.
        visible: (n,) share of the rays that stay within the image.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars
    openness: Scalars
    aspect: Scalars
    roughness: Scalars
    visible: Scalars
    fill: Scalars

    def at(self, chosen: np.ndarray) -> "Outlines":
        """Some of them."""
        return Outlines(**{name: getattr(self, name)[chosen] for name in self.__slots__})


def outlines(pyramid: list[np.ndarray], place_px: Points2, radius_px: Scalars, sign: float) -> Outlines:
    """Outlines of blobs of one sign, by rays through the octaves of a pyramid."""
    octave = np.floor(np.log2(np.maximum(radius_px / FITTING_RADIUS_PX, 1.0))).astype(int)
    octave = np.minimum(octave, len(pyramid) - 1)
    rows = np.full((len(place_px), 9), np.nan)
    for level, image in enumerate(pyramid):
        chosen = np.flatnonzero(octave == level)
        if len(chosen) == 0:
            continue
        scale = 2.0**level
        part = np.full((len(chosen), 9), np.nan)
        _trace_all(image, place_px[chosen] / scale, radius_px[chosen] / scale, sign, part)
        part[:, :3] *= scale
        rows[chosen] = part
    return Outlines(
        place_px=rows[:, :2].copy(),
        radius_px=rows[:, 2].copy(),
        contrast=rows[:, 3].copy(),
        openness=rows[:, 4].copy(),
        aspect=rows[:, 5].copy(),
        roughness=rows[:, 6].copy(),
        visible=rows[:, 7].copy(),
        fill=rows[:, 8].copy(),
    )


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _bilinear(image, x, y):
    height, width = image.shape
    x, y = min(max(x, 0.0), width - 1.001), min(max(y, 0.0), height - 1.001)
    u, v = int(x), int(y)
    a, b = x - u, y - v
    return (1.0 - b) * ((1.0 - a) * image[v, u] + a * image[v, u + 1]) + b * (
        (1.0 - a) * image[v + 1, u] + a * image[v + 1, u + 1]
    )


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _sample(image, x, y, radius, sign, values, known):
    """Values (RAYS, STEPS) along rays; `known` = number of steps of each ray within the image."""
    height, width = image.shape
    for ray in range(RAYS):
        angle = 2.0 * math.pi * ray / RAYS
        known[ray] = STEPS
        for step in range(STEPS):
            distance = REACH * radius * (step + 0.5) / STEPS
            u, v = x + distance * math.cos(angle), y + distance * math.sin(angle)
            if u < -0.5 or v < -0.5 or u > width - 0.5 or v > height - 0.5:
                known[ray] = min(known[ray], step)
            values[ray, step] = sign * _bilinear(image, u, v)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _trace_one(image, x, y, radius, sign, values, known, lengths, row):
    """One outline: row as in `Outlines`, fill last."""
    _sample(image, x, y, radius, sign, values, known)
    inside = int(STEPS * 1.0 / REACH)
    core, best = -1e9, 0
    column = np.empty(RAYS)
    for step in range(inside):
        count = 0
        for ray in range(RAYS):
            if known[ray] > step:
                column[count] = values[ray, step]
                count += 1
        if count >= RAYS // 3:
            middle = np.sort(column[:count])[count // 2]
            if middle > core:
                core, best = middle, step
    falls = np.full(RAYS, np.nan)
    sorted_falls = np.empty(RAYS)
    whole = 0
    for ray in range(RAYS):
        if known[ray] < int(0.7 * STEPS):
            continue
        low = 1e9
        for step in range(best, known[ray]):
            low = min(low, values[ray, step])
        falls[ray] = core - low
        sorted_falls[whole] = falls[ray]
        whole += 1
    row[7] = whole / RAYS
    if whole < RAYS // 3:
        return False
    contrast = np.sort(sorted_falls[:whole])[whole // 2]
    if contrast <= 0.0:
        return False
    open_rays = 0
    for ray in range(RAYS):
        lengths[ray] = np.nan
        if not math.isfinite(falls[ray]):
            continue
        if falls[ray] < 0.5 * contrast:
            open_rays += 1
            continue
        level = core - 0.5 * min(falls[ray], 1.5 * contrast)
        for step in range(best, known[ray]):
            if values[ray, step] < level:
                part = 0.0
                if step > 0 and values[ray, step - 1] > level:
                    part = (values[ray, step - 1] - level) / (values[ray, step - 1] - values[ray, step]) - 1.0
                lengths[ray] = REACH * radius * (max(step + part, 0.0) + 0.5) / STEPS
                break
    row[3], row[4] = contrast, open_rays / whole
    for ray in range(RAYS):
        # open on opposite sides: a ridge, a cable, a stripe; what leaves the image may be one as well
        for turn in range(RAYS // 2 - 1, RAYS // 2 + 2):
            opposite = falls[(ray + turn) % RAYS]
            if falls[ray] < 0.65 * contrast and not opposite >= 0.65 * contrast:
                row[4] = max(row[4], 0.5)
    # a ray that left the image, or did not fall, is as long as its opposite, or as the middle one
    count = 0
    for ray in range(RAYS):
        if math.isfinite(lengths[ray]):
            column[count] = lengths[ray]
            count += 1
    if count < RAYS // 4:
        return False
    typical = np.sort(column[:count])[count // 2]
    area = sum_x = sum_y = 0.0
    for ray in range(RAYS):
        if not math.isfinite(lengths[ray]):
            lengths[ray] = typical
        angle = 2.0 * math.pi * ray / RAYS
        area += 0.5 * lengths[ray] ** 2
        sum_x += lengths[ray] ** 3 / 3.0 * math.cos(angle)
        sum_y += lengths[ray] ** 3 / 3.0 * math.sin(angle)
    row[0], row[1] = x + sum_x / area, y + sum_y / area
    row[2] = math.sqrt(2.0 * area / RAYS)
    light = total = 0.0
    for ray in range(RAYS):
        for step in range(known[ray]):
            distance = REACH * radius * (step + 0.5) / STEPS
            if distance < lengths[ray]:
                total += distance
                if values[ray, step] > core - 0.5 * contrast:
                    light += distance
    row[8] = light / total if total > 0.0 else 0.0
    return True


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _shape(lengths, row):
    """Aspect and roughness from the lengths' harmonics: 1st is a shift, 2nd an ellipse."""
    mean = c1 = s1 = c2 = s2 = 0.0
    for ray in range(RAYS):
        angle = 2.0 * math.pi * ray / RAYS
        mean += lengths[ray] / RAYS
        c1 += 2.0 * lengths[ray] * math.cos(angle) / RAYS
        s1 += 2.0 * lengths[ray] * math.sin(angle) / RAYS
        c2 += 2.0 * lengths[ray] * math.cos(2.0 * angle) / RAYS
        s2 += 2.0 * lengths[ray] * math.sin(2.0 * angle) / RAYS
    rest = 0.0
    for ray in range(RAYS):
        angle = 2.0 * math.pi * ray / RAYS
        smooth = (
            mean
            + c1 * math.cos(angle)
            + s1 * math.sin(angle)
            + c2 * math.cos(2 * angle)
            + s2 * math.sin(2 * angle)
        )
        rest += (lengths[ray] - smooth) ** 2
    ellipse = min(math.hypot(c2, s2) / mean, 0.9)
    row[5] = (1.0 + ellipse) / (1.0 - ellipse)
    row[6] = math.sqrt(rest / RAYS) / mean


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _trace_all(image, place, radius, sign, rows):
    values, known, lengths = np.empty((RAYS, STEPS)), np.empty(RAYS, dtype=np.int64), np.empty(RAYS)
    row = np.empty(9)
    for i in range(place.shape[0]):
        x, y, size = place[i, 0], place[i, 1], radius[i]
        for _ in range(3):
            if not _trace_one(image, x, y, size, sign, values, known, lengths, row):
                rows[i] = np.nan
                break
            _shape(lengths, row)
            rows[i] = row
            shift = math.hypot(row[0] - x, row[1] - y)
            if shift < 0.1 * size and 0.8 < row[2] / size < 1.25:
                break
            limit = min(max(row[2], 0.5 * size), 1.6 * size)
            step = min(1.0, 0.8 * size / max(shift, 1e-9))
            x, y, size = x + step * (row[0] - x), y + step * (row[1] - y), max(limit, 1.0)
