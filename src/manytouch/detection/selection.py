"""Selection of dots among the measured spots, each dot once, compiled."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int32

from manytouch.compilation import kernel, no_type_check
from manytouch.detection.measurement.records import AREA, CONTRAST, CUT, CXX, CXY, CYY, EDGE, X, Y
from manytouch.values.arrays import Mask, Points2, Scalars

CELL = 4.0  # of the largest reach: most cells then contain one dot
LEVEL, LEVELS = 0.5, 1024  # resolution of contrasts in grey levels, and number of such steps


class SelectionLimits(NamedTuple):
    """Limits within which a measured spot is a dot.

    Attributes:
        markers: expected number of dots.
        least_share: lowest contrast over the typical one.
        least_product: lowest contrast times square root of the area.
        smallest, largest: area over that of the expected disc.
        most_cut: largest share beyond the border of the image.
        most_variance: largest variance of the centre (trace) over the squared radius.
        double: dots nearer than this share of the radius are one dot.
    """

    markers: int
    least_share: float
    least_product: float
    smallest: float = 0.06
    largest: float = 3.0
    most_cut: float = 0.6
    most_variance: float = 0.5
    double: float = 0.8


class SelectedDots(NamedTuple):
    """Selected dots in coordinates of the whole image, with room for all.

    Attributes:
        centre, covariance: (k, 2), (k, 2, 2).
        area, contrast, edge: (k,).
    """

    centre: Float64[np.ndarray, "k 2"]
    covariance: Float64[np.ndarray, "k 2 2"]
    area: Float64[np.ndarray, " k"]
    contrast: Float64[np.ndarray, " k"]
    edge: Float64[np.ndarray, " k"]


class CellGrid(NamedTuple):
    """Square cells over all dots: side, first corner, and number."""

    cell: float
    left: float
    top: float
    columns: int
    rows: int


@kernel()
@no_type_check
def _grid_over(place: Float64[np.ndarray, "n k"], keep: Bool[np.ndarray, " n"], reach: float) -> CellGrid:
    """Cells for the kept dots, at least so large that neighbouring cells contain all dots within `reach`."""
    left = top = 1e18
    right = bottom = -1e18
    count = 0
    for i in range(place.shape[0]):
        if keep[i]:
            left, right = min(left, place[i, 0]), max(right, place[i, 0])
            top, bottom = min(top, place[i, 1]), max(bottom, place[i, 1])
            count += 1
    cell = max(CELL * reach, math.sqrt((right - left + 1.0) * (bottom - top + 1.0) / (4.0 * count)))
    return CellGrid(cell, left, top, int((right - left) / cell) + 1, int((bottom - top) / cell) + 1)


@kernel()
@no_type_check
def _list_by_cell(
    place: Float64[np.ndarray, "n k"], keep: Bool[np.ndarray, " n"], grid: CellGrid,
    head: Int32[np.ndarray, " cells"], following: Int32[np.ndarray, " n"],
) -> None:  # fmt: skip
    """Linked lists of the kept dots of each cell; -1 ends a list."""
    head[:] = -1
    for i in range(place.shape[0]):
        if keep[i]:
            row, column = (
                int((place[i, 1] - grid.top) / grid.cell),
                int((place[i, 0] - grid.left) / grid.cell),
            )
            at = row * grid.columns + column
            following[i] = head[at]
            head[at] = i


@kernel()
@no_type_check
def drop_doubles(
    place: Float64[np.ndarray, "n k"], radius: Float64[np.ndarray, " n"], weight: Float64[np.ndarray, " n"],
    share: float, keep: Bool[np.ndarray, " n"],
) -> None:  # fmt: skip
    """Keeps no dot with a heavier one within `share` of the larger radius of the two."""
    number = place.shape[0]
    reach, count = 0.0, 0
    for i in range(number):
        if keep[i]:
            reach = max(reach, share * radius[i])
            count += 1
    if count < 2 or reach <= 0.0:
        return
    grid = _grid_over(place, keep, reach)
    head, following = np.empty(grid.columns * grid.rows, dtype=np.int32), np.empty(number, dtype=np.int32)
    _list_by_cell(place, keep, grid, head, following)
    is_double = np.zeros(number, dtype=np.bool_)
    for i in range(number):
        if not keep[i]:
            continue
        x, y = place[i, 0], place[i, 1]
        first_row = max(0, int((y - reach - grid.top) / grid.cell))
        last_row = min(grid.rows, int((y + reach - grid.top) / grid.cell) + 1)
        first, last = (
            max(0, int((x - reach - grid.left) / grid.cell)),
            min(grid.columns, int((x + reach - grid.left) / grid.cell) + 1),
        )
        for row in range(first_row, last_row):
            for column in range(first, last):
                j = head[row * grid.columns + column]
                while j >= 0:
                    near = share * max(radius[i], radius[j])
                    if j > i and (x - place[j, 0]) ** 2 + (y - place[j, 1]) ** 2 < near * near:
                        is_double[j if weight[i] >= weight[j] else i] = True
                    j = following[j]
    for i in range(number):
        if is_double[i]:
            keep[i] = False


def find_single_dots(place_px: Points2, radius_px: Scalars, weight: Scalars, share: float) -> Mask:
    """Mask (n,) of the dots (n, 2) that have no heavier one within `share` of the larger radius."""
    keep = np.ones(len(place_px), dtype=np.bool_)
    drop_doubles(place_px, radius_px, weight, share, keep)
    return keep


@kernel()
@no_type_check
def typical_contrast(contrast: Float64[np.ndarray, " n"], markers: int) -> float:
    """Median of the strongest contrasts, as many as there should be dots; NaN is ignored.

    0 if there are none.
    """
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


@kernel()
@no_type_check
def select_dots(
    rows: Float64[np.ndarray, "n 9"],
    radius: Float64[np.ndarray, " n"],
    limits: SelectionLimits,
    corner: Float64[np.ndarray, "2"],
    selected: SelectedDots,
) -> int:
    """Copies the measured spots that are dots, each once.

    Args:
        rows: measured spots; columns as in `measurement.records`.
        radius: expected radii, px.
        limits: of contrast and size.
        corner: position of the first pixel in the whole image, px.
        selected: written.

    Returns:
        their number.
    """
    limits, selected = SelectionLimits(*limits), SelectedDots(*selected)
    number = rows.shape[0]
    keep, weight = np.empty(number, dtype=np.bool_), np.empty(number)
    least_contrast = limits.least_share * typical_contrast(rows[:, CONTRAST], limits.markers)
    for i in range(number):
        area, contrast, full = rows[i, AREA], rows[i, CONTRAST], radius[i] * radius[i]
        weight[i] = area * contrast
        keep[i] = (
            contrast > least_contrast
            and contrast * math.sqrt(area) > limits.least_product
            and limits.smallest * math.pi * full < area < limits.largest * math.pi * full
            and rows[i, CUT] < limits.most_cut
            and rows[i, CXX] + rows[i, CYY] < limits.most_variance * full
        )
    drop_doubles(rows, radius, weight, limits.double, keep)
    k = 0
    for i in range(number):
        if keep[i]:
            selected.centre[k, 0], selected.centre[k, 1] = rows[i, X] + corner[0], rows[i, Y] + corner[1]
            selected.covariance[k, 0, 0], selected.covariance[k, 1, 1] = rows[i, CXX], rows[i, CYY]
            selected.covariance[k, 0, 1] = selected.covariance[k, 1, 0] = rows[i, CXY]
            selected.area[k], selected.contrast[k] = rows[i, AREA], rows[i, CONTRAST]
            selected.edge[k] = rows[i, EDGE]
            k += 1
    return k
