"""A linear elastic pad that is bonded to a rigid window, with free sides, by Galerkin's method.

Displacements are products of bicubic B-splines over the outline and of polynomials through the thickness that
are 0 on the bonded face. The stiffness is a sum of Kronecker products of matrices along the three axes. A
rectangle has two mirror planes, so it falls apart into four smaller ones, for displacements that are even or
odd about each of them. The response to tractions on the contact face is computed once per sensor. In the
limit of a wide pad it is that of a layer (`mechanics.pad.layer`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array, kron

from manytouch.geometry.spline.patch import PointBasis, SplinePatch
from manytouch.mechanics.pad.axes import DEGREE_Z, Axis, depth_axis, lame_constants, polynomials, spline_axis
from manytouch.values.arrays import Points2, read_only

_COUPLED_NODES = 3  # along an axis on each side of a node: those whose cubic splines share elements with its


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadResponse:
    """Displacements, mm, of the markers and of the contact face by nodal forces over E, mm^2, on that face.

    Nodal forces are those of `SplinePatch.load`: int t B_j of a traction t.

    Attributes:
        marker: (m, 3, n, 3) displacement of each marker per nodal force over E, 1/mm.
        face: (n, 3, n, 3) spline coefficients of the displacement of the contact face, 1/mm.
        by_poisson, by_thickness: (m, 3, n, 3) derivatives of `marker` by Poisson's ratio and by the thickness
            (per mm); the markers keep their depth below the contact face.
        by_marker_depth: (m, 3, n, 3) derivative by that depth, per mm.
        depth_by_poisson, depth_by_thickness: (n, n) derivatives of the depths in `face` per normal force.
    """

    marker: Float64[np.ndarray, "m 3 nodes 3"]
    face: Float64[np.ndarray, "nodes 3 nodes 3"]
    by_poisson: Float64[np.ndarray, "m 3 nodes 3"]
    by_thickness: Float64[np.ndarray, "m 3 nodes 3"]
    by_marker_depth: Float64[np.ndarray, "m 3 nodes 3"]
    depth_by_poisson: Float64[np.ndarray, "nodes nodes"]
    depth_by_thickness: Float64[np.ndarray, "nodes nodes"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Part:
    """Displacements with one symmetry, in the order slow node, fast node, polynomial, component.

    Attributes:
        stiffness: two matrices, to be multiplied by the Lame constants over E.
        thicker: their derivatives by the thickness, per mm.
        unfold: (unknowns of the pad, unknowns of the part) coefficients of the pad.
        unfold_face: (3 n, face unknowns of the part) the same of the contact face.
        on_face: (face unknowns,) numbers of the face's unknowns in the part.
        block: number of unknowns that depend on each other and on those of the next block only.
    """

    stiffness: Float64[np.ndarray, "2 k k"]
    thicker: Float64[np.ndarray, "2 k k"]
    unfold: csr_array
    unfold_face: csr_array
    on_face: Int64[np.ndarray, " f"]
    block: int


def pad_response(
    patch: SplinePatch,
    thickness_mm: float,
    poisson: float,
    marker_mm: Points2,
    marker_depth_mm: float = 0.0,
) -> PadResponse:
    """The response of a pad.

    Args:
        patch: outline and nodes of the pad, with `boundary="soft"` and odd numbers of elements.
        thickness_mm: of the pad.
        poisson: its Poisson's ratio, below 1/2.
        marker_mm: (m, 2) places of the markers at rest.
        marker_depth_mm: of the markers below the contact face.

    Raises:
        ValueError: an even number of elements.
        ZeroDivisionError: a Poisson's ratio of 1/2.
    """
    if patch.elements[0] % 2 == 0 or patch.elements[1] % 2 == 0:
        raise ValueError(f"a pad needs odd numbers of elements, not {patch.elements}")
    lame, slope = lame_constants(poisson), _lame_slopes(poisson)
    at, by_share = _values_at(patch, marker_mm, 1.0 - marker_depth_mm / thickness_mm)
    count, nodes = len(marker_mm), patch.node_count
    marker, by_poisson, by_thickness, raised_by = (np.zeros((3 * count, 3 * nodes)) for _ in range(4))
    face = np.zeros((3 * nodes, 3 * nodes))
    depth_by_poisson, depth_by_thickness = np.zeros((nodes, nodes)), np.zeros((nodes, nodes))
    for part in _parts(patch, thickness_mm):
        own_at, own_raised = csr_array(at @ part.unfold), csr_array(by_share @ part.unfold)
        load = np.zeros((own_at.shape[1], len(part.on_face)))
        load[part.on_face, np.arange(len(part.on_face))] = 1.0
        right = np.hstack([load, own_at.toarray().T])
        both = _solve(_weighted(part.stiffness, lame), right, part.block)
        answer, reciprocal = both[:, : load.shape[1]], both[:, load.shape[1] :]
        fold = csr_array(part.unfold_face.T)
        face += (fold.T @ (fold.T @ answer[part.on_face]).T).T
        marker += (fold.T @ (own_at @ answer).T).T
        pressed, upright = answer[:, 2::3], csr_array(part.unfold_face[2::3, 2::3])
        for factors, matrices, by_marker, by_depth in (
            (slope, part.stiffness, by_poisson, depth_by_poisson),
            (lame, part.thicker, by_thickness, depth_by_thickness),
        ):
            changed = _product(_weighted(matrices, factors), answer, part.block)
            by_marker[:] -= (fold.T @ (reciprocal.T @ changed).T).T
            by_depth[:] -= (upright @ (upright @ (pressed.T @ changed[:, 2::3])).T).T
        raised_by += (fold.T @ (own_raised @ answer).T).T
    # the share 1 - depth / thickness of the markers' height depends on both
    by_thickness += marker_depth_mm / thickness_mm**2 * raised_by
    shape = (count, 3, nodes, 3)
    return PadResponse(
        marker=read_only(marker.reshape(shape)),
        face=read_only(face.reshape(nodes, 3, nodes, 3)),
        by_poisson=read_only(by_poisson.reshape(shape)),
        by_thickness=read_only(by_thickness.reshape(shape)),
        by_marker_depth=read_only((-raised_by / thickness_mm).reshape(shape)),
        depth_by_poisson=read_only(depth_by_poisson),
        depth_by_thickness=read_only(depth_by_thickness),
    )


def _lame_slopes(poisson: float) -> tuple[float, float]:
    """Derivatives of `lame_constants` by Poisson's ratio."""
    below = (1.0 + poisson) * (1.0 - 2.0 * poisson)
    return (1.0 + 2.0 * poisson**2) / below**2, -0.5 / (1.0 + poisson) ** 2


