"""Rigid faces that are fitted to the markers: bars, whose pressure may rise towards their ends, and elliptic
faces, whose pressure may rise towards their edge.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.clusters.evidence import (
    LENGTH_MM,
    Evidence,
    inverse_of,
)
from manytouch.estimation.mechanics.clusters.fitted_patches import PairFit, PatchFit
from manytouch.estimation.mechanics.clusters.patch_kernels import (
    ALONG,
    bar_profile,
    elliptic_profile,
    elliptic_radii,
)
from manytouch.values.arrays import Scalars

CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
_ANGLE = 2.0 * np.pi * np.arange(24) / 24
_CIRCLE = np.column_stack([np.cos(_ANGLE), np.sin(_ANGLE)])


def fit_bar(evidence: Evidence, pair: PairFit) -> PatchFit:
    """The bar that fits best, from two patches: a rigid face that presses most with its ends or corners.

    Its pressure is even across it; see `patch_kernels.BAR`.
    """
    share = pair.force_mm2 / pair.force_mm2.sum()
    arm = 0.5 * (pair.centre_mm[1] - pair.centre_mm[0])
    size_mm = float(np.linalg.norm(arm))
    half_length_mm = arm / size_mm * np.sqrt(3.0 * (size_mm**2 + pair.deviation_mm**2))
    half_width_mm = max(np.sqrt(3.0) * pair.deviation_mm, 0.1 * size_mm)
    # force over E (mm^2); x, y of the middle, x, y of half the length, half the width (mm); tilt, end load
    centre_mm = share @ pair.centre_mm
    theta = np.array([pair.force_mm2.sum(), *centre_mm, *half_length_mm, half_width_mm, 0.0, 0.0])
    step = np.array([1e-3 * theta[0]] + 7 * [LENGTH_MM])
    misfit, curvature = evidence.fit(theta, step.tolist())
    along, across = theta[3:5], theta[5] * np.array([-theta[4], theta[3]]) / np.hypot(theta[3], theta[4])
    outline_mm = theta[1:3] + np.outer(CORNERS[:, 0], along) + np.outer(CORNERS[:, 1], across)
    return _face(evidence, theta, step, misfit, curvature, estimates=_bar_estimates, outline_mm=outline_mm)


def fit_elliptic_face(evidence: Evidence, one: PatchFit) -> PatchFit:
    """The elliptic face that fits best, from an even ellipse; see `patch_kernels.ELLIPTIC_FACE`."""
    root = np.linalg.cholesky(one.spread_mm2 + 1e-6 * np.eye(2))
    # force over E (mm^2); x, y of the centre, triangular root of the second moment xx, yx, yy (mm); edge load
    theta = np.array([one.force_mm2, *one.centre_mm, root[0, 0], root[1, 0], root[1, 1], 0.2, 0.0, 0.0])
    step = np.array([1e-3 * theta[0]] + 6 * [LENGTH_MM] + 2 * [0.0])  # parameters with step 0 are fixed
    misfit, curvature = evidence.fit(theta, step.tolist())
    lower = np.array([[theta[3], 0.0], [theta[4], theta[5]]])
    outline_mm = theta[1:3] + 2.0 * _CIRCLE @ lower.T
    return _face(
        evidence, theta, step, misfit, curvature, estimates=_elliptic_estimates, outline_mm=outline_mm
    )


def _face(
    evidence: Evidence,
    theta: Scalars,
    step: Scalars,
    misfit: float,
    curvature: Float64[np.ndarray, "p p"],
    *,
    estimates: Callable[[Scalars], Float64[np.ndarray, "6"]],
    outline_mm: Float64[np.ndarray, "k 2"],
) -> PatchFit:
    at, change = estimates(theta), np.zeros((6, len(theta)))
    for number in np.flatnonzero(step):
        moved = theta.copy()
        moved[number] += step[number]
        change[:, number] = (estimates(moved) - at) / step[number]
    inverse = inverse_of(curvature)
    per_combination = evidence.mean_misfit(misfit, len(theta))
    xx, xy, yy = at[3:]
    return PatchFit(
        misfit=misfit,
        force_mm2=float(theta[0]),
        centre_mm=at[1:3],
        spread_mm2=np.array([[xx, xy], [xy, yy]]),
        covariance=per_combination * change @ inverse @ change.T,
        nodal_mm2=evidence.nodal(theta),
        outline_mm=outline_mm,
    )


def _bar_estimates(theta: Scalars) -> Float64[np.ndarray, "6"]:
    """Force, centroid, and the second moments xx, xy, yy of a bar."""
    share, along = bar_profile(theta), theta[3:5]
    mean = share @ ALONG
    variance, across = share @ ALONG**2 - mean**2, np.array([-along[1], along[0]]) / np.hypot(*along)
    spread = variance * np.outer(along, along) + theta[5] ** 2 / 3.0 * np.outer(across, across)
    return np.array([theta[0], *(theta[1:3] + mean * along), spread[0, 0], spread[0, 1], spread[1, 1]])


def _elliptic_estimates(theta: Scalars) -> Float64[np.ndarray, "6"]:
    """Force, centre, and the second moments xx, xy, yy of an elliptic face."""
    lower = np.array([[theta[3], 0.0], [theta[4], theta[5]]])
    spread = 2.0 * float(elliptic_profile(theta) @ elliptic_radii() ** 2) * lower @ lower.T
    return np.array([*theta[:3], spread[0, 0], spread[0, 1], spread[1, 1]])
