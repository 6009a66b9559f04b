"""The sheet cut into quadratic hexahedra of 20 nodes, axis-parallel blocks between grid lines.

Serendipity elements: the 27-node brick has 1.7 times the unknowns of a one-layer sheet for the same
order of convergence (docs/decisions/0010). The shape functions are scikit-fem's
(T. Gustafsson and G. D. McBain 2020, doi:10.21105/joss.02369).
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from manytouch.errors import MissingExtraError
from manytouch.values.arrays import read_only

NODES = 20
"""Nodes of an element."""

Lines = Float64[np.ndarray, " _"]
Nodal = Float64[np.ndarray, "nodes 3"]
"""Displacements or forces of the nodes."""
Poses = Float64[np.ndarray, "touches 3"]
"""Positions or rotation vectors of the indenters."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HexMesh:
    """Quadratic hexahedra between grid lines.

    Sheet frame: z = 0 is the camera-side face, the touched face is the top, z = +thickness.

    Attributes:
        lines_mm: grid lines along x, y and z, increasing.
        node_mm: (n, 3) corners and edge middles, undeformed.
        element: (e, 20) nodes of each element, in the order of `shape_functions`.
        touched: (f,) the elements under the touched face.
        camera_side: (f,) the elements on the camera-side face, ordered like `touched`: y runs
            fastest, so the face between lines (i, j) is i * (lines along y - 1) + j.
    """

    lines_mm: tuple[Lines, Lines, Lines]
    node_mm: Float64[np.ndarray, "n 3"]
    element: Int64[np.ndarray, "e 20"]
    touched: Int64[np.ndarray, " f"]
    camera_side: Int64[np.ndarray, " f"]

    @property
    def thickness_mm(self) -> float:
        """From the camera-side face to the touched face."""
        return float(self.lines_mm[2][-1] - self.lines_mm[2][0])

    def layer(self, number: int) -> Int64[np.ndarray, " f"]:
        """(f,) elements of a layer, ordered like `touched`; layer 0 is on the camera-side face."""
        return np.asarray(self.camera_side + number)

    @property
    def is_on_outline(self) -> Bool[np.ndarray, " n"]:
        """(n,) nodes on the four side faces."""
        (x, y, _), node_mm = self.lines_mm, self.node_mm
        tolerance = 1e-9 * (x[-1] - x[0] + y[-1] - y[0])
        at = [
            np.abs(node_mm[:, axis] - end) < tolerance
            for axis, line in ((0, x), (1, y))
            for end in line[[0, -1]]
        ]
        return np.asarray(np.logical_or.reduce(at))


@cache
def _reference() -> tuple[np.ndarray, Any]:
    try:
        from skfem import ElementHexS2
    except ImportError:
        raise MissingExtraError("solving the sheet with finite elements", "scikit-fem") from None
    element = ElementHexS2()
    return read_only(np.asarray(element.doflocs, dtype=np.float64)), element


def reference_nodes() -> Float64[np.ndarray, "20 3"]:
    """(20, 3) places of an element's nodes in the unit cube."""
    return _reference()[0]


def shape_functions(
    point: Float64[np.ndarray, "q 3"],
) -> tuple[Float64[np.ndarray, "q 20"], Float64[np.ndarray, "q 20 3"]]:
    """Values (q, 20) and derivatives (q, 20, 3) of the shape functions at points of the unit cube."""
    element = _reference()[1]
    value = np.empty((len(point), NODES))
    slope = np.empty((len(point), NODES, 3))
    for node in range(NODES):
        value[:, node], derivative = element.lbasis(point.T, node)
        slope[:, node] = np.asarray(derivative).T
    return value, slope


def tensor_mesh(x_mm: Lines, y_mm: Lines, z_mm: Lines) -> HexMesh:
    """Blocks between grid lines, which may be graded."""
    lines = (x_mm, y_mm, z_mm)
    cells = [len(line) - 1 for line in lines]
    cell = np.stack(np.meshgrid(*(np.arange(count) for count in cells), indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    halves = np.rint(2 * reference_nodes()).astype(np.int64)  # (20, 3) nodes lie on lines or half-way
    place = 2 * cell[:, None] + halves  # (e, 20, 3)
    key = np.ravel_multi_index(tuple(place.transpose(2, 0, 1)), tuple(2 * count + 1 for count in cells))
    kept, element = np.unique(key, return_inverse=True)
    half = np.stack(np.unravel_index(kept, tuple(2 * count + 1 for count in cells)), axis=-1)
    node_mm = np.column_stack(
        [0.5 * (line[half[:, axis] // 2] + line[(half[:, axis] + 1) // 2]) for axis, line in enumerate(lines)]
    )
    layer = cell[:, 2]
    return HexMesh(
        lines_mm=(read_only(x_mm.copy()), read_only(y_mm.copy()), read_only(z_mm.copy())),
        node_mm=read_only(node_mm),
        element=read_only(np.ascontiguousarray(element.reshape(key.shape), dtype=np.int64)),
        touched=read_only(np.flatnonzero(layer == cells[2] - 1)),
        camera_side=read_only(np.flatnonzero(layer == 0)),
    )


def sheet_mesh(
    size_mm: tuple[float, float], thickness_mm: float, *, element_mm: float = 2.0, layers: int = 1
) -> HexMesh:
    """A sheet centred on the origin, its elements at most `element_mm` wide.

    One layer of quadratic elements is within 0.2 % in depth and 0.8 % in force of two.
    """
    x_mm, y_mm = (
        np.linspace(-0.5 * size, 0.5 * size, math.ceil(size / element_mm - 1e-9) + 1) for size in size_mm
    )
    return tensor_mesh(x_mm, y_mm, np.linspace(0.0, thickness_mm, layers + 1))
