"""Quads of markers around each marker, and their perimeters (equations 12 and 13, Figure 10 of the paper)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.values.arrays import Scalars

CORNERS = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])
"""Steps in row and column from a marker to the corners 1, 2, 3, 4 of its quad in equations 12 and 13."""

SIGNS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
"""Signs of x and y of the corners 1, 2, 3, 4 in the sum of equations 12 and 13."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerQuads:
    """The quad of markers around each marker.

    Attributes:
        corner: (m, 4) markers at the corners 1 to 4; -1 where the layout has none.
        source: (m,) marker whose depth is used: the marker itself inside, its inner neighbour at the edge
            (Figure 10).
    """

    corner: Int64[np.ndarray, "m 4"]
    source: Int64[np.ndarray, " m"]


def signed_perimeter(corner: Float64[np.ndarray, "... 4 2"]) -> Float64[np.ndarray, "..."]:
    """Perimeter (...) of quads with corners 1 to 4, as the signed sum of equations 12 and 13.

    (y1 - y4) + (x2 - x1) + (y2 - y3) + (x3 - x4), with the third term corrected (printed: y2 - y1). It is
    twice the mean width and height, the perimeter of the quad if its sides are parallel to the axes.
    """
    return np.asarray(np.einsum("...kd,kd->...", corner, SIGNS))


def marker_quads(row_column: Int64[np.ndarray, "m 2"]) -> MarkerQuads:
    """The four diagonal neighbours of each marker, and the padding of the edge of the layout."""
    rows, columns = row_column.max(axis=0) + 1
    marker = np.full((rows + 2, columns + 2), -1, dtype=np.int64)
    row, column = row_column.T
    marker[row + 1, column + 1] = np.arange(len(row_column))
    corner = marker[row[:, None] + 1 + CORNERS[:, 0], column[:, None] + 1 + CORNERS[:, 1]]
    source = marker[np.clip(row, 1, rows - 2) + 1, np.clip(column, 1, columns - 2) + 1]
    return MarkerQuads(corner=corner, source=source)


def corner_values(value: np.ndarray, quads: MarkerQuads) -> np.ndarray:
    """(m, 4, ...) values at the corners of the quad of each marker; NaN where there is none."""
    missing = np.full((1, *value.shape[1:]), np.nan)
    return np.asarray(np.concatenate([value, missing])[quads.corner])


def pad_edge(value: Scalars, quads: MarkerQuads) -> Scalars:
    """(m,) values, where the markers at the edge get the value of their inner neighbours."""
    return np.where(quads.source >= 0, value[quads.source], np.nan)
