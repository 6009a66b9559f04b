"""The part of the sheet that is modelled, as a patch of bicubic B-splines."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int64

from manytouch.geometry.spline import basis
from manytouch.values.arrays import read_only

RIM_ROWS = 2
"""Rows of nodes along a soft boundary that are held by springs."""

Nodal = Float64[np.ndarray, "nodes 3"]
"""One vector per node of a patch: coefficients or forces, components along x, y, z of the sheet frame."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointBasis:
    """The 16 basis functions that are not 0 at each of k points.

    Attributes:
        node: (k, 16) their nodes.
        value, dx, dy, dxx, dyy, dxy: (k, 16) values and derivatives, per mm and mm^2.
    """

    node: Int64[np.ndarray, "k 16"]
    value: Float64[np.ndarray, "k 16"]
    dx: Float64[np.ndarray, "k 16"]
    dy: Float64[np.ndarray, "k 16"]
    dxx: Float64[np.ndarray, "k 16"]
    dyy: Float64[np.ndarray, "k 16"]
    dxy: Float64[np.ndarray, "k 16"]

    def field(self, nodal: Float64[np.ndarray, "nodes d"]) -> Float64[np.ndarray, "k d"]:
        """Values at the points of the spline with these coefficients."""
        return np.asarray(np.einsum("kn,knd->kd", self.value, nodal[self.node]))


