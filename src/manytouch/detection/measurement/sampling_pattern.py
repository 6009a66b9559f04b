"""Which pixels are looked at around a dot of a given radius, so that loops over them run in vector lanes.

In whole pixels from the middle one: 64 of the ground around the dot, 64 of its core, 64 to walk by, and
a window of strips, 16 columns wide, that covers dot and edge. Similar radii share a plan.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from dataclasses import dataclass, replace
from typing import no_type_check

import numpy as np
from numba import njit

from manytouch.detection.measurement.background_fit import PLANE_RADIUS, core_reach
from manytouch.detection.measurement.simd_strip_sums import STRIP
from manytouch.values.arrays import Scalars

LANES = 64  # of each sample
STEP = 1.03  # between the radii that have a plan of their own
GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
RING, CORE, WALK = 0, 1, 2
FARTHEST, HALF, STRIPS = 3, 4, 5  # places in `count`
# rows of `sample`, LANES long, of ring, core and walk: where a pixel lies, its value, and 1 if it counts
DX, DY, VALUE, USED = np.uint64(0), np.uint64(LANES), np.uint64(2 * LANES), np.uint64(3 * LANES)
ROWS = 4 * LANES
ALL = np.uint64(LANES)  # unsigned numbers need no check for negative ones, so that loops run in lanes


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Plans:
    """Which pixels are looked at around dots of some radii.

    Attributes:
        index: (n,) row of the plan of each radius.
        place: (p, 2, 192) x and y: ring, core, walk.
        mask: (p, k) bits of the window's pixels that count: strip after strip, row after row.
        count: (p, 6) number in ring, core and walk, the farthest place, the window's first row and column
            (less than the middle one), and the number of its strips.
    """

    index: np.ndarray
    place: np.ndarray
    mask: np.ndarray
    count: np.ndarray

    def at(self, chosen: np.ndarray) -> "Plans":
        """Those of some of the radii."""
        return replace(self, index=self.index[chosen])


def plans_of(radius_px: Scalars) -> Plans:
    """Plans for some radii (n,); similar ones share a plan."""
    step = np.rint(np.log(np.maximum(radius_px, 0.3)) / np.log(STEP)).astype(np.int64)
    steps, index = np.unique(step, return_inverse=True)
    radii = STEP ** steps.astype(np.float64)
    largest = float(radii[-1]) if len(radii) else 1.0
    place = np.zeros((len(radii), 2, 3 * LANES), dtype=np.int32)
    mask = np.zeros((len(radii), _strips(largest) * (2 * _half(largest) + 1)), dtype=np.uint16)
    count = np.zeros((len(radii), 6), dtype=np.int32)
    for row, radius in enumerate(radii):
        _plan(radius, place[row], mask[row], count[row])
    return Plans(index=index.astype(np.int32), place=place, mask=mask, count=count)


@njit(cache=True, nogil=True)
@no_type_check
def _half(radius):
    """Rows above the middle one, and columns before it."""
    return int(1.35 * radius + 1.5)


@njit(cache=True, nogil=True)
@no_type_check
def _strips(radius):
    return (2 * _half(radius) + STRIP) // STRIP


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _spread(inner, outer, place, first):
    """Up to LANES different pixels, evenly spread between two radii, inner ones first. Returns how many."""
    count, tries = 0, 2 * LANES
    area = math.pi * (outer * outer - inner * inner)
    wanted = min(LANES, int(area) + 1)
    # twice as many places as lanes are tried, since some fall into the same pixel
    for trial in range(tries):
        if count >= wanted:
            break
        part = ((trial % LANES) + 0.5 * (1 + trial // LANES)) / LANES
        distance = math.sqrt(inner * inner + (outer * outer - inner * inner) * min(part, 1.0))
        u = math.floor(distance * math.cos(trial * GOLDEN) + 0.5)
        v = math.floor(distance * math.sin(trial * GOLDEN) + 0.5)
        is_new = True
        for k in range(count):
            if place[0, first + k] == u and place[1, first + k] == v:
                is_new = False
        if is_new:
            place[0, first + count], place[1, first + count] = u, v
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _plan(radius, place, mask, count):
    """One row of `plans_of`."""
    count[RING] = _spread(1.3 * radius + 1.0, 1.75 * radius + 1.5, place, RING * LANES)
    if radius >= PLANE_RADIUS:
        count[CORE] = _spread(0.0, core_reach(radius), place, CORE * LANES)
    else:
        reach = max(0.5 * radius, 0.9) + 0.75
        number = 0
        for limit in range(int(reach * reach) + 1):
            for v in range(-int(reach), int(reach) + 1):
                for u in range(-int(reach), int(reach) + 1):
                    if u * u + v * v == limit and number < LANES:
                        place[0, CORE * LANES + number], place[1, CORE * LANES + number] = u, v
                        number += 1
        count[CORE] = number
    count[WALK] = _spread(0.0, 1.4 * radius + 0.7, place, WALK * LANES)
    reach, half = 1.35 * radius + 1.5, _half(radius)
    count[HALF], count[STRIPS] = half, _strips(radius)
    count[FARTHEST] = max(int(1.75 * radius + 2.5), half + 2)
    for v in range(-half, half + 1):
        for u in range(-half, half + 1):
            if u * u + v * v <= reach * reach:
                strip, lane = (u + half) // STRIP, (u + half) % STRIP
                mask[strip * (2 * half + 1) + v + half] |= np.uint16(1 << lane)


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def take_plan(place, count, width, channels, offset, sample, shape):
    """Offsets of a plan's pixels in the flat image, and where they lie: rows of `sample`.

    `shape` of ring and of core = number, mean x, mean y, sum of squares about the mean, and the inverse of
    the matrix of these sums, xx, xy, yy (0 where there are too few for a plane).
    """
    for part in range(3):
        for k in range(LANES):
            u, v = place[0, part * LANES + k], place[1, part * LANES + k]
            sample[part * ROWS + DX + k], sample[part * ROWS + DY + k] = u, v
            sample[part * ROWS + USED + k] = 1.0 if k < count[part] else 0.0
            offset[part * LANES + k] = (np.int64(v) * width + u) * channels
    for part in range(2):
        x = place[0, part * LANES : part * LANES + count[part]].astype(np.float64)
        y = place[1, part * LANES : part * LANES + count[part]].astype(np.float64)
        shape[part, 0] = count[part]
        shape[part, 1], shape[part, 2] = x.mean(), y.mean()
        x -= x.mean()
        y -= y.mean()
        xx, xy, yy = (x * x).sum(), (x * y).sum(), (y * y).sum()
        shape[part, 3], determinant = xx + yy, xx * yy - xy * xy
        shape[part, 4:] = 0.0
        if count[part] >= 6 and determinant > 0.0125 * (xx + yy) ** 2:
            shape[part, 4], shape[part, 5], shape[part, 6] = (
                yy / determinant,
                -xy / determinant,
                xx / determinant,
            )
