"""Selection of dots among the measured spots, each dot once, compiled."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int32

from manytouch.compilation import kernel, no_type_check
from manytouch.detection.measurement.records import AREA, CONTRAST, CUT, CXX, CXY, CYY, EDGE, X, Y
from manytouch.values.arrays import Mask, Points2, Scalars

CELL_OVER_REACH = 4.0
"""Least side of a cell over the distance within which doubles are searched for: most cells then contain one
dot at most."""
BIN_WIDTH = 0.5
"""Width of the bins of contrasts, grey levels of 255."""
BIN_COUNT = 1024
"""Number of these bins; contrasts beyond the last one are counted in it."""


class SelectionLimits(NamedTuple):
    """Limits within which a measured spot is a dot.

    The ratios were chosen, not fitted: they exclude failed measurements only, such as specks, dots that have
    merged, and dots most of which lies outside. On `sim:one` and `sim:fingers` (9600 dots each) areas are
    0.81 to 1.38 of the expected disc, and variances below 1e-5 of the squared radius.

    Attributes:
        markers: expected number of dots.
        least_contrast_ratio: lowest contrast over the typical one.
        least_contrast_root_area: lowest contrast times square root of the area, grey levels of 255 times px:
            proportional to the signal-to-noise ratio of a disc whose pixels have equal noise.
        least_area_ratio, most_area_ratio: area over that of the expected disc.
        most_cut_share: largest share of a dot beyond the border of the image.
        most_variance_ratio: largest variance of the centre (trace) over the squared radius.
        double_distance_ratio: dots nearer to each other than this many radii are one dot.
    """

    markers: int
    least_contrast_ratio: float
    least_contrast_root_area: float
    least_area_ratio: float = 0.06
    most_area_ratio: float = 3.0
    most_cut_share: float = 0.6
    most_variance_ratio: float = 0.5
    double_distance_ratio: float = 0.8


class SelectedDots(NamedTuple):
    """Selected dots in coordinates of the whole image; arrays as long as the number of measured spots.

    Attributes:
        centre: (k, 2) px.
        covariance: (k, 2, 2) of the centres, px².
        area: (k,) px².
        contrast: (k,) grey levels of 255.
        edge: (k,) width of the edge, px.
    """

    centre: Float64[np.ndarray, "k 2"]
    covariance: Float64[np.ndarray, "k 2 2"]
    area: Float64[np.ndarray, " k"]
    contrast: Float64[np.ndarray, " k"]
    edge: Float64[np.ndarray, " k"]


class CellGrid(NamedTuple):
    """Square cells over all dots.

    Attributes:
        cell: side of a cell, px.
        left, top: x and y of the first corner, px.
        columns, rows: number of cells along x and y.
    """

    cell: float
    left: float
    top: float
    columns: int
    rows: int


@kernel()
@no_type_check
def _grid_over(place: Float64[np.ndarray, "n k"], keep: Bool[np.ndarray, " n"], reach: float) -> CellGrid:
    """Cells for the kept dots, about four cells per dot; larger where `reach` (px) requires it."""
    left = top = 1e18
    right = bottom = -1e18
    count = 0
    for i in range(place.shape[0]):
        if keep[i]:
            left, right = min(left, place[i, 0]), max(right, place[i, 0])
            top, bottom = min(top, place[i, 1]), max(bottom, place[i, 1])
            count += 1
    cell = max(
        CELL_OVER_REACH * reach, math.sqrt((right - left + 1.0) * (bottom - top + 1.0) / (4.0 * count))
    )
    return CellGrid(cell, left, top, int((right - left) / cell) + 1, int((bottom - top) / cell) + 1)


@kernel()
@no_type_check
def _list_by_cell(
    place: Float64[np.ndarray, "n k"], keep: Bool[np.ndarray, " n"], grid: CellGrid,
    head: Int32[np.ndarray, " cells"], next_in_cell: Int32[np.ndarray, " n"],
) -> None:  # fmt: skip
    """Fill linked lists of the kept dots of each cell.

    Args:
        place: positions, x and y in the first two columns, px.
        keep: which dots are listed.
        grid: the cells.
        head: (rows * columns,) first dot of each cell, -1 for none.
        next_in_cell: dot after each one in its cell, -1 after the last.
    """
    head[:] = -1
    for i in range(place.shape[0]):
        if keep[i]:
            row, column = (
                int((place[i, 1] - grid.top) / grid.cell),
                int((place[i, 0] - grid.left) / grid.cell),
            )
            at = row * grid.columns + column
            next_in_cell[i] = head[at]
            head[at] = i


@kernel()
@no_type_check
def drop_doubles(
    place: Float64[np.ndarray, "n k"], radius: Float64[np.ndarray, " n"], weight: Float64[np.ndarray, " n"],
    share: float, keep: Bool[np.ndarray, " n"],
) -> None:  # fmt: skip
    """Clear `keep` of every dot that is a double: a kept dot of at least its weight lies near.

    Args:
        place: positions, x and y in the first two columns, px.
        radius: of the dots, px.
        weight: of two dots that are one, the heavier is kept, the first of equal ones.
        share: two dots are one if they are nearer than this share of the larger radius.
        keep: which dots are compared; changed.
    """
    number = place.shape[0]
    reach, count = 0.0, 0
    for i in range(number):
        if keep[i]:
            reach = max(reach, share * radius[i])
            count += 1
    if count < 2 or reach <= 0.0:
        return
    grid = _grid_over(place, keep, reach)
    head, next_in_cell = np.empty(grid.columns * grid.rows, dtype=np.int32), np.empty(number, dtype=np.int32)
    _list_by_cell(place, keep, grid, head, next_in_cell)
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
                    j = next_in_cell[j]
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
    """Median of the `markers` strongest contrasts, to half a `BIN_WIDTH`; 0 if there are none.

    Contrasts that are negative or NaN are ignored.
    """
    count = np.zeros(BIN_COUNT, dtype=np.int32)
    known = 0
    for i in range(contrast.shape[0]):
        if contrast[i] > 0.0:
            count[min(BIN_COUNT - 1, int(contrast[i] / BIN_WIDTH))] += 1
            known += 1
    stronger, place = 0, BIN_COUNT
    while 2 * stronger < min(known, max(markers, 1)):
        place -= 1
        stronger += count[place]
    return (place + 0.5) * BIN_WIDTH if known else 0.0


@kernel()
@no_type_check
def select_dots(
    rows: Float64[np.ndarray, "n 9"],
    radius: Float64[np.ndarray, " n"],
    limits: SelectionLimits,
    corner: Float64[np.ndarray, "2"],
    selected: SelectedDots,
) -> int:
    """Copy the measured spots that are dots, each once. A spot with a value that is NaN is not a dot.

    Args:
        rows: measured spots; columns as in `measurement.records`, positions in the region of interest.
        radius: expected radii, px.
        limits: of contrast and size.
        corner: position of the first pixel in the whole image, px.
        selected: filled from the start.

    Returns:
        number of selected dots.
    """
    limits, selected = SelectionLimits(*limits), SelectedDots(*selected)
    number = rows.shape[0]
    keep, weight = np.empty(number, dtype=np.bool_), np.empty(number)
    least_contrast = limits.least_contrast_ratio * typical_contrast(rows[:, CONTRAST], limits.markers)
    for i in range(number):
        area, contrast, radius2 = rows[i, AREA], rows[i, CONTRAST], radius[i] * radius[i]
        weight[i] = area * contrast
        # each comparison is false where its value is NaN
        keep[i] = (
            contrast > least_contrast
            and contrast * math.sqrt(area) > limits.least_contrast_root_area
            and limits.least_area_ratio < area / (math.pi * radius2) < limits.most_area_ratio
            and rows[i, CUT] < limits.most_cut_share
            and rows[i, CXX] + rows[i, CYY] < limits.most_variance_ratio * radius2
        )
    drop_doubles(rows, radius, weight, limits.double_distance_ratio, keep)
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
