"""Coefficients that predict the displacement of a marker from its neighbours', to verify identities.

Where a marker that is not seen is expected is decided in `state_update` and `matching.growth`.

The constants are choices, on which no recording was fitted.
"""

import numpy as np

from manytouch.values.arrays import Mask, Points2

_LEAST_QUADRATIC, _LEAST_AFFINE = 10, 4
"""Least number of neighbours of a fit: more than its 6 or 3 unknowns, so that one false match does not
determine it."""
_MOST_NOISE_VARIANCE = 0.6
"""Largest variance of a prediction over that of one neighbour. Quadratic fits to a square lattice have 0.30
inside, 0.59 at a straight side and 0.70 next to a corner; the affine fit at a corner has 1.3."""
_RIDGE = 1e-9
"""Added to the diagonal of the normal matrix, which is singular for neighbours on one line."""
_SOFTENING = 0.3
"""Added to the squared distance in spacings, so that the nearest neighbours do not determine a fit alone."""


def interpolation_weights(
    points: Points2, is_present: Mask, spacing_px: np.ndarray, start: np.ndarray, neighbour: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least-squares weights and interpolation coefficients of the neighbours of all nodes.

    Fits to the present neighbours, weighted by 1 / (distance^2 + `_SOFTENING`) in spacings: quadratic where
    the squared coefficients, the variance of the prediction over that of one neighbour, add up to less than
    `_MOST_NOISE_VARIANCE`, else affine where these do, else none (corners, thin strips).

    Args:
        points: (N, 2) nodes at rest.
        is_present: (N,) markers that are not known to be missing.
        spacing_px: (N,) local spacings.
        start, neighbour: (N + 1,) and (k,) of `GraphArrays`.

    Returns:
        (k,) weights; (k,) coefficients, 0 of neighbours that are not present; (N,) nodes that have
        coefficients.
    """
    count = np.diff(start)
    node = np.repeat(np.arange(len(points)), count)
    away = (points[neighbour] - points[node]) / spacing_px[node][:, None]
    weight = 1.0 / ((away**2).sum(axis=1) + _SOFTENING)
    interpolation = np.zeros(len(neighbour))
    is_interpolated = np.zeros(len(points), dtype=bool)
    if len(neighbour) == 0:
        return weight, interpolation, is_interpolated
    widest = int(count.max())
    slot = np.arange(len(neighbour)) - start[:-1][node]
    x, y, w = (np.zeros((len(points), widest)) for _ in range(3))
    x[node, slot], y[node, slot] = away.T
    w[node, slot] = weight * is_present[neighbour]
    used = (w > 0).sum(axis=1)
    one = np.ones_like(x)
    for basis, least in (
        (np.stack([one, x, y, x * x, x * y, y * y], axis=-1), _LEAST_QUADRATIC),
        (np.stack([one, x, y], axis=-1), _LEAST_AFFINE),
    ):
        todo = np.flatnonzero(is_present & ~is_interpolated & (used >= least))
        if len(todo) == 0:
            continue
        weighted = basis[todo] * w[todo][..., None]
        normal = np.einsum("nki,nkj->nij", weighted, basis[todo]) + _RIDGE * np.eye(basis.shape[-1])
        first = np.zeros((len(todo), basis.shape[-1], 1))
        first[:, 0] = 1.0
        coefficient = np.einsum("nki,ni->nk", weighted, np.linalg.solve(normal, first)[..., 0])
        good = (coefficient**2).sum(axis=1) < _MOST_NOISE_VARIANCE
        rows = todo[good]
        table = np.zeros((len(points), widest))
        table[rows] = coefficient[good]
        is_interpolated[rows] = True
        chosen = np.isin(node, rows)
        interpolation[chosen] = table[node[chosen], slot[chosen]]
    return weight, interpolation, is_interpolated
