"""The direct solver against a dense one."""

import numpy as np
import pytest

from manytouch.simulation.fem.elements.mesh import HexMesh, tensor_mesh
from manytouch.simulation.fem.solver.multifrontal import MultifrontalSolver


def system(seed: int = 0) -> tuple[HexMesh, np.ndarray, np.ndarray, np.ndarray]:
    """A mesh of 4 x 3 x 2 elements, random free unknowns, positive element matrices and forces."""
    rng = np.random.default_rng(seed)
    mesh = tensor_mesh(np.arange(5.0), np.arange(4.0), np.arange(3.0))
    root = rng.standard_normal((len(mesh.element), 60, 20))
    free = rng.random(mesh.node_mm.shape) > 0.2
    return mesh, root @ root.transpose(0, 2, 1) + np.eye(60), free, rng.standard_normal(mesh.node_mm.shape)


def dense_solution(mesh: HexMesh, tangent: np.ndarray, free: np.ndarray, right: np.ndarray) -> np.ndarray:
    matrix = np.zeros((right.size, right.size))
    unknown = (3 * mesh.element[:, :, None] + np.arange(3)).reshape(len(tangent), 60)
    for rows, element in zip(unknown, tangent, strict=True):
        matrix[np.ix_(rows, rows)] += element
    held = np.flatnonzero(~free.ravel())
    matrix[held] = matrix[:, held] = 0.0
    matrix[held, held] = 1.0
    return np.linalg.solve(matrix, np.where(free, right, 0.0).ravel()).reshape(right.shape)


@pytest.mark.parametrize("kind", ["positive", "indefinite", "not symmetric"])
def test_it_solves_what_a_dense_solver_solves(kind: str) -> None:
    mesh, tangent, free, right = system()
    if kind == "indefinite":
        tangent = tangent - 25.0 * np.eye(60)
    if kind == "not symmetric":
        tangent = tangent + 0.3 * np.random.default_rng(9).standard_normal(tangent.shape)
    factors = MultifrontalSolver(mesh=mesh, is_free=free).factorise(
        tangent, is_symmetric=kind != "not symmetric"
    )
    expected = dense_solution(mesh, tangent, free, right)
    np.testing.assert_allclose(factors.solve(right), expected, atol=1e-8 * np.abs(expected).max())
    assert (factors.pivoted_parts == 0) == (kind == "positive")


def test_held_unknowns_stay() -> None:
    mesh, tangent, free, right = system(4)
    found = MultifrontalSolver(mesh=mesh, is_free=free).factorise(tangent, is_symmetric=True).solve(right)
    assert np.all(found[~free] == 0.0)


def test_a_body_that_nothing_holds_is_refused() -> None:
    mesh, tangent, _, right = system()
    order = MultifrontalSolver(mesh=mesh, is_free=np.ones_like(right, dtype=np.bool_))
    with pytest.raises(np.linalg.LinAlgError, match="not supported"):
        order.factorise(np.zeros_like(tangent), is_symmetric=True)
