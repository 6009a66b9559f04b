"""Compiled loops that fit one or two patches of pressure to nodal forces."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import no_type_check

import numpy as np
from numba import njit

ONE = 6
"""Parameters of one patch: force, x, y, and the triangular root xx, yx, yy of its second moment. Two have 7:
force, x, y of each, and the deviation of both along each axis."""
_PLACE = 2.0 * np.cos(np.pi * np.arange(1, 6) / 6.0)  # in deviations
_WEIGHT = np.sin(np.pi * np.arange(1, 6) / 6.0) ** 2 / 3.0


@njit(cache=True, nogil=True)
@no_type_check
def _functions(knot, place, value):
    """The four cubic B-splines at a place (Cox-de Boor); returns the first one's number."""
    place = min(max(place, knot[3]), knot[-4])
    span = 3
    while span < len(knot) - 5 and place >= knot[span + 1]:
        span += 1
    value[0] = 1.0
    for degree in range(1, 4):
        saved = 0.0
        for k in range(degree):
            right, left = knot[span + k + 1], knot[span + 1 - degree + k]
            part = value[k] / (right - left)
            value[k] = saved + (right - place) * part
            saved = (place - left) * part
        value[degree] = saved
    return span - 3


@njit(cache=True, nogil=True)
@no_type_check
def _press(knot_x, knot_y, local, force, x, y, root, nodal):
    """Adds the nodal forces of a patch to `nodal`: those of an even ellipse, by 25 points.

    `root` (3,) is the lower triangle xx, yx, yy of a root of its second moment. The density of an ellipse
    along an axis is a semicircle, for which these points and weights are Gauss's (of Chebyshev's second
    kind).
    """
    along_x, along_y = np.empty(4), np.empty(4)
    for a in range(5):
        for b in range(5):
            share = force * _WEIGHT[a] * _WEIGHT[b]
            first_x = _functions(knot_x, x + _PLACE[a] * root[0], along_x)
            first_y = _functions(knot_y, y + _PLACE[a] * root[1] + _PLACE[b] * root[2], along_y)
            for i in range(4):
                for j in range(4):
                    k = local[first_x + i, first_y + j]
                    if k >= 0:
                        nodal[k] += share * along_x[i] * along_y[j]


@njit(cache=True, nogil=True)
@no_type_check
def _left(theta, white, aim, knot_x, knot_y, local, result):
    """Whitened residual of a hypothesis; returns its square."""
    nodal, root = np.zeros(white.shape[1]), np.zeros(3)
    if len(theta) == ONE:
        root[:] = theta[3:]
        _press(knot_x, knot_y, local, theta[0], theta[1], theta[2], root, nodal)
    else:
        root[0] = root[2] = theta[6]
        for k in (0, 3):
            if theta[k] != 0.0:
                _press(knot_x, knot_y, local, theta[k], theta[k + 1], theta[k + 2], root, nodal)
    total = 0.0
    for q in range(len(aim)):
        left = aim[q]
        for k in range(len(nodal)):
            left -= white[q, k] * nodal[k]
        result[q] = left
        total += left * left
    return total


@njit(cache=True, nogil=True)
@no_type_check
def fit_patches(theta, step, white, aim, knot_x, knot_y, local, most):
    """Levenberg-Marquardt from `theta`, which is changed in place; returns the misfit and its curvature
    (p, p), that is the inverse covariance.

    Args:
        theta: (6,) or (7,) parameters of one or two patches.
        step: (p,) for differences; what has 0 stays as it is.
        white: (q, n) that whitens nodal forces.
        aim: (q,) whitened nodal forces.
        knot_x, knot_y: knots along both axes.
        local: (nx, ny) number among the n nodes, or -1.
        most: steps.
    """
    count, rows = len(theta), len(aim)
    now, tried, slope = np.empty(rows), np.empty(rows), np.zeros((rows, count))
    misfit, damping = _left(theta, white, aim, knot_x, knot_y, local, now), 1e-3
    gram = np.zeros((count, count))
    for _ in range(most):
        for p in range(count):
            if step[p] != 0.0:
                moved = theta.copy()
                moved[p] += step[p]
                _left(moved, white, aim, knot_x, knot_y, local, tried)
                slope[:, p] = (now - tried) / step[p]
        gram, pull = slope.T @ slope, slope.T @ now
        before = misfit
        for _ in range(6):
            damped = gram.copy()
            for p in range(count):
                damped[p, p] += damping * gram[p, p] + 1e-9
            moved = theta + np.linalg.solve(damped, pull)
            found = _left(moved, white, aim, knot_x, knot_y, local, tried)
            if found < misfit:
                theta[:], now[:], misfit = moved, tried, found
                damping = max(0.1 * damping, 1e-9)
                break
            damping = max(10.0 * damping, 1e-6)
        if before - misfit <= 1e-4 * before + 0.01:
            break
    return misfit, gram
