"""Where dots of a known size may be: peaks of a difference of Gaussians in a reduced image."""

import math
from dataclasses import dataclass
from typing import no_type_check

import cv2
import numpy as np
from jaxtyping import Float32, Float64
from numba import njit

from manytouch.values.arrays import Points2, Scalars

REDUCED_RADIUS_PX = 2.0  # or more, up to half as much again
INNER, OUTER = 0.5, 1.0  # the two Gaussians' deviations against the dot's radius
# answer at the centre of a disc of contrast 1: exp(-r^2 / 2 outer^2) - exp(-r^2 / 2 inner^2)
DISC_ANSWER = math.exp(-0.5 / OUTER**2) - math.exp(-0.5 / INNER**2)
DIRECTIONS = 16


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Candidates:
    """Places that look like dots.

    Attributes:
        place_px: (n, 2) in the whole image, good to about a third of the radius.
        radius_px: (n,) the radius that was searched for.
        contrast: (n,) roughly, grey levels of 255.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars


def reduced(image: np.ndarray, weights: Float64[np.ndarray, " c"], factor: int) -> Float32[np.ndarray, "h w"]:
    """Signed grey image, `factor` times smaller in both directions (means of whole blocks)."""
    height, width = image.shape[0] // factor, image.shape[1] // factor
    if image.ndim == 3 and image.dtype == np.uint8 and np.allclose(abs(weights), (0.114, 0.587, 0.299)):
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        weights = weights[:1] / 0.114
    if factor > 1:
        block = image[: height * factor, : width * factor]
        image = cv2.resize(block, (width, height), interpolation=cv2.INTER_AREA)
    if image.ndim == 2:
        return image.astype(np.float32) * np.float32(weights[0])
    single = cv2.transform(image.astype(np.float32), weights[None].astype(np.float32))
    return np.asarray(single, dtype=np.float32)


def candidates(
    image: np.ndarray, weights: Float64[np.ndarray, " c"], radius_px: float, least: float
) -> Candidates:
    """Peaks of at least the contrast `least` (grey levels of 255) that the ground encloses."""
    factor = max(1, int(radius_px / REDUCED_RADIUS_PX))
    small = reduced(image, weights, factor)
    own = radius_px / factor
    inner = cv2.GaussianBlur(small, (0, 0), INNER * own, borderType=cv2.BORDER_REFLECT)
    outer = cv2.GaussianBlur(small, (0, 0), OUTER * own, borderType=cv2.BORDER_REFLECT)
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    reach = own * np.array([1.3, 1.7, 2.1])
    offset = np.rint(reach[None, :, None] * np.stack([np.sin(angle), np.cos(angle)], axis=1)[:, None])
    found = np.empty((small.size // 4 + 16, 3), dtype=np.float32)
    count = _peaks(inner, inner - outer, np.float32(least * DISC_ANSWER), offset.astype(np.int64), found)
    peaks = found[:count].astype(np.float64)
    return Candidates(
        place_px=(peaks[:, :2] + 0.5) * factor - 0.5,
        radius_px=np.full(count, float(radius_px)),
        contrast=peaks[:, 2] / DISC_ANSWER,
    )


@njit(cache=True, error_model="numpy")
@no_type_check
def _is_enclosed(image, y, x, offset, fall):
    """Does the brightness fall by a third of its mean fall in nearly all directions?"""
    height, width = image.shape
    known = 0
    total = np.float32(0.0)
    for direction in range(offset.shape[0]):
        low = np.float32(1e9)
        for step in range(offset.shape[1]):
            v, u = y + offset[direction, step, 0], x + offset[direction, step, 1]
            if 0 <= v < height and 0 <= u < width:
                low = min(low, image[v, u])
        if low < np.float32(1e9):
            fall[known] = image[y, x] - low
            total += fall[known]
            known += 1
    if known < offset.shape[0] // 3 or total <= 0.0:
        return False
    least = 0.35 * total / known
    open_directions = 0
    for direction in range(known):
        if fall[direction] < least:
            open_directions += 1
    return open_directions <= 0.2 * known


@njit(cache=True, error_model="numpy")
@no_type_check
def _is_peak(answer, y, x):
    """Is no neighbour higher? Of equal ones the first in reading order is the peak."""
    height, width = answer.shape
    value = answer[y, x]
    for v in range(max(0, y - 1), min(height, y + 2)):
        for u in range(max(0, x - 1), min(width, x + 2)):
            if answer[v, u] > value or (answer[v, u] == value and (v < y or (v == y and u < x))):
                return False
    return True


@njit(cache=True, error_model="numpy")
@no_type_check
def _part(before, value, after):
    """Where between -0.5 and 0.5 px the parabola through three values has its top."""
    bend = max(2.0 * value - before - after, 1e-6)
    return min(max(0.5 * (after - before) / bend, -0.5), 0.5)


@njit(cache=True, error_model="numpy")
@no_type_check
def _peaks(inner, answer, least, offset, found):
    """Local maxima of `answer`, at parts of pixels; rows x, y, height. Returns their number."""
    height, width = answer.shape
    fall = np.empty(offset.shape[0], dtype=np.float32)
    count = 0
    for y in range(height):
        for x in range(width):
            value = answer[y, x]
            if value < least or not _is_peak(answer, y, x) or not _is_enclosed(inner, y, x, offset, fall):
                continue
            if count < found.shape[0]:
                found[count, 0], found[count, 1], found[count, 2] = x, y, value
                if 0 < x < width - 1:
                    found[count, 0] += _part(answer[y, x - 1], value, answer[y, x + 1])
                if 0 < y < height - 1:
                    found[count, 1] += _part(answer[y - 1, x], value, answer[y + 1, x])
                count += 1
    return count


@njit(cache=True, error_model="numpy")
@no_type_check
def without_doubles(place, radius, weight, share):
    """Mask of the dots that have no heavier one within `share` of the larger radius. Sorted sweep."""
    count = place.shape[0]
    keep = np.ones(count, dtype=np.bool_)
    order = np.argsort(place[:, 1])
    largest = 0.0
    for i in range(count):
        largest = max(largest, radius[i])
    for a in range(count):
        i = order[a]
        for b in range(a + 1, count):
            j = order[b]
            if place[j, 1] - place[i, 1] > share * largest:
                break
            reach = share * max(radius[i], radius[j])
            if (place[i, 0] - place[j, 0]) ** 2 + (place[i, 1] - place[j, 1]) ** 2 < reach * reach:
                if weight[i] > weight[j] or (weight[i] == weight[j] and i < j):
                    keep[j] = False
                else:
                    keep[i] = False
    return keep
