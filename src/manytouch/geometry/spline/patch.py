"""The part of the sheet that is modelled, as a patch of bicubic B-splines."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float64, Int64

from manytouch.geometry.spline import basis
from manytouch.values.arrays import read_only

SOFT_ROWS = 2
"""Rows of nodes along a soft boundary that are held by springs."""

Nodal = Float64[np.ndarray, "nodes 3"]
"""One vector per node of a patch: coefficients or forces, components along x, y, z of the sheet frame."""

NodeTable = Float64[np.ndarray, "_ _"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointBasis:
    """The 16 basis functions that are not 0 at each of k points.

    Attributes:
        node: (k, 16) their nodes.
        value, dx, dy: (k, 16) of the displacements along x and y: values, and derivatives per mm.
        deflection: (k, 16) of the deflection w = b - shear_mm2 lap b, where b is the bending deflection.
        slope_x, slope_y: (k, 16) first derivatives of the bending deflection, per mm.
        dxx, dyy: (k, 16) its second derivatives, per mm^2.
    """

    node: Int64[np.ndarray, "k 16"]
    value: Float64[np.ndarray, "k 16"]
    dx: Float64[np.ndarray, "k 16"]
    dy: Float64[np.ndarray, "k 16"]
    deflection: Float64[np.ndarray, "k 16"]
    slope_x: Float64[np.ndarray, "k 16"]
    slope_y: Float64[np.ndarray, "k 16"]
    dxx: Float64[np.ndarray, "k 16"]
    dyy: Float64[np.ndarray, "k 16"]

    def displacement(self, coefficient_mm: "Nodal") -> Float64[np.ndarray, "k 3"]:
        """(k, 3) displacement of the sheet at the points, without the rotation of its fibres."""
        own = coefficient_mm[self.node]
        return np.stack(
            [
                np.einsum("kn,kn->k", table, own[:, :, axis])
                for axis, table in enumerate((self.value, self.value, self.deflection))
            ],
            axis=1,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PointWindow:
    """The basis functions of k points as factors along the slow and the fast axis, in this order.

    Attributes:
        first: (k, 2) indices of the first of 4 x 4 nodes.
        plane: (k, 2, 4, 4) value and three derivatives of the functions of the displacements along x and y.
        bending: (k, 2, 4, 4) the same of the bending deflection.
    """

    first: Int64[np.ndarray, "k 2"]
    plane: Float64[np.ndarray, "k 2 4 4"]
    bending: Float64[np.ndarray, "k 2 4 4"]


@dataclass(frozen=True, eq=False, kw_only=True)
class SplinePatch:
    """A rectangle of the sheet's middle surface, and the nodes whose coefficients are its unknowns.

    Nodes are numbered slow * shape[1] + fast, where fast runs along the side with fewer elements: this
    keeps the band of all matrices narrow.

    Attributes:
        size_mm: along x and y.
        elements: along x and y.
        boundary: "clamped": displacement and slope of the bending deflection are 0 on the outline. "soft":
            the outline is free (the sheet goes on beyond it in an unknown way); `Shell` holds it by weak
            springs.
        centre_mm: of the rectangle, in the sheet frame.
        shear_mm2: a in the deflection w = b - a lap b of a sheet with bending deflection b, whose
            coefficients are the third component of the unknowns; 0 for a thin plate.
        clamped_end: e0 (mm), e1 (mm^2) and e2 (mm^3) of a clamped outline, at which b_n = e0 b_nn + e1 b_nnn
            and w = -e1 b_nn + e2 b_nnn with derivatives along the inward normal; 0 for a thin plate.
    """

    size_mm: tuple[float, float]
    elements: tuple[int, int]
    boundary: Literal["clamped", "soft"] = "clamped"
    centre_mm: tuple[float, float] = (0.0, 0.0)
    shear_mm2: float = 0.0
    clamped_end: tuple[float, float, float] = (0.0, 0.0, 0.0)
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

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Number of nodes along the slow and the fast axis."""
        slow, fast = (self.elements[axis] + basis.DEGREE - 2 * self.dropped for axis in self.axes)
        return slow, fast

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return self.shape[0] * self.shape[1]

    @cached_property
    def corner_mm(self) -> Float64[np.ndarray, "2"]:
        """The corner with the least x and y."""
        return read_only(np.array(self.centre_mm) - 0.5 * np.array(self.size_mm))

    @cached_property
    def is_free(self) -> Bool[np.ndarray, "nodes 3"]:
        """Which unknowns may move; a clamped patch holds w of its outermost nodes, so it has no slope."""
        free = np.ones((*self.shape, 3), dtype=np.bool_)
        if self.boundary == "clamped":
            free[[0, -1], :, 2] = False
            free[:, [0, -1], 2] = False
        return read_only(free.reshape(-1, 3))

    @cached_property
    def is_soft_edge(self) -> Bool[np.ndarray, " nodes"]:
        """Nodes along a soft boundary: their forces come from the sheet beyond, not from contacts."""
        edge = np.zeros(self.shape, dtype=np.bool_)
        if self.boundary == "soft":
            edge[:SOFT_ROWS] = edge[-SOFT_ROWS:] = True
            edge[:, :SOFT_ROWS] = edge[:, -SOFT_ROWS:] = True
        return read_only(edge.ravel())

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

    def covers(self, point_mm: Float64[np.ndarray, "k 2"]) -> Bool[np.ndarray, " k"]:
        """Which points are on the rectangle."""
        away_mm = np.abs(point_mm - np.array(self.centre_mm))
        return np.asarray((away_mm <= 0.5 * np.array(self.size_mm)).all(axis=1))

    def at(self, point_mm: Float64[np.ndarray, "k 2"]) -> PointBasis:
        """The basis functions at points of the sheet; points outside are moved to the outline."""
        return self.basis(self.window(point_mm))

    def basis(self, window: PointWindow) -> PointBasis:
        """The basis functions from their factors."""

        def product(table: np.ndarray, slow: int, fast: int) -> np.ndarray:
            """(k, 16) derivatives of the functions along both axes, in their order."""
            return np.asarray((table[:, 0, slow, :, None] * table[:, 1, fast, None, :]).reshape(-1, 16))

        x, y = ((1, 0), (0, 1)) if self.is_x_slow else ((0, 1), (1, 0))
        plane, bending = window.plane, window.bending
        curvature = [product(bending, 2 * x[0], 2 * x[1]), product(bending, 2 * y[0], 2 * y[1])]
        return PointBasis(
            node=self.nodes_of(window),
            value=product(plane, 0, 0),
            dx=product(plane, *x),
            dy=product(plane, *y),
            deflection=product(bending, 0, 0) - self.shear_mm2 * (curvature[0] + curvature[1]),
            slope_x=product(bending, *x),
            slope_y=product(bending, *y),
            dxx=curvature[0],
            dyy=curvature[1],
        )

    def nodes_of(self, window: PointWindow) -> Int64[np.ndarray, "k 16"]:
        """The 4 x 4 nodes of each point of a window."""
        first, local = window.first, np.arange(4)
        node = (first[:, :1] + local)[:, :, None] * self.shape[1] + (first[:, 1:] + local)[:, None, :]
        return np.asarray(node.reshape(-1, 16))

    def window(self, point_mm: Float64[np.ndarray, "k 2"]) -> PointWindow:
        """The basis functions at points (k, 2), as factors along both directions."""
        first = np.empty((len(point_mm), 2), dtype=np.int64)
        table = np.empty((len(point_mm), 2, 4, 8))
        for number, axis in enumerate(self.axes):
            first[:, number] = self._window(axis, point_mm[:, axis], table[:, number])
        plane, bending = np.ascontiguousarray(table[..., :4]), np.ascontiguousarray(table[..., 4:])
        return PointWindow(first=first, plane=plane, bending=bending)

    def functions(
        self, axis: int, place_mm: Float64[np.ndarray, " k"]
    ) -> tuple[Int64[np.ndarray, " k"], Float64[np.ndarray, "k 4 4"], Float64[np.ndarray, "k 4 4"]]:
        """Basis functions along one axis, dropped ones included, at places from the sheet's first edge.

        The conditions on a clamped outline (`clamped_end`) are two equations for the bending deflection, so
        that the functions of the first two nodes inside contain shares of both functions beyond them
        (`end_shares`).

        Returns:
            (k,) first of the four functions that are not 0 at each place; (k, 4, 4) their value and three
            derivatives; (k, 4, 4) the same for the bending deflection.
        """
        length, elements = self.size_mm[axis], self.elements[axis]
        first, table = basis.values(length, elements, place_mm)
        bending = table.copy()
        share, last = self.end_shares(axis), elements + basis.DEGREE - 1
        for is_far, i, j in np.ndindex(2, 2, 2):
            outer, inner = (last - i, last - 2 - j) if is_far else (i, 2 + j)
            source, into = outer - first, inner - first
            both = np.flatnonzero((source >= 0) & (source < 4) & (into >= 0) & (into < 4))
            bending[both, :, into[both]] += share[i, j] * table[both, :, source[both]]
        return first, table, bending

    def element_polynomials(self, axis: int) -> Float64[np.ndarray, "elements 4 4"]:
        """(elements, 4, 4) coefficients of 1, s, s^2, s^3 of the four functions of the bending deflection.

        s runs from 0 to 1 along each element of an axis.
        """
        return self._element_polynomials[axis]

    @cached_property
    def _element_polynomials(
        self,
    ) -> tuple[Float64[np.ndarray, "elements_x 4 4"], Float64[np.ndarray, "elements_y 4 4"]]:
        x, y = (self.functions(axis, self._starts_mm(axis))[2] * self._powers_mm(axis) for axis in range(2))
        return (
            read_only(np.ascontiguousarray(x.transpose(0, 2, 1))),
            read_only(np.ascontiguousarray(y.transpose(0, 2, 1))),
        )

    def end_shares(self, axis: int) -> Float64[np.ndarray, "2 2"]:
        """Shares of the outer two functions along an axis (rows) in those of the first two nodes inside."""
        return self._end_shares[axis]

    @cached_property
    def _end_shares(self) -> tuple[Float64[np.ndarray, "2 2"], Float64[np.ndarray, "2 2"]]:
        return read_only(self._solved_end_shares(0)), read_only(self._solved_end_shares(1))

    def _solved_end_shares(self, axis: int) -> Float64[np.ndarray, "2 2"]:
        e0, e1, e2 = self.clamped_end
        if self.boundary != "clamped" or (self.shear_mm2, e0, e1, e2) == (0.0, 0.0, 0.0, 0.0):
            return np.zeros((2, 2))
        slope, second, third = self._end_derivatives(axis)
        deflection = np.array([1.0, 0.0, 0.0, 0.0]) - self.shear_mm2 * second
        held = np.stack([deflection + e1 * second - e2 * third, slope - e0 * second - e1 * third])
        return np.asarray(-np.linalg.solve(held[:, :2], held[:, 2:]))

    def end_curvatures(self, axis: int) -> Float64[np.ndarray, "2 2"]:
        """Second and third derivatives (rows) at an end by the coefficients of the first two nodes inside."""
        derivatives = self._end_derivatives(axis)[1:]
        return np.asarray(derivatives[:, :2] @ self.end_shares(axis) + derivatives[:, 2:])

    def _end_derivatives(self, axis: int) -> Float64[np.ndarray, "3 4"]:
        """First to third derivatives of the outer four functions along an axis at its end, inwards."""
        _, table = basis.values(self.size_mm[axis], self.elements[axis], np.zeros(1))
        return np.asarray(table[0, 1:])

    def _window(
        self, axis: int, place_mm: Float64[np.ndarray, " k"], table: Float64[np.ndarray, "k 4 8"]
    ) -> Int64[np.ndarray, " k"]:
        """First of 4 nodes along an axis; both kinds of functions into `table`. Dropped ones are left out."""
        start, polynomials = self._window_polynomials[axis]
        length, elements = self.size_mm[axis], self.elements[axis]
        held_mm = np.minimum(np.maximum(place_mm - self.corner_mm[axis], 0.0), length)
        knot_mm = basis.knots(length, elements)[basis.DEGREE : -basis.DEGREE]
        element = np.searchsorted(knot_mm[1:-1], held_mm, side="right")
        per_mm = elements / length
        s, own = ((held_mm - knot_mm[element]) * per_mm)[:, None], polynomials[element]
        c1, c2, c3 = own[:, 1], own[:, 2], own[:, 3]
        table[:, 0] = own[:, 0] + s * (c1 + s * (c2 + s * c3))
        table[:, 1] = (c1 + s * (2.0 * c2 + 3.0 * s * c3)) * per_mm
        table[:, 2] = (2.0 * c2 + 6.0 * s * c3) * per_mm**2
        table[:, 3] = 6.0 * c3 * per_mm**3
        return np.asarray(start[element])

    @cached_property
    def _window_polynomials(
        self,
    ) -> tuple[tuple[Int64[np.ndarray, " _"], Float64[np.ndarray, "_ 4 8"]], ...]:
        """For both axes the first of 4 nodes in each element, and the polynomials of both kinds of functions.

        A polynomial is (elements, 4, 8) coefficients of 1, s, s^2, s^3, where s runs from 0 to 1.
        """
        found = []
        for axis in range(2):
            first, *tables = self.functions(axis, self._starts_mm(axis))
            nodes = self.elements[axis] + basis.DEGREE - 2 * self.dropped
            start = np.clip(first - self.dropped, 0, nodes - 4)
            source = np.arange(4) + (start - first + self.dropped)[:, None]
            is_there = ((source >= 0) & (source < 4))[:, None, :]
            held = np.clip(source, 0, 3)[:, None, :]
            kept = [np.take_along_axis(table, held, axis=2) * is_there for table in tables]
            found.append((start, np.concatenate(kept, axis=2) * self._powers_mm(axis)))
        return tuple(found)

    def _starts_mm(self, axis: int) -> Float64[np.ndarray, " elements"]:
        return basis.knots(self.size_mm[axis], self.elements[axis])[basis.DEGREE : -basis.DEGREE - 1]

    def _powers_mm(self, axis: int) -> Float64[np.ndarray, "4 1"]:
        """h^k / k!: coefficients of s^k of a polynomial over the derivatives at the start of an element."""
        length_mm = self.size_mm[axis] / self.elements[axis]
        return np.asarray(length_mm ** np.arange(4) / np.array([1.0, 1.0, 2.0, 6.0]))[:, None]

    @cached_property
    def _at_nodes(self) -> tuple[NodeTable, NodeTable, NodeTable, NodeTable]:
        """Functions of the bending deflection at the places of the nodes: along slow, fast; values, slopes.

        Each is (nodes along the axis, functions along the axis).
        """
        window = self.window(self.place_mm)
        first, bending = window.first, window.bending
        rows = np.arange(self.node_count).reshape(self.shape)
        tables = []
        for number, row in ((0, rows[:, 0]), (1, rows[0])):
            for order in (0, 1):
                table, node = np.zeros((len(row), len(row))), np.arange(len(row))[:, None]
                table[node, first[row, number][:, None] + np.arange(4)] = bending[row, number, order]
                tables.append(read_only(table))
        return tables[0], tables[1], tables[2], tables[3]

    def slopes(self, bending_mm: Float64[np.ndarray, " nodes"]) -> Float64[np.ndarray, "nodes 2"]:
        """Slopes along x and y of the bending deflection with these coefficients, at the nodes."""
        slow, slow_slope, fast, fast_slope = self._at_nodes
        grid = bending_mm.reshape(self.shape)
        found = (slow_slope @ (grid @ fast.T)).ravel(), (slow @ (grid @ fast_slope.T)).ravel()
        return np.stack(found if self.is_x_slow else found[::-1], axis=1)

    def slope_moments(self, couple: Float64[np.ndarray, "nodes 2"]) -> Float64[np.ndarray, " nodes"]:
        """Derivative by the coefficients of the sum over nodes of couples times `slopes`."""
        slow, slow_slope, fast, fast_slope = self._at_nodes
        about = (couple if self.is_x_slow else couple[:, ::-1]).reshape(*self.shape, 2)
        found = slow_slope.T @ about[:, :, 0] @ fast + slow.T @ about[:, :, 1] @ fast_slope
        return np.asarray(found.ravel())

    def slope_moments_along(
        self, axis: int, couple: Float64[np.ndarray, "k nodes"]
    ) -> Float64[np.ndarray, "k nodes"]:
        """`slope_moments` of k couples along x (0) or y (1) only."""
        slow, slow_slope, fast, fast_slope = self._at_nodes
        is_slow = self.is_x_slow == (axis == 0)
        left, right = (slow_slope, fast) if is_slow else (slow, fast_slope)
        return np.asarray((left.T @ couple.reshape(-1, *self.shape) @ right).reshape(couple.shape))

    def load(self, point_mm: Float64[np.ndarray, "k 2"], force: Float64[np.ndarray, "k 3"]) -> Nodal:
        """Nodal forces (nodes, 3) that are equivalent to forces at points."""
        points = self.at(point_mm)
        nodal = np.zeros((self.node_count, 3))
        for axis, table in enumerate((points.value, points.value, points.deflection)):
            np.add.at(nodal[:, axis], points.node, table * force[:, axis, None])
        return nodal