def _parts(patch: SplinePatch, thickness_mm: float) -> Iterator[_Part]:
    """The four symmetries of a rectangular pad."""
    splines = [spline_axis(patch, axis) for axis in patch.axes]
    axes = (*splines, depth_axis(thickness_mm))
    x_number = patch.axes.index(0)
    order = (x_number, 1 - x_number, 2)  # number of the axis of x, y, z among slow, fast, through
    half = [count // 2 for count in patch.shape]
    degree = np.eye(DEGREE_Z)
    on_face = 3 * DEGREE_Z * np.arange(half[0] * half[1])[:, None] + np.arange(3)
    for is_odd in ((False, False), (False, True), (True, False), (True, True)):
        # the component along an axis is even about its mirror plane where the others are odd
        mirrors = [
            [
                _mirror(patch.shape[number], is_odd[number] != (order[component] == number))
                for number in range(2)
            ]
            + [csr_array(degree)]
            for component in range(3)
        ]
        dense = [[each.toarray() for each in mirror] for mirror in mirrors]
        stiffness, thicker = _stiffness(axes, order, dense, thickness_mm)
        yield _Part(
            stiffness=stiffness,
            thicker=thicker,
            unfold=_interleaved([csr_array(kron(kron(each[0], each[1]), each[2])) for each in mirrors]),
            unfold_face=_interleaved([csr_array(kron(each[0], each[1])) for each in mirrors]),
            on_face=on_face.ravel(),
            block=_COUPLED_NODES * half[1] * DEGREE_Z * 3,
        )


def _mirror(count: int, is_odd: bool) -> csr_array:
    """(count, count / 2) orthonormal even or odd combinations of functions and their mirror images."""
    half, value = np.arange(count // 2), np.sqrt(0.5)
    mirrored = -value if is_odd else value
    row, column = np.concatenate([half, count - 1 - half]), np.tile(half, 2)
    data = np.repeat([value, mirrored], count // 2)
    return csr_array((data, (row, column)), shape=(count, count // 2))


def _interleaved(block: Sequence[csr_array]) -> csr_array:
    """One matrix of those of the three components, the component counting fastest."""
    total = csr_array((3 * block[0].shape[0], 3 * block[0].shape[1]))
    for component in range(3):
        unit = np.zeros((3, 3))
        unit[component, component] = 1.0
        total = total + kron(block[component], unit)
    return csr_array(total)


def _stiffness(
    axes: Sequence[Axis],
    order: Sequence[int],
    mirrors: Sequence[Sequence[np.ndarray]],
    thickness_mm: float,
) -> tuple[Float64[np.ndarray, "2 k k"], Float64[np.ndarray, "2 k k"]]:
    """The two stiffness matrices of a part, to be multiplied by the Lame constants, and their derivatives.

    Integrals of two values through the thickness are proportional to it, those of two slopes to its inverse,
    and those of a value and a slope do not depend on it.

    Args:
        axes: along the slow and the fast axis and through the thickness.
        order: number of the axis in `axes` of x, y and z.
        mirrors: for each component and axis, the functions of the part.
        thickness_mm: of the pad.
    """
    sizes = [mirrors[0][number].shape[1] for number in range(3)]
    stiffness, thicker = np.zeros((2, 2, *sizes, 3, *sizes, 3))

    def add(lame: int, row: int, column: int, along_row: int, along_column: int) -> None:
        """The integral of a derivative of the functions of one component times one of those of another."""
        parts = []
        for number, axis in enumerate(axes):
            by_row, by_column = order[along_row] == number, order[along_column] == number
            if by_row:
                matrix = axis.slope if by_column else axis.mixed
            else:
                matrix = axis.mixed.T if by_column else axis.value
            parts.append(mirrors[row][number].T @ matrix @ mirrors[column][number])
        in_plane = np.einsum("ab,cd->acbd", parts[0], parts[1])
        found = in_plane[:, :, None, :, :, None] * parts[2][:, None, None, :]
        stiffness[lame, :, :, :, row, :, :, :, column] += found
        power = 1 - (along_row == 2) - (along_column == 2)
        if power:
            thicker[lame, :, :, :, row, :, :, :, column] += power / thickness_mm * found

    for row, column in np.ndindex(3, 3):
        add(0, row, column, row, column)
        add(1, row, column, column, row)
    for row, along in np.ndindex(3, 3):
        add(1, row, row, along, along)
    unknowns = 3 * int(np.prod(sizes))
    return stiffness.reshape(2, unknowns, unknowns), thicker.reshape(2, unknowns, unknowns)


def _weighted(
    matrices: Float64[np.ndarray, "2 k k"], factors: tuple[float, float]
) -> Float64[np.ndarray, "k k"]:
    """The sum of two matrices, each times a factor."""
    total = np.asarray(factors[0] * matrices[0])
    total += factors[1] * matrices[1]
    return total


def _product(
    matrix: Float64[np.ndarray, "k k"], right: Float64[np.ndarray, "k r"], block: int
) -> Float64[np.ndarray, "k r"]:
    """The product of a block tridiagonal matrix with others."""
    found = np.empty_like(right)
    for start in range(0, len(matrix), block):
        near = slice(max(start - block, 0), start + 2 * block)
        found[start : start + block] = matrix[start : start + block, near] @ right[near]
    return found


def _solve(
    matrix: Float64[np.ndarray, "k k"], right: Float64[np.ndarray, "k r"], block: int
) -> Float64[np.ndarray, "k r"]:
    """Solution of equations with a block tridiagonal, positive definite matrix."""
    starts = range(0, len(matrix), block)
    factors: list[tuple[np.ndarray, bool]] = []
    links: list[np.ndarray] = []
    part = right.copy()
    for start in starts:
        own = slice(start, start + block)
        diagonal = matrix[own, own].copy()
        if start > 0:
            before = slice(start - block, start)
            link = matrix[own, before]
            carried = cho_solve(factors[-1], link.T, check_finite=False)
            diagonal -= link @ carried
            part[own] -= carried.T @ part[before]
            links.append(carried)
        factors.append(cho_factor(diagonal, lower=True, check_finite=False))
    for number, start in reversed(list(enumerate(starts))):
        own = slice(start, start + block)
        part[own] = cho_solve(factors[number], part[own], check_finite=False)
        if number + 1 < len(factors):
            part[own] -= links[number] @ part[start + block : start + 2 * block]
    return part


def _values_at(patch: SplinePatch, point_mm: Points2, share: float) -> tuple[csr_array, csr_array]:
    """(3 m, unknowns) displacement of points at a share of the thickness above the bonded face.

    The second is its derivative by the share.
    """
    found = patch.at(point_mm)
    value, slope = (through[0] for through in polynomials(np.array([share])))
    return _times(found, value, patch), _times(found, slope, patch)


def _times(found: PointBasis, through: np.ndarray, patch: SplinePatch) -> csr_array:
    """(3 m, unknowns) functions at points, times those through the thickness (DEGREE_Z,)."""
    count = len(found.node)
    column = (found.node[:, :, None] * DEGREE_Z + np.arange(DEGREE_Z))[..., None] * 3 + np.arange(3)
    row = np.broadcast_to(3 * np.arange(count)[:, None, None, None] + np.arange(3), column.shape)
    value = np.broadcast_to((found.value[:, :, None] * through)[..., None], column.shape)
    return csr_array(
        (value.ravel(), (row.ravel(), column.ravel())),
        shape=(3 * count, patch.node_count * DEGREE_Z * 3),
    )
