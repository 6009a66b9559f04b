"""The Gaussian posterior of the sheet's coefficients: Gauss-Newton step, covariances and samples."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.banded.band import BandFactor
from manytouch.mechanics.solver.linearisation import Linearisation

T = TypeVar("T")

_MAX_KEPT = 64


class Workspace:
    """What was computed from one posterior and is needed again; it only saves time."""

    def __init__(self) -> None:
        self._row_of = np.zeros(0, dtype=np.int64)
        self._white = np.zeros((0, 0))
        self._kept: dict[tuple[str, bytes], Any] = {}

    def forces(self, posterior: "Posterior", node: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "k n"]:
        """`Posterior.whitened_forces`."""
        linearisation = posterior.linearisation
        if len(self._row_of) == 0:
            nodes = linearisation.shell.patch.node_count
            self._row_of, self._white = np.full(nodes, -1, dtype=np.int64), np.zeros((0, 3 * nodes))
        new = node[self._row_of[node] < 0]
        if len(new) > 0:
            rows = linearisation.force_rows(new, 2) * linearisation.shell.patch.is_free
            white = posterior.factor.whiten_many(rows.reshape(len(new), -1))
            self._row_of[new] = len(self._white) + np.arange(len(new))
            self._white = np.concatenate([self._white, white])
        return np.asarray(self._white[self._row_of[node]])

    def kept(self, name: str, node: Int64[np.ndarray, " k"], compute: Callable[[], T]) -> T:
        """A result for some nodes: that of an earlier call with the same name and nodes, if there was one."""
        key = (name, node.tobytes())
        if key not in self._kept:
            if len(self._kept) >= _MAX_KEPT:
                self._kept.clear()
            self._kept[key] = compute()
        return cast(T, self._kept[key])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Posterior:
    """Solution of the normal equations at a linearisation.

    H is the normal matrix, half the Hessian of sum r^T W r + sum weight (T f)^2; its inverse is the
    covariance of the coefficients. The value owns its arrays and stays valid whatever is computed later.

    Attributes:
        linearisation: the derivatives that H consists of.
        change_mm: (nodes, 3) change of the coefficients that minimises the linearised objective.
        factor: of H.
        weight: (nodes, 3) of the balance T f, per mm^4.
        information: (m, 2, 2) W, per px^2.
        damping: what was added to the diagonal of H, over its largest entry; 0 unless H was singular.
        workspace: of results that are needed again.
    """

    linearisation: Linearisation
    change_mm: Nodal
    factor: BandFactor
    weight: Nodal
    information: Float64[np.ndarray, "m 2 2"]
    damping: float
    workspace: Workspace

    def whitened_forces(self, node: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "k n"]:
        """Derivatives of the normal forces at nodes by the coefficients, times L^-T of H = L L^T."""
        return self.workspace.forces(self, node)

    def chord_step(
        self,
        residual_px: Float64[np.ndarray, "m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        balance: Nodal,
    ) -> Nodal:
        """A step from other coefficients with the derivatives, weights and factor of this posterior (mm).

        It takes a fifth of the time of a full step.

        Args:
            residual_px: (m, 2) predicted minus measured marker images at these coefficients.
            information_per_px2: (m, 2, 2) of this frame.
            balance: (nodes, 3) T f at these coefficients.
        """
        gradient = self.linearisation.gradient(residual_px, information_per_px2, self.weight * balance)
        change: Nodal = -self.factor.solve(gradient.reshape(1, -1))[0].reshape(-1, 3)
        return change

    def force_std(self, share: Float64[np.ndarray, "k nodes"], component: int) -> Float64[np.ndarray, " k"]:
        """Standard deviations of k sums sum_j share_kj f_j,component over E, mm^2."""
        rows = [self.linearisation.force_row(each, component).ravel() for each in share]
        if not rows:
            return np.zeros(0)
        return np.asarray(np.sqrt((self.factor.whiten(np.stack(rows)) ** 2).sum(axis=1)))

    def solve(self, right: Float64[np.ndarray, "k nodes 3"]) -> Float64[np.ndarray, "k nodes 3"]:
        """H^-1 times each right-hand side."""
        return self.factor.solve(right.reshape(len(right), -1)).reshape(right.shape)

    def sample_changes(self, normal: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k nodes 3"]:
        """Changes of the coefficients (mm) with covariance H^-1, from rows of independent normal numbers."""
        is_free = self.linearisation.shell.patch.is_free
        return np.asarray(self.factor.colour(normal).reshape(len(normal), *is_free.shape) * is_free)

    def covariances(self, rows: Float64[np.ndarray, "g k nodes 3"]) -> Float64[np.ndarray, "g k k"]:
        """Covariances of k linear functions rows . c of the coefficients c, for each of g groups."""
        groups, count = rows.shape[:2]
        free = (rows * self.linearisation.shell.patch.is_free).reshape(groups * count, -1)
        white = self.factor.whiten(free).reshape(groups, count, -1)
        return np.asarray(white @ white.transpose(0, 2, 1))

    def variances(
        self, node: Int64[np.ndarray, "k 16"], row: Float64[np.ndarray, "k 16 3"]
    ) -> Float64[np.ndarray, " k"]:
        """Variances of k linear functions of the coefficients of 16 nodes each."""
        patch = self.linearisation.shell.patch
        dense = np.zeros((len(node), patch.node_count, 3))
        np.put_along_axis(dense, node[:, :, None], row * patch.is_free[node], axis=1)
        white = self.factor.whiten(dense.reshape(len(node), -1))
        return np.asarray((white**2).sum(axis=1))
