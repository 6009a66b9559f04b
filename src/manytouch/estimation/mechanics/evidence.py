"""The likelihood of the forces on a few nodes, and patches of pressure that are fitted to it.

The posterior of the last full step gives the forces f of some nodes a mean m and a covariance C, with all
other unknowns marginalised. It contains the prior of the normal forces, with mean 0 and precision B (their
weights), which favours forces on few nodes. The likelihood without the prior is

    -2 log p(markers | f) = f^T L f - 2 h^T f + const,      L = C^-1 - B,      h = C^-1 m

(C. E. Rasmussen and C. K. I. Williams 2006, chapter 2: a Gaussian divided by a Gaussian). A patch of pressure
that is fitted to this likelihood is not attracted by nodes, so that its centre is an unbiased one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.mechanics.gauss_newton import Fit
from manytouch.estimation.mechanics.patch_kernels import NodeGrid, Whitened, fit_patches
from manytouch.estimation.mechanics.sheet_model import InversionModel
from manytouch.geometry.spline import basis
from manytouch.values import Status
from manytouch.values.arrays import Points2, Scalars

_MIN_NODES = 9
_MAX_STEPS = 30
_LENGTH_MM = 1e-3  # of finite differences
_WIDER_MM2 = 0.5  # increase of the variance of a patch, to measure the curvature of its misfit
_RANK = 1e-6  # combinations with less information than this share of the best one's are dropped


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Evidence:
    """The likelihood of the forces of n nodes: q independent combinations with unit variance.

    Attributes:
        white: (q, n) the combinations, each divided by its standard deviation.
        aim: (q,) their most likely values.
        knot_x_mm, knot_y_mm: of the splines along x and y.
        local: (nx, ny) number of each spline function's node among the n, or -1.
    """

    white: Float64[np.ndarray, "q n"]
    aim: Float64[np.ndarray, " q"]
    knot_x_mm: Float64[np.ndarray, " kx"]
    knot_y_mm: Float64[np.ndarray, " ky"]
    local: Int64[np.ndarray, "nx ny"]

    def fit_point(
        self, force_mm2: float, centre_mm: Float64[np.ndarray, "2"]
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2 2"]]:
        """Centre of the point force that fits best, and its covariance; from a guess of force and centre."""
        theta = np.array([force_mm2, *centre_mm, 0.0, 0.0, 0.0])
        _, curved = self._fit(theta, [1e-3 * force_mm2, _LENGTH_MM, _LENGTH_MM, 0.0, 0.0, 0.0])
        return theta[1:3], np.linalg.pinv(curved[:3, :3])[1:, 1:]

    def fit_size(self, force_mm2: float, centre_mm: Float64[np.ndarray, "2"]) -> tuple[float, float]:
        """Variance along each axis of the round patch that fits best, and its standard deviation, in mm^2.

        The standard deviation is that at which the misfit has increased by the least misfit per combination,
        or by 0.1 if that is more.
        """
        theta = np.array([force_mm2, *centre_mm, 0.0, *centre_mm, 1.0])
        step = [1e-3 * force_mm2, _LENGTH_MM, _LENGTH_MM, 0.0, 0.0, 0.0, _LENGTH_MM]
        best, _ = self._fit(theta, step)
        variance_mm2 = float(theta[6] ** 2)
        theta[6] = np.sqrt(variance_mm2 + _WIDER_MM2)
        grown = max(self._fit(theta, [*step[:6], 0.0])[0] - best, 1e-9)
        per_combination = max(best / max(len(self.aim) - 4, 1), 0.1)
        return variance_mm2, _WIDER_MM2 * float(np.sqrt(per_combination / grown))

    def misfit_of_one(
        self,
        force_mm2: float,
        centre_mm: Float64[np.ndarray, "2"],
        spread_mm2: Float64[np.ndarray, "2 2"],
    ) -> float:
        """Misfit of the one patch of any size, shape and centre that fits best, from a guess."""
        root = np.linalg.cholesky(spread_mm2 + 0.3 * np.eye(2))
        theta = np.array([force_mm2, *centre_mm, root[0, 0], root[1, 0], root[1, 1]])
        return self._fit(theta, [1e-3 * force_mm2] + 5 * [_LENGTH_MM])[0]

    def fit_two(
        self, force_mm2: Float64[np.ndarray, "2"], centre_mm: Points2, deviation_mm: float
    ) -> tuple[float, Float64[np.ndarray, "2"], Points2, float]:
        """The two round patches of one size that fit best.

        Returns:
            Misfit, forces over E (2,), centres (2, 2), and standard deviation along each axis, mm.
        """
        theta = np.array([force_mm2[0], *centre_mm[0], force_mm2[1], *centre_mm[1], deviation_mm])
        patch = [1e-3 * float(force_mm2.sum()), _LENGTH_MM, _LENGTH_MM]
        misfit, _ = self._fit(theta, [*patch, *patch, _LENGTH_MM])
        return misfit, theta[[0, 3]], np.array([theta[1:3], theta[4:6]]), abs(float(theta[6]))

    def _fit(self, theta: Scalars, step: list[float]) -> tuple[float, Float64[np.ndarray, "p p"]]:
        """Least misfit and its curvature; `theta` is changed in place."""
        grid = NodeGrid(self.knot_x_mm, self.knot_y_mm, self.local)
        likelihood = Whitened(self.white, self.aim)
        misfit, curved = fit_patches(theta, np.array(step), grid, likelihood, _MAX_STEPS)
        return float(misfit), curved


def evidence_at(model: InversionModel, fit: Fit, node: Int64[np.ndarray, " n"]) -> Evidence | None:
    """The likelihood of the normal forces of some nodes; None if there are too few or the fit has failed.

    Args:
        model: of the sheet.
        fit: of the frame.
        node: (n,) numbers of the nodes; fixed ones and those without contacts are left out.
    """
    node = node[~model.is_excluded[node] & model.patch.is_free[node, 2]]
    if len(node) < _MIN_NODES or fit.status is not Status.OK:
        return None
    posterior = fit.posterior
    inverse = np.linalg.inv(posterior.covariance(posterior.linearisation.force_rows(node, 2)))
    likelihood = inverse - np.diag(posterior.weight[node, 2])
    size, axes = np.linalg.eigh(0.5 * (likelihood + likelihood.T))
    is_used = size > _RANK * size[-1]
    root = np.sqrt(size[is_used])
    axes = axes[:, is_used]
    return Evidence(
        white=np.ascontiguousarray(root[:, None] * axes.T),
        aim=-(axes.T @ (inverse @ fit.shape.force_mm2[node, 2])) / root,
        knot_x_mm=_knots_mm(model, 0),
        knot_y_mm=_knots_mm(model, 1),
        local=_local(model, node),
    )


def _knots_mm(model: InversionModel, axis: int) -> Scalars:
    patch = model.patch
    return np.asarray(basis.knots(patch.size_mm[axis], patch.elements[axis]) + patch.corner_mm[axis])


def _local(model: InversionModel, node: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, "nx ny"]:
    patch = model.patch
    of_node = np.full(patch.node_count, -1, dtype=np.int64)
    of_node[node] = np.arange(len(node))
    grid = of_node.reshape(patch.shape)
    along_x = grid if patch.is_x_slow else grid.T
    return np.ascontiguousarray(np.pad(along_x, patch.dropped, constant_values=-1))
