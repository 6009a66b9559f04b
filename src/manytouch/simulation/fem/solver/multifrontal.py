"""Direct solution of element equations: a multifrontal factorisation by geometric nested dissection.

The elements are halved again and again; from the leaves upwards each part eliminates the unknowns that
no other part shares (J. A. George 1973, doi:10.1137/0710032; I. S. Duff and J. K. Reid 1983,
doi:10.1145/356044.356047). All arithmetic is dense, so on a sheet this is several times faster than
SuperLU with its minimum-degree ordering (docs/decisions/0010), and no sparse matrix is ever built.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64
from scipy.linalg import blas, lapack

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.fem.elements.mesh import HexMesh

LEAF_ELEMENTS = 4
NOWHERE = -1


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Front:
    """One part's dense system: the unknowns it eliminates come first.

    Attributes:
        unknown: (k,) numbers of its unknowns.
        eliminated: how many of them it eliminates.
        elements: (l,) leaves only: elements that are added.
        element_place: (l, 60) where their unknowns stand in the front; NOWHERE: not free.
        children: positions of the parts below in the order of elimination.
        child_place: for each child, where the unknowns that it leaves stand.
    """

    unknown: np.ndarray
    eliminated: int
    elements: np.ndarray
    element_place: np.ndarray
    children: tuple[int, ...]
    child_place: tuple[np.ndarray, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MultifrontalSolver:
    """Solves systems of element matrices of one mesh, in an order of elimination that is found once.

    Attributes:
        mesh: the mesh.
        is_free: (n, 3) unknowns of the system; the others are zero.
    """

    mesh: HexMesh
    is_free: Bool[np.ndarray, "nodes 3"]
    _fronts: list[_Front] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        free = self.is_free.ravel()
        element_unknown = (3 * self.mesh.element[:, :, None] + np.arange(3)).reshape(
            len(self.mesh.element), 60
        )
        element_unknown = np.where(free[element_unknown], element_unknown, NOWHERE)
        shared = np.bincount(element_unknown[element_unknown >= 0], minlength=free.size)
        if np.any(free & (shared == 0)):
            raise ValueError("a free node belongs to no element")
        centre_mm = self.mesh.node_mm[self.mesh.element].mean(axis=1)
        self._append_fronts(np.arange(len(centre_mm)), centre_mm, element_unknown, shared)

    def _append_fronts(
        self, elements: np.ndarray, centre_mm: np.ndarray, element_unknown: np.ndarray, shared: np.ndarray
    ) -> tuple[int, np.ndarray, np.ndarray]:
        """Append the fronts of some elements: its position, unknowns it leaves, how often each was added."""
        below = []
        if len(elements) > LEAF_ELEMENTS:
            extent = np.ptp(centre_mm[elements], axis=0)
            along = centre_mm[elements, int(np.argmax(extent))]
            order = np.argsort(along, kind="stable")
            cut = np.searchsorted(along[order], np.nextafter(np.median(along) + 1e-9 * extent.max(), np.inf))
            cut = len(order) // 2 if cut in (0, len(order)) else int(cut)
            below = [
                self._append_fronts(elements[half], centre_mm, element_unknown, shared)
                for half in (order[:cut], order[cut:])
            ]
            present = np.concatenate([left for _, left, _ in below])
            count = np.concatenate([times for _, _, times in below])
        else:
            present = element_unknown[elements].ravel()
            present = present[present >= 0]
            count = np.ones(len(present), dtype=np.int64)
        unknown, inverse = np.unique(present, return_inverse=True)
        times = np.bincount(inverse, weights=count, minlength=len(unknown)).astype(np.int64)
        is_whole = times == shared[unknown]
        order = np.argsort(~is_whole, kind="stable")
        unknown, times, whole = unknown[order], times[order], int(is_whole.sum())
        self._fronts.append(
            _front(unknown, whole, elements if not below else elements[:0], element_unknown, below)
        )
        return len(self._fronts) - 1, unknown[whole:], times[whole:]

    def factorise(self, tangent: Float64[np.ndarray, "e 60 60"], *, is_symmetric: bool) -> "Factorisation":
        """Factorisation of the sum of the element matrices over the free unknowns.

        A part whose matrix is not positive definite, or any when the matrices are not symmetric, is
        factorised with partial pivoting inside the part.
        """
        left: dict[int, np.ndarray] = {}
        parts = []
        for position, front in enumerate(self._fronts):
            matrix = np.zeros((len(front.unknown), len(front.unknown)))
            _add_elements(matrix, tangent, front.elements, front.element_place)
            for child, place in zip(front.children, front.child_place, strict=True):
                _add_matrix(matrix, left.pop(child), place)
            part, left[position] = _eliminate(matrix, front.eliminated, is_symmetric)
            parts.append(part)
        return Factorisation(fronts=self._fronts, parts=parts)


def _front(
    unknown: np.ndarray,
    eliminated: int,
    elements: np.ndarray,
    element_unknown: np.ndarray,
    below: list[tuple[int, np.ndarray, np.ndarray]],
) -> _Front:
    order = np.argsort(unknown)

    def place(wanted: np.ndarray) -> np.ndarray:
        if not len(unknown):
            return np.full(wanted.shape, NOWHERE)
        found = order[np.minimum(np.searchsorted(unknown, wanted, sorter=order), len(order) - 1)]
        return np.where(unknown[found] == wanted, found, NOWHERE)

    return _Front(
        unknown=unknown,
        eliminated=eliminated,
        elements=elements,
        element_place=place(element_unknown[elements]),
        children=tuple(position for position, _, _ in below),
        child_place=tuple(place(left) for _, left, _ in below),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _FrontFactors:
    """Factors of one front: of Cholesky, or of LU with its pivots.

    Attributes:
        diagonal: (m, m) factors of the block that is eliminated.
        pivots: (m,) of LU; None for Cholesky.
        below: (k - m, m) and right_block: (m, k - m), the blocks that couple it to the other unknowns.
    """

    diagonal: np.ndarray
    pivots: np.ndarray | None
    below: np.ndarray
    right_block: np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Factorisation:
    """A factorised system of equations."""

    fronts: list[_Front]
    parts: list[_FrontFactors]

    @property
    def pivoted_parts(self) -> int:
        """Parts that were not factorised by Cholesky; with 0 the matrix is positive definite."""
        return sum(part.pivots is not None for part in self.parts)

    def solve(self, right: Float64[np.ndarray, "nodes 3"]) -> Float64[np.ndarray, "nodes 3"]:
        """Displacements for nodal forces; unknowns that are not free stay at zero."""
        value = right.ravel().copy()
        for front, part in zip(self.fronts, self.parts, strict=True):
            if front.eliminated == 0:
                continue
            mine, others = front.unknown[: front.eliminated], front.unknown[front.eliminated :]
            if part.pivots is None:
                value[mine] = blas.dtrsv(part.diagonal, value[mine], lower=1)
            else:
                value[mine] = lapack.dgetrs(part.diagonal, part.pivots, value[mine])[0]
            value[others] -= part.below @ value[mine]
        solution = np.zeros_like(value)
        for front, part in zip(reversed(self.fronts), reversed(self.parts), strict=True):
            if front.eliminated == 0:
                continue
            mine, others = front.unknown[: front.eliminated], front.unknown[front.eliminated :]
            rest = value[mine] - part.right_block @ solution[others]
            solution[mine] = (
                rest if part.pivots is not None else blas.dtrsv(part.diagonal, rest, lower=1, trans=1)
            )
        return solution.reshape(right.shape)


def _eliminate(matrix: np.ndarray, count: int, is_symmetric: bool) -> tuple[_FrontFactors, np.ndarray]:
    """Factorisation of the first unknowns, and the matrix that is left for the others."""
    rest = np.ascontiguousarray(matrix[count:, count:])
    if count == 0:
        empty = np.zeros((0, 0))
        return _FrontFactors(
            diagonal=empty, pivots=None, below=np.zeros((len(rest), 0)), right_block=np.zeros((0, len(rest)))
        ), rest
    if is_symmetric:
        diagonal, info = lapack.dpotrf(matrix[:count, :count], lower=1)
        if info == 0:
            below = blas.dtrsm(1.0, diagonal, matrix[count:, :count], side=1, lower=1, trans_a=1)
            rest -= below @ below.T
            return _FrontFactors(diagonal=diagonal, pivots=None, below=below, right_block=below.T), rest
    diagonal, pivots, info = lapack.dgetrf(matrix[:count, :count])
    if info != 0:
        raise np.linalg.LinAlgError(
            "the stiffness is singular: a part of the body is not supported; fix some of its nodes"
        )
    below = matrix[count:, :count].copy()
    right_block = lapack.dgetrs(diagonal, pivots, matrix[:count, count:])[0]
    rest -= below @ right_block
    return _FrontFactors(diagonal=diagonal, pivots=pivots, below=below, right_block=right_block), rest


@kernel()
@no_type_check
def _add_elements(matrix: np.ndarray, tangent: np.ndarray, elements: np.ndarray, place: np.ndarray) -> None:
    for number in range(elements.shape[0]):
        for row in range(60):
            i = place[number, row]
            if i < 0:
                continue
            for column in range(60):
                j = place[number, column]
                if j >= 0:
                    matrix[i, j] += tangent[elements[number], row, column]


@kernel()
@no_type_check
def _add_matrix(matrix: np.ndarray, added: np.ndarray, place: np.ndarray) -> None:
    for row in range(place.shape[0]):
        for column in range(place.shape[0]):
            matrix[place[row], place[column]] += added[row, column]
