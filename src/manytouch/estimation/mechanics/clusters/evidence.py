"""The likelihood of the forces on a few nodes, and patches of pressure that are fitted to it.

The posterior of the last full step gives the forces f of some nodes a mean m and a covariance C, with all
other unknowns marginalised. It contains the prior of the normal forces, with mean 0 and precision B (their
weights), which favours forces on few nodes. The likelihood without the prior is

    -2 log p(markers | f) = f^T L f - 2 h^T f + const,      L = C^-1 - B,      h = C^-1 m

(C. E. Rasmussen and C. K. I. Williams 2006, chapter 2: a Gaussian divided by a Gaussian). A patch of pressure
that is fitted to this likelihood is not attracted by nodes, so that its centre is an unbiased one.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.mechanics.clusters.fitted_patches import PairFit, PatchFit
from manytouch.estimation.mechanics.clusters.patch_fits import Whitened, fit_patches
from manytouch.estimation.mechanics.clusters.patch_kernels import NodeGrid, add_patches, node_grid
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.geometry.spline.patch import Nodal, SplinePatch
from manytouch.mechanics.solver.posterior import Posterior
from manytouch.values import Status
from manytouch.values.arrays import Points2, Scalars

_MIN_NODES = 9
_MAX_STEPS = 30
LENGTH_MM = 1e-3
"""Step of finite differences."""
_START_MM2 = 0.3
"""Added to the spread of nodal forces, from which the fit of a patch starts, so that it has a size where one
node carries all force. A choice, without a recorded comparison of values: the root is a seventh of a pitch of
4 mm, which most sheets of the accuracy suite have. It does not follow the pitch."""
MIN_MEAN_MISFIT = 0.1
"""Lower limit of the misfit per degree of freedom."""
_LEAST_CURVATURE = 1e-8
"""Directions of parameters with less curvature than this share of the largest get no variance."""
_LEAST_INFORMATION = 1e-6
"""Combinations with less information than this share of that of the best one are dropped."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Combinations:
    """Independent combinations of the forces of n nodes, of which the markers give q.

    Attributes:
        white: (q, n) the combinations, each divided by its standard deviation.
        white_of_mean: (q, n) derivatives of their most likely values by the posterior means of the normal
            forces.
        node: (n,) numbers of the nodes.
        grid: the splines of these nodes, for compiled functions.
    """

    white: Float64[np.ndarray, "q n"]
    white_of_mean: Float64[np.ndarray, "q n"]
    node: Int64[np.ndarray, " n"]
    grid: NodeGrid


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Evidence:
    """The likelihood of the forces of n nodes: q independent combinations with unit variance.

    Attributes:
        combinations: of the forces.
        aim: (q,) their most likely values.
        patch: of the sheet.
    """

    combinations: Combinations
    aim: Float64[np.ndarray, " q"]
    patch: SplinePatch

    def fit_one(
        self,
        force_mm2: float,
        centre_mm: Float64[np.ndarray, "2"],
        spread_mm2: Float64[np.ndarray, "2 2"],
    ) -> PatchFit:
        """The patch of any force, centre, size and shape that fits best, from a guess.

        It is a point where that fits better than what the search for a size and a shape ends with.
        """
        root = np.linalg.cholesky(spread_mm2 + _START_MM2 * np.eye(2))
        theta = np.array([force_mm2, *centre_mm, root[0, 0], root[1, 0], root[1, 1]])
        step = np.array([1e-3 * force_mm2] + 5 * [LENGTH_MM])
        misfit, curvature = self.fit(theta, step.tolist())
        point = np.array([force_mm2, *centre_mm, 0.0, 0.0, 0.0])
        point_misfit, point_curvature = self.fit(point, [*step[:3].tolist(), 0.0, 0.0, 0.0])
        parameters = len(theta)
        if point_misfit < misfit:
            theta, misfit, curvature, parameters = point, point_misfit, point_curvature, 3
        per_combination = self.mean_misfit(misfit, parameters)
        xx, yx, yy = theta[3:]
        by_root = np.array([[2.0 * xx, 0.0, 0.0], [yx, xx, 0.0], [0.0, 2.0 * yx, 2.0 * yy]])
        change = np.eye(6)
        change[3:, 3:] = by_root
        inverse = inverse_of(curvature)
        return PatchFit(
            misfit=misfit,
            force_mm2=float(theta[0]),
            centre_mm=theta[1:3],
            spread_mm2=np.array([[xx * xx, xx * yx], [xx * yx, yx * yx + yy * yy]]),
            covariance=per_combination * change @ inverse @ change.T,
            nodal_mm2=self.nodal(theta),
            outline_mm=np.zeros((0, 2)),
        )

    def fit_two(
        self, force_mm2: Float64[np.ndarray, "2"], centre_mm: Points2, deviation_mm: float
    ) -> PairFit:
        """The two round patches of one size that fit best, from a guess."""
        theta = np.array([force_mm2[0], *centre_mm[0], force_mm2[1], *centre_mm[1], deviation_mm])
        patch = [1e-3 * float(force_mm2.sum()), LENGTH_MM, LENGTH_MM]
        step = np.array([*patch, *patch, LENGTH_MM])
        misfit, curvature = self.fit(theta, step.tolist())
        per_combination = self.mean_misfit(misfit, len(theta))
        inverse = inverse_of(curvature)
        own = np.array([[0, 1, 2], [3, 4, 5]])
        return PairFit(
            misfit=misfit,
            force_mm2=theta[[0, 3]],
            centre_mm=np.array([theta[1:3], theta[4:6]]),
            deviation_mm=abs(float(theta[6])),
            covariance=per_combination * inverse[own[:, :, None], own[:, None, :]],
            nodal_mm2=self.nodal(theta),
        )

    def shape_probability(self, one: PatchFit, *, min_ring_mm: float) -> Float64[np.ndarray, "4"]:
        """Probabilities of the shapes, in the order of `ContactShape`.

        With the misfits X, in units of the mean misfit of the best ellipse, and the numbers k of parameters,
        they are proportional to exp(-(X + k log q) / 2) for q combinations (G. Schwarz 1978,
        doi:10.1214/aos/1176344136). A patch may be round or elliptic. Lines and rings are fitted only where
        an ellipse explains the markers better than a point.

        Args:
            one: the best ellipse.
            min_ring_mm: least radius of a ring; the hole of a smaller one cannot be distinguished.
        """
        head = [one.force_mm2, *one.centre_mm]
        step = [1e-3 * one.force_mm2, LENGTH_MM, LENGTH_MM]
        rows = max(len(self.aim), 2)
        scale = self.mean_misfit(one.misfit, 6)
        point, _ = self.fit(np.array([*head, 0.0, 0.0, 0.0]), [*step, 0.0, 0.0, 0.0])
        score = np.full((4, 2), np.inf)
        score[0, 0] = point / scale + 3.0 * np.log(rows)
        score[2, 0] = one.misfit / scale + 6.0 * np.log(rows)
        if point - one.misfit > scale * np.log(rows):
            size, axes = np.linalg.eigh(one.spread_mm2 + _START_MM2 * np.eye(2))
            mean_mm = float(np.sqrt(0.5 * size.sum()))
            along = axes[:, 1] * np.sqrt(size[1])
            line, _ = self.fit(np.array([*head, *along, 0.0]), [*step, LENGTH_MM, LENGTH_MM, 0.0])
            both = np.array([*head, 0.0, *one.centre_mm, mean_mm])
            round_, _ = self.fit(both, [*step, 0.0, 0.0, 0.0, LENGTH_MM])
            ring = np.array([*head, np.sqrt(2.0) * mean_mm])
            ring_misfit, _ = self.fit(ring, [*step, LENGTH_MM])
            score[1, 0] = line / scale + 5.0 * np.log(rows)
            score[2, 1] = round_ / scale + 4.0 * np.log(rows)
            if abs(ring[3]) >= min_ring_mm:
                score[3, 0] = ring_misfit / scale + 4.0 * np.log(rows)
        weight = np.exp(-0.5 * (score - score.min())).sum(axis=1)
        return np.asarray(weight / weight.sum())

    def misfit(self, nodal_mm2: Float64[np.ndarray, " n"]) -> float:
        """The misfit of forces (n,) on the nodes, over E, positive in compression."""
        off = self.aim - self.combinations.white @ nodal_mm2
        return float(off @ off)

    def mean_misfit(self, misfit: float, parameters: int, least: float = MIN_MEAN_MISFIT) -> float:
        """A misfit per degree of freedom of a fit with this number of parameters, at least `least`."""
        return max(misfit / max(len(self.aim) - parameters, 1), least)

    def nodal(self, theta: Scalars) -> Float64[np.ndarray, " nodes"]:
        """(n,) forces of fitted patches on the nodes, over E; `theta` as in `patch_kernels`."""
        nodal = np.zeros(len(self.combinations.node))
        add_patches(theta, self.combinations.grid, nodal)
        return nodal

    def fit(self, theta: Scalars, step: list[float]) -> tuple[float, Float64[np.ndarray, "p p"]]:
        """Least misfit and its curvature; `theta` is changed in place."""
        likelihood = Whitened(self.combinations.white, self.aim)
        misfit, curvature = fit_patches(theta, np.array(step), self.combinations.grid, likelihood, _MAX_STEPS)
        return float(misfit), curvature


