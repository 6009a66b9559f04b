"""Quads of markers, and what equations 11 to 13 and Figure 10 of the paper compute from them.

A quad is a quadrilateral with a marker at each corner. Its size grows as the sheet comes closer to the
camera, which gives the depth. The equations can be read in five ways; docs/paper.md explains and compares
them.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array, diags_array

from manytouch.values.arrays import Scalars

Formula = Literal["corrected", "printed", "side_lengths", "area", "unit_quads"]
"""How a quad is measured. `corrected`: equations 12 and 13 with the third term y2 - y3; `printed`: with
y2 - y1; `side_lengths`: the sum of the distances between its corners; `area`: the square root of its area;
`unit_quads`: as `corrected`, of the four quads between adjacent markers around a marker, whose depths are
averaged. The others use the quad of the four diagonal neighbours."""

Padding = Literal["repeat", "zero", "none"]
"""Depth of the markers at the edge, which have no quad of diagonal neighbours: `repeat`: that of their inner
neighbours; `zero`: of a sheet that is clamped there; `none`: not known."""

CORNERS = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])
"""Steps in row and column from a marker to the corners 1, 2, 3, 4 of its quad in equations 12 and 13."""

SIGNS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
"""Signs of x and y of the corners 1, 2, 3, 4 in the sum of equations 12 and 13, third term y2 - y3."""

PRINTED_SIGNS = np.array([[-1.0, 0.0], [1.0, 1.0], [1.0, 0.0], [-1.0, -1.0]])
"""Signs of the same sum with the third term as printed, y2 - y1: y1 cancels, and y3 is not used."""

Corners = Float64[np.ndarray, "q 4 2"]
"""Positions of the corners 1 to 4 of quads, x and y, or derivatives by them."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerQuads:
    """Quads of markers, and which of them belong to each marker.

    Attributes:
        corner_marker: (q, 4) markers at the corners 1 to 4 of each quad; -1 where the layout has none.
        is_corner: (m, q) 1 where a marker is a corner of a quad: the depth of the marker is the mean of those
            quads. None: each marker has one quad, of the same number.
        depth_from: (m,) marker whose depth each marker gets: itself, or at the edge an inner neighbour
            (Figure 10); -1 for none.
    """

    corner_marker: Int64[np.ndarray, "q 4"]
    is_corner: csr_array | None
    depth_from: Int64[np.ndarray, " m"]


def marker_quads(
    row_column: Int64[np.ndarray, "m 2"], formula: Formula = "corrected", padding: Padding = "repeat"
) -> MarkerQuads:
    """Find the quads that a formula measures.

    Args:
        row_column: (m, 2) of the markers, which fill a rectangle of rows and columns, row by row.
        formula: decides between quads of diagonal neighbours and of adjacent markers.
        padding: depth of the markers at the edge.
    """
    count = len(row_column)
    rows, columns = row_column.max(axis=0) + 1
    marker = np.full((rows + 2, columns + 2), -1, dtype=np.int64)
    row, column = row_column.T
    marker[row + 1, column + 1] = np.arange(count)
    if formula == "unit_quads":
        lower = marker[2:-1, 1:-2].ravel(), marker[2:-1, 2:-1].ravel()
        upper = marker[1:-2, 2:-1].ravel(), marker[1:-2, 1:-2].ravel()
        corner_marker = np.stack([*lower, *upper], axis=1)
        quads = len(corner_marker)
        entries = (np.ones(4 * quads), (corner_marker.ravel(), np.repeat(np.arange(quads), 4)))
        is_corner = csr_array(entries, shape=(count, quads))
        return MarkerQuads(corner_marker=corner_marker, is_corner=is_corner, depth_from=np.arange(count))
    corner_marker = marker[row[:, None] + 1 + CORNERS[:, 0], column[:, None] + 1 + CORNERS[:, 1]]
    depth_from = marker[np.clip(row, 1, rows - 2) + 1, np.clip(column, 1, columns - 2) + 1]
    if padding != "repeat":
        depth_from = np.where(depth_from == np.arange(count), depth_from, -1)
    return MarkerQuads(corner_marker=corner_marker, is_corner=None, depth_from=depth_from)


