"""Which measured dots are dots, each only once, compiled."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from typing import no_type_check

import numpy as np
from numba import njit

CELL = 4.0  # of the largest reach: most cells then hold one dot
DOUBLE = 0.8  # of the radius: nearer ones are one dot
LEVEL, LEVELS = 0.5, 1024  # grey levels to which contrasts are told apart, and how many of these steps


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def _sorted_into_cells(place, keep, cell, left, top, columns, head, following):
    """Linked lists of the kept dots of each cell."""
    head[:] = -1
    for i in range(place.shape[0]):
        if keep[i]:
            at = int((place[i, 1] - top) / cell) * columns + int((place[i, 0] - left) / cell)
            following[i] = head[at]
            head[at] = i


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def drop_doubles(place, radius, weight, share, keep):
    """Keeps no dot with a heavier one within `share` of the larger radius of the two."""
    number = place.shape[0]
    left = top = 1e18
    right = bottom = -1e18
    reach, count = 0.0, 0
    for i in range(number):
        if keep[i]:
            left, right = min(left, place[i, 0]), max(right, place[i, 0])
            top, bottom = min(top, place[i, 1]), max(bottom, place[i, 1])
            reach = max(reach, share * radius[i])
            count += 1
    if count < 2 or reach <= 0.0:
        return
    cell = max(CELL * reach, math.sqrt((right - left + 1.0) * (bottom - top + 1.0) / (4.0 * count)))
    columns, rows = int((right - left) / cell) + 1, int((bottom - top) / cell) + 1
    head, following = np.empty(columns * rows, dtype=np.int32), np.empty(number, dtype=np.int32)
    _sorted_into_cells(place, keep, cell, left, top, columns, head, following)
    is_double = np.zeros(number, dtype=np.bool_)
    for i in range(number):
        if not keep[i]:
            continue
        x, y = place[i, 0], place[i, 1]
        for row in range(max(0, int((y - reach - top) / cell)), min(rows, int((y + reach - top) / cell) + 1)):
            first, last = (
                max(0, int((x - reach - left) / cell)),
                min(columns, int((x + reach - left) / cell) + 1),
            )
            for column in range(first, last):
                j = head[row * columns + column]
                while j >= 0:
                    near = share * max(radius[i], radius[j])
                    if j > i and (x - place[j, 0]) ** 2 + (y - place[j, 1]) ** 2 < near * near:
                        is_double[j if weight[i] >= weight[j] else i] = True
                    j = following[j]
    for i in range(number):
        if is_double[i]:
            keep[i] = False


def without_doubles(place: np.ndarray, radius: np.ndarray, weight: np.ndarray, share: float) -> np.ndarray:
    """Mask (n,) of the dots (n, 2) that have no heavier one within `share` of the larger radius."""
    keep = np.ones(len(place), dtype=np.bool_)
    drop_doubles(place, radius, weight, share, keep)
    return keep


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def typical_contrast(contrast, markers):
    """Median of the strongest ones, as many as there should be dots; NaN counts as no dot. 0 of none."""
    count = np.zeros(LEVELS, dtype=np.int32)
    known = 0
    for i in range(contrast.shape[0]):
        if contrast[i] > 0.0:
            count[min(LEVELS - 1, int(contrast[i] / LEVEL))] += 1
            known += 1
    stronger, level = 0, LEVELS
    while 2 * stronger < min(known, max(markers, 1)):
        level -= 1
        stronger += count[level]
    return (level + 0.5) * LEVEL if known else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
@no_type_check
def select(
    rows, radius, markers, least_share, least_product, left, top, centre, covariance, area, contrast, edge
):
    """Copies those rows of `kernels.measure_dots` that are dots: by contrast and size, and each only once.

    Args:
        rows, radius: (k, 9), (k,) what was measured, and the radius that was expected.
        markers: number of dots that there should be.
        least_share, least_product: least contrast against typical ones, and times the root of the area.
        left, top: of the image in the whole one.
        centre, covariance, area, contrast, edge: written, in whole-image coordinates.

    Returns:
        how many.
    """
    number = rows.shape[0]
    keep, weight = np.empty(number, dtype=np.bool_), np.empty(number)
    least_contrast = least_share * typical_contrast(rows[:, 6], markers)
    for i in range(number):
        size, height, full = rows[i, 5], rows[i, 6], radius[i] * radius[i]
        weight[i] = size * height
        keep[i] = (
            height > least_contrast
            and height * math.sqrt(size) > least_product
            and 0.06 * math.pi * full < size < 3.0 * math.pi * full
            and rows[i, 8] < 0.6
            and rows[i, 2] + rows[i, 4] < 0.5 * full
        )
    drop_doubles(rows, radius, weight, DOUBLE, keep)
    k = 0
    for i in range(number):
        if keep[i]:
            centre[k, 0], centre[k, 1] = rows[i, 0] + left, rows[i, 1] + top
            covariance[k, 0, 0], covariance[k, 1, 1] = rows[i, 2], rows[i, 4]
            covariance[k, 0, 1] = covariance[k, 1, 0] = rows[i, 3]
            area[k], contrast[k], edge[k] = rows[i, 5], rows[i, 6], rows[i, 7]
            k += 1
    return k