def inverse_of(curvature: np.ndarray) -> np.ndarray:
    """Inverse of a curvature (p, p); parameters that do not change the misfit get no variance."""
    scale = np.sqrt(np.diag(curvature))
    scale = np.where(scale > 0.0, 1.0 / np.where(scale > 0.0, scale, 1.0), 0.0)
    size, axes = np.linalg.eigh(curvature * scale[:, None] * scale)
    part = axes[:, size > _LEAST_CURVATURE * size[-1]]
    white = scale[:, None] * part / np.sqrt(size[size > _LEAST_CURVATURE * size[-1]])
    return np.asarray(white @ white.T)


EvidenceAt = Callable[[Int64[np.ndarray, " n"]], Evidence | None]
"""The likelihood of the forces of some nodes; None if the markers do not determine them."""


class ForcePosterior:
    """The posterior of the normal forces of nodes in one frame.

    Attributes:
        model: of the sheet.
        fit: of the frame.
    """

    def __init__(self, model: InversionModel, fit: Fit) -> None:
        self.model = model
        self.fit = fit

    def evidence(self, node: Int64[np.ndarray, " n"]) -> Evidence | None:
        """The likelihood of the normal forces of some nodes; None if there are too few or the fit has failed.

        Args:
            node: (n,) numbers of the nodes; fixed ones and those without contacts are left out.
        """
        node = node[self.model.patch.is_free[node, 2]]
        if len(node) < _MIN_NODES or self.fit.status is not Status.OK:
            return None
        combinations = self.fit.posterior.workspace.kept(
            "combinations", node, lambda: _combinations(self.model, self.fit.posterior, node)
        )
        return Evidence(
            combinations=combinations,
            aim=-combinations.white_of_mean @ self.fit.shape.force_mm2[node, 2],
            patch=self.model.patch,
        )

    def unbiased_shape(self, fitted_mm2: Float64[np.ndarray, " nodes"]) -> SheetShape:
        """The shape of the sheet with the forces of fitted patches, which the sparse prior does not reduce.

        Its marker images are those of the fit.

        Args:
            fitted_mm2: see `Clusters`.
        """
        shape = self.fit.shape
        if not np.isfinite(fitted_mm2).any():
            return shape
        return shape.changed(self.model, self.conditional_change(fitted_mm2))

    def conditional_change(self, press_mm2: Float64[np.ndarray, " nodes"]) -> Nodal:
        """Change of the coefficients (nodes, 3) to their mean if the normal forces of some nodes are known.

        The mean of a Gaussian on condition of some linear functions f of it is m + C_cf C_ff^-1 (f - m_f).

        Args:
            press_mm2: (nodes,) normal forces over E, positive in compression; NaN where not known.
        """
        node = np.flatnonzero(np.isfinite(press_mm2))
        posterior = self.fit.posterior
        off_mm2 = -press_mm2[node] - self.fit.shape.force_mm2[node, 2]
        return posterior.change_by_forces(node, np.linalg.solve(_covariance(posterior, node), off_mm2))