def measure(corner: Corners, formula: Formula) -> tuple[Float64[np.ndarray, " q"], Corners]:
    """Size of each quad by a formula, and its derivatives by the corners.

    The signed sum of equations 12 and 13, (y1 - y4) + (x2 - x1) + (y2 - y3) + (x3 - x4), is twice the mean
    width plus twice the mean height: the perimeter of a quad with sides parallel to the axes.

    Args:
        corner: (q, 4, 2) positions in any unit of length; NaN where a corner is not known.
        formula: which size.

    Returns:
        sizes (q,), lengths in the unit of `corner`, NaN where a corner that the formula uses is not known;
        derivatives (q, 4, 2), without unit.
    """
    if formula == "side_lengths":
        side = np.roll(corner, -1, axis=1) - corner
        length = np.linalg.norm(side, axis=2, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            direction = side / length
        return length.sum(axis=(1, 2)), np.roll(direction, 1, axis=1) - direction
    if formula == "area":
        after, before = np.roll(corner, -1, axis=1), np.roll(corner, 1, axis=1)
        # in the image, where y points down, corners 1 to 4 run counter-clockwise: the usual sum is negative
        twice = -(corner[..., 0] * after[..., 1] - corner[..., 1] * after[..., 0]).sum(axis=1)
        root = np.sqrt(np.maximum(0.5 * twice, 0.0))
        across = np.stack([before[..., 1] - after[..., 1], after[..., 0] - before[..., 0]], axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            return root, across / (4.0 * root[:, None, None])
    signs = PRINTED_SIGNS if formula == "printed" else SIGNS
    return np.einsum("qkd,kd->q", corner, signs), np.broadcast_to(signs, corner.shape)


def quad_depth(
    distance_mm: float, initial_mm: Float64[np.ndarray, " q"], corner_mm: Corners, formula: Formula
) -> tuple[Float64[np.ndarray, " q"], Corners]:
    """Depth of each quad, m = d (1 - a / b) of equation 11, and its derivatives by the corners.

    Args:
        distance_mm: d, from the camera to the sheet at rest.
        initial_mm: (q,) a, size of the quads at rest.
        corner_mm: (q, 4, 2) present positions in the plane of the sheet at rest, whose size is b.
        formula: which size.

    Returns:
        depths (q,) in mm, NaN where a corner is not known or the quad has turned inside out; derivatives
        (q, 4, 2), without unit.
    """
    present_mm, derivative = measure(corner_mm, formula)
    present_mm = np.where(present_mm > 0.0, present_mm, np.nan)
    ratio = initial_mm / present_mm
    return distance_mm * (1.0 - ratio), (distance_mm * ratio / present_mm)[:, None, None] * derivative


def at_markers(
    quads: MarkerQuads,
    depth_mm: Float64[np.ndarray, " q"],
    derivative: Corners,
    covariance_mm2: Float64[np.ndarray, "m 2 2"],
) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
    """Depth of each marker, the mean of its known quads, and its variance, before the edge is padded.

    Args:
        quads: of the markers.
        depth_mm: (q,) of the quads; NaN where not known.
        derivative: (q, 4, 2) of these depths by the corners.
        covariance_mm2: (m, 2, 2) of the marker positions.

    Returns:
        depths (m,) in mm and variances (m,) in mm²; NaN where no quad of the marker is known.
    """
    if quads.is_corner is None:
        corner_mm2 = corner_values(covariance_mm2, quads)
        return depth_mm, np.einsum("qkd,qkde,qke->q", derivative, corner_mm2, derivative)
    is_known = np.isfinite(depth_mm)
    count = quads.is_corner @ is_known.astype(np.float64)
    mean = csr_array(
        diags_array(1.0 / np.maximum(count, 1.0)) @ quads.is_corner @ diags_array(1.0 * is_known)
    )
    place = (np.repeat(np.arange(len(depth_mm)), 4), quads.corner_marker.ravel())
    shape = (len(depth_mm), len(covariance_mm2))
    by_x, by_y = (
        mean
        @ csr_array((np.where(is_known[:, None], derivative[..., axis], 0.0).ravel(), place), shape=shape)
        for axis in (0, 1)
    )
    xx, xy, yy = (np.nan_to_num(covariance_mm2[:, i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    variance = (by_x * by_x) @ xx + 2.0 * (by_x * by_y) @ xy + (by_y * by_y) @ yy
    is_any = count > 0
    found = np.where(is_any, mean @ np.where(is_known, depth_mm, 0.0), np.nan)
    return found, np.where(is_any, variance, np.nan)


def corner_values(value: np.ndarray, quads: MarkerQuads) -> np.ndarray:
    """Values (q, 4, ...) at the corners of each quad, from values (m, ...) of the markers; NaN for none."""
    missing = np.full((1, *value.shape[1:]), np.nan)
    return np.asarray(np.concatenate([value, missing])[quads.corner_marker])


def pad_edge(value: Scalars, quads: MarkerQuads, padding: Padding) -> Scalars:
    """Values (m,) in which each marker at the edge has that of an inner neighbour, 0 or NaN, by `padding`."""
    return np.where(quads.depth_from >= 0, value[quads.depth_from], 0.0 if padding == "zero" else np.nan)