@dataclass(frozen=True, eq=False, kw_only=True)
class SplinePatch:
    """A rectangle of the sheet's middle surface, and the nodes whose coefficients are its unknowns.

    Nodes are numbered slow * shape[1] + fast, where fast runs along the side with fewer elements: this
    keeps the band of all matrices narrow.

    Attributes:
        size_mm: along x and y.
        elements: along x and y.
        boundary: "clamped": displacement and slope are 0 on the outline. "soft": the outline is free
            (the sheet goes on beyond it in an unknown way); `Shell` holds it by weak springs.
        centre_mm: of the rectangle, in the sheet frame.
    """

    size_mm: tuple[float, float]
    elements: tuple[int, int]
    boundary: Literal["clamped", "soft"] = "clamped"
    centre_mm: tuple[float, float] = (0.0, 0.0)
    is_x_slow: bool = field(init=False)

    def __post_init__(self) -> None:
        if min(self.elements) < 4:
            raise ValueError(f"a patch needs 4 elements or more along each side, not {self.elements}")
        if not min(self.size_mm) > 0.0:
            raise ValueError(f"the sides of a patch must be positive, not {self.size_mm} mm")
        object.__setattr__(self, "is_x_slow", self.elements[0] >= self.elements[1])

    @property
    def axes(self) -> tuple[int, int]:
        """Which of x (0) and y (1) is slow, and which is fast."""
        return (0, 1) if self.is_x_slow else (1, 0)

    @property
    def dropped(self) -> int:
        """Rows of spline coefficients along each side that are 0 and no nodes."""
        return 1 if self.boundary == "clamped" else 0

    @property
    def shape(self) -> tuple[int, int]:
        """Number of nodes along the slow and the fast axis."""
        slow, fast = (self.elements[axis] + basis.DEGREE - 2 * self.dropped for axis in self.axes)
        return slow, fast

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return self.shape[0] * self.shape[1]

    @property
    def corner_mm(self) -> Float64[np.ndarray, "2"]:
        """The corner with the least x and y."""
        return np.array(self.centre_mm) - 0.5 * np.array(self.size_mm)

    @cached_property
    def is_free(self) -> Bool[np.ndarray, "nodes 3"]:
        """Which unknowns may move; a clamped patch holds w of its outermost nodes, so it has no slope."""
        free = np.ones((*self.shape, 3), dtype=np.bool_)
        if self.boundary == "clamped":
            free[[0, -1], :, 2] = False
            free[:, [0, -1], 2] = False
        return read_only(free.reshape(-1, 3))

    @cached_property
    def is_rim(self) -> Bool[np.ndarray, " nodes"]:
        """Nodes along a soft boundary: their forces come from the sheet beyond, not from contacts."""
        rim = np.zeros(self.shape, dtype=np.bool_)
        if self.boundary == "soft":
            rim[:RIM_ROWS] = rim[-RIM_ROWS:] = True
            rim[:, :RIM_ROWS] = rim[:, -RIM_ROWS:] = True
        return read_only(rim.ravel())

    @cached_property
    def place_mm(self) -> Float64[np.ndarray, "nodes 2"]:
        """Greville points: sum(f_j place_j) / sum(f_j) is the exact centroid of nodal forces f."""
        kept = slice(self.dropped, -self.dropped or None)
        slow, fast = (
            basis.greville(self.size_mm[axis], self.elements[axis])[kept] + self.corner_mm[axis]
            for axis in self.axes
        )
        grid = np.stack(np.meshgrid(slow, fast, indexing="ij"), axis=-1).reshape(-1, 2)
        return read_only(np.ascontiguousarray(grid[:, list(self.axes)]))

    @cached_property
    def area_mm2(self) -> Float64[np.ndarray, " nodes"]:
        """Integral of each node's basis function."""
        kept = slice(self.dropped, -self.dropped or None)
        slow, fast = (basis.integrals(self.size_mm[a], self.elements[a])[kept] for a in self.axes)
        return read_only(np.outer(slow, fast).ravel())

    def at(self, point_mm: Float64[np.ndarray, "k 2"]) -> PointBasis:
        """The basis functions at points of the sheet; points outside are moved to the outline."""
        found = [self._window(axis, point_mm[:, axis]) for axis in self.axes]
        (first_slow, slow), (first_fast, fast) = found
        local = np.arange(4)
        node = (first_slow[:, None] + local)[:, :, None] * self.shape[1]
        node = node + (first_fast[:, None] + local)[:, None, :]
        product = {
            (a, b): (slow[:, a, :, None] * fast[:, b, None, :]).reshape(-1, 16)
            for a in range(3)
            for b in range(3 - a)
        }
        x, y = ((1, 0), (0, 1)) if self.is_x_slow else ((0, 1), (1, 0))
        return PointBasis(
            node=node.reshape(-1, 16),
            value=product[0, 0],
            dx=product[x],
            dy=product[y],
            dxx=product[2 * x[0], 2 * x[1]],
            dyy=product[2 * y[0], 2 * y[1]],
            dxy=product[1, 1],
        )

    def window(
        self, point_mm: Float64[np.ndarray, "k 2"]
    ) -> tuple[Int64[np.ndarray, "k 2"], Float64[np.ndarray, "k 2 4 4"]]:
        """The same as factors, in the order slow, fast.

        Returns:
            (k, 2) indices of the first of 4 x 4 nodes; (k, 2, 4, 4) value and three derivatives of the
            basis functions along each axis.
        """
        found = [self._window(axis, point_mm[:, axis]) for axis in self.axes]
        return np.stack([first for first, _ in found], axis=1), np.stack(
            [table for _, table in found], axis=1
        )

    def _window(
        self, axis: int, place_mm: Float64[np.ndarray, " k"]
    ) -> tuple[Int64[np.ndarray, " k"], Float64[np.ndarray, "k 4 4"]]:
        """First of 4 nodes along an axis and their basis functions; dropped ones are left out."""
        local_mm = place_mm - self.corner_mm[axis]
        first, table = basis.values(self.size_mm[axis], self.elements[axis], local_mm)
        nodes = self.elements[axis] + basis.DEGREE - 2 * self.dropped
        start = np.clip(first - self.dropped, 0, nodes - 4)
        source = np.arange(4) + (start - first + self.dropped)[:, None]
        is_there = (source >= 0) & (source < 4)
        moved = np.take_along_axis(table, np.clip(source, 0, 3)[:, None, :], axis=2)
        return start, moved * is_there[:, None, :]

    def load(
        self, point_mm: Float64[np.ndarray, "k 2"], weight: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, " nodes"]:
        """Nodal forces that are equivalent to forces `weight` at points."""
        points = self.at(point_mm)
        nodal = np.zeros(self.node_count)
        np.add.at(nodal, points.node, points.value * weight[:, None])
        return nodal