def _covariance(posterior: Posterior, node: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n n"]:
    """Covariance of the normal forces over E at free nodes, computed once from each posterior, mm^4."""
    return posterior.workspace.kept("covariance", node, lambda: posterior.force_covariance(node))


def _combinations(model: InversionModel, posterior: Posterior, node: Int64[np.ndarray, " n"]) -> Combinations:
    """The eigenvectors of the likelihood matrix L of some nodes that the markers determine."""
    inverse = np.linalg.inv(_covariance(posterior, node))
    likelihood = inverse - np.diag(posterior.weight[node, 2])
    size, axes = np.linalg.eigh(0.5 * (likelihood + likelihood.T))
    is_used = size > _LEAST_INFORMATION * size[-1]
    root = np.sqrt(size[is_used])
    axes = axes[:, is_used]
    return Combinations(
        white=np.ascontiguousarray(root[:, None] * axes.T),
        white_of_mean=axes.T @ inverse / root[:, None],
        node=node,
        grid=node_grid(model.patch, _local(model, node)),
    )


def _local(model: InversionModel, node: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, "nx ny"]:
    """(nx, ny) number of each node of the sheet, dropped ones included, among some nodes; or -1."""
    patch = model.patch
    of_node = np.full(patch.node_count, -1, dtype=np.int64)
    of_node[node] = np.arange(len(node))
    slow, fast, dropped = *patch.shape, patch.dropped
    grid = np.full((slow + 2 * dropped, fast + 2 * dropped), -1, dtype=np.int64)
    grid[dropped : dropped + slow, dropped : dropped + fast] = of_node.reshape(slow, fast)
    return grid if patch.is_x_slow else np.ascontiguousarray(grid.T)
