"""Coefficients by which its neighbours' displacements give a marker's."""

import numpy as np

from manytouch.values.arrays import Mask, Points2

_LEAST_QUADRATIC = 10
_LEAST_LINEAR = 4
_MOST_NOISE = 0.6
_RIDGE = 1e-9
SOFTENING = 0.3


def blends(
    points: Points2, is_present: Mask, spacing_px: np.ndarray, start: np.ndarray, near: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (k,) and coefficients (k,) over the neighbours of all nodes, and which nodes have the latter.

    Least squares over present neighbours, weighted by 1 / (distance^2 + 0.3) in spacings: a quadratic fit
    where noise does not grow by it, else a linear one, else none (corners, thin strips).
    """
    count = np.diff(start)
    node = np.repeat(np.arange(len(points)), count)
    away = (points[near] - points[node]) / spacing_px[node][:, None]
    weight = 1.0 / ((away**2).sum(axis=1) + SOFTENING)
    blend = np.zeros(len(near))
    is_blended = np.zeros(len(points), dtype=bool)
    if len(near) == 0:
        return weight, blend, is_blended
    widest = int(count.max())
    slot = np.arange(len(near)) - start[:-1][node]
    x, y, w = (np.zeros((len(points), widest)) for _ in range(3))
    x[node, slot], y[node, slot] = away.T
    w[node, slot] = weight * is_present[near]
    used = (w > 0).sum(axis=1)
    one = np.ones_like(x)
    for basis, least in (
        (np.stack([one, x, y, x * x, x * y, y * y], axis=-1), _LEAST_QUADRATIC),
        (np.stack([one, x, y], axis=-1), _LEAST_LINEAR),
    ):
        todo = np.flatnonzero(is_present & ~is_blended & (used >= least))
        if len(todo) == 0:
            continue
        weighted = basis[todo] * w[todo][..., None]
        normal = np.einsum("nki,nkj->nij", weighted, basis[todo]) + _RIDGE * np.eye(basis.shape[-1])
        first = np.zeros((len(todo), basis.shape[-1], 1))
        first[:, 0] = 1.0
        coefficient = np.einsum("nki,ni->nk", weighted, np.linalg.solve(normal, first)[..., 0])
        good = (coefficient**2).sum(axis=1) < _MOST_NOISE
        rows = todo[good]
        table = np.zeros((len(points), widest))
        table[rows] = coefficient[good]
        is_blended[rows] = True
        chosen = np.isin(node, rows)
        blend[chosen] = table[node[chosen], slot[chosen]]
    return weight, blend, is_blended
