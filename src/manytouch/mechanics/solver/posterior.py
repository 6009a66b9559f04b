"""The Gaussian posterior of the sheet's coefficients: Gauss-Newton step, covariances and samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar, cast

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.banded.band import BandFactor
from manytouch.mechanics.shell import tangent_kernels
from manytouch.mechanics.solver.linearisation import Linearisation
from manytouch.mechanics.solver.reweighting import ReweightedFactor, reweighted_factor
from manytouch.values.arrays import read_only

T = TypeVar("T")

_MAX_KEPT = 64
_MIN_ROWS = 64
_LEAST_STRETCH = 0.01


class WhiteRows:
    """Rows of d(T f) / dc times L^-T of one factor, each computed when it is first needed."""

    def __init__(self, linearisation: Linearisation, factor: BandFactor) -> None:
        self._linearisation, self._factor = linearisation, factor
        unknowns = linearisation.force.size
        self._row_of = np.full(unknowns, -1, dtype=np.int64)
        self._rows = np.zeros((0, unknowns))
        self._count = 0

    def __call__(self, number: Int64[np.ndarray, " k"], first: int = 0) -> Float64[np.ndarray, "k n"]:
        """The rows of components of T f, 3 times the node plus the axis, from an unknown on."""
        new = number[self._row_of[number] < 0]
        if len(new) > 0:
            patch = self._linearisation.shell.patch
            rows = self._linearisation.balance_rows(new // 3, new % 3) * patch.is_free
            white = self._factor.whiten_many(rows.reshape(len(new), -1))
            end = self._count + len(new)
            if end > len(self._rows):
                room = np.zeros((max(2 * len(self._rows), end, _MIN_ROWS), white.shape[1]))
                room[: self._count] = self._rows[: self._count]
                self._rows = room
            self._rows[self._count : end] = white
            self._row_of[new] = np.arange(self._count, end)
            self._count = end
        row = self._row_of[number]
        if len(row) > 0 and (np.diff(row) == 1).all():
            return self._rows[row[0] : row[-1] + 1, first:]
        return np.asarray(self._rows[row, first:])

    def first(self, number: Int64[np.ndarray, " k"]) -> int:
        """An unknown before which all of these rows are 0."""
        columns = self._linearisation.shell.patch.shape[1]
        node = int(number.min(initial=self._row_of.size)) // 3
        return 3 * max(node - tangent_kernels.REACH * (columns + 1), 0)


class PosteriorCache:
    """What was computed from one posterior and is needed again; it only saves time."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, bytes], Any] = {}

    def kept(self, name: str, of: np.ndarray, compute: Callable[[], T]) -> T:
        """A result for an array, as numbers of nodes: that of an earlier call with both, if there was one."""
        key = (name, of.tobytes())
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
        weighed_mm2: (nodes, 3) nodal forces over E for which these weights were chosen.
        information: (m, 2, 2) W, per px^2.
        damping: what was added to the diagonal of H, over its largest entry; 0 unless H was singular.
        rows: of the factor of the last full step.
        workspace: of results that are needed again.
        full: that of the last full step, from whose factor this one's is computed; None if it is that one.
        reweightings: number of changes of the weights since then.
    """

    linearisation: Linearisation
    change_mm: Nodal
    factor: BandFactor | ReweightedFactor
    weight: Nodal
    weighed_mm2: Nodal
    information: Float64[np.ndarray, "m 2 2"]
    damping: float
    rows: WhiteRows
    workspace: PosteriorCache
    full: "Posterior | None" = None
    reweightings: int = 0

    def force_covariance(self, node: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "k k"]:
        """Covariance of the normal forces over E at free nodes, mm^4."""
        first = self.rows.first(3 * node)
        white = self.rows(3 * node + 2, first)
        if isinstance(self.factor, ReweightedFactor):
            return self.factor.products(white, first)
        return np.asarray(white @ white.T)

    def change_by_forces(
        self, node: Int64[np.ndarray, " k"], pull: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, "nodes 3"]:
        """Covariance of the coefficients with the normal forces at free nodes, times `pull`."""
        first = self.rows.first(3 * node)
        white = np.zeros((1, self.weight.size))
        white[0, first:] = pull @ self.rows(3 * node + 2, first)
        if isinstance(self.factor, ReweightedFactor):
            white = self.factor.turned(white)
        change = self.factor.colour(white)[0].reshape(-1, 3)
        return np.asarray(change * self.linearisation.shell.patch.is_free)

    def reweighted(
        self,
        weight: Nodal,
        weighed_mm2: Nodal,
        *,
        residual_px: Float64[np.ndarray, "m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        balance: Nodal,
        min_ratio: float,
        max_kept_ratio: float,
        max_rows: int,
    ) -> "Posterior | None":
        """The posterior with other weights, and the step with it, without a new factor of the whole matrix.

        Weights keep their values where they changed little since the last full step.

        Args:
            weight: (nodes, 3) of the balance, per mm^4.
            weighed_mm2: (nodes, 3) forces for which they were chosen.
            residual_px: (m, 2) predicted minus measured marker images.
            information_per_px2: (m, 2, 2) of this frame, for the step.
            balance: (nodes, 3) T f.
            min_ratio: weights that changed by a smaller factor are kept.
            max_kept_ratio: None is returned if one that changed by a larger factor would be kept; also if
                rounding would matter.
            max_rows: number of weights that are changed, those that changed most.
        """
        full = self if self.full is None else self.full
        assert isinstance(full.factor, BandFactor)
        ratio = np.where(self.linearisation.shell.patch.is_free, weight / full.weight, 1.0).ravel()
        ratio = np.maximum(ratio, 1.0 / ratio)
        order = np.argsort(-ratio, kind="stable")
        number, kept = order[:max_rows], order[max_rows:]
        if (ratio[kept] > max_kept_ratio).any():
            return None
        number = number[ratio[number] > min_ratio]
        mixed = full.weight.copy()
        np.put(mixed, number, weight.ravel()[number])
        factor: BandFactor | ReweightedFactor | None = full.factor
        if len(number) > 0:
            change = weight.ravel()[number] - full.weight.ravel()[number]
            factor = reweighted_factor(full.factor, self.rows(number), change, least=_LEAST_STRETCH)
        if factor is None:
            return None
        gradient = self.linearisation.gradient(residual_px, information_per_px2, mixed * balance)
        return replace(
            self,
            change_mm=-factor.solve(gradient.reshape(1, -1))[0].reshape(-1, 3),
            factor=factor,
            weight=mixed,
            weighed_mm2=weighed_mm2,
            workspace=PosteriorCache(),
            full=full,
            reweightings=self.reweightings + 1,
        )

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
        if len(share) == 0:
            return np.zeros(0)
        name = f"deviation of the forces along axis {component}"
        return self.workspace.kept(name, share, lambda: self._force_std(share, component))

    def _force_std(self, share: Float64[np.ndarray, "k nodes"], component: int) -> Float64[np.ndarray, " k"]:
        rows = self.linearisation.force_rows(share, np.full(len(share), component))
        return read_only(np.linalg.norm(self.factor.whiten(rows.reshape(len(share), -1)), axis=1))

    def solve(self, right: Float64[np.ndarray, "k nodes 3"]) -> Float64[np.ndarray, "k nodes 3"]:
        """H^-1 times each right-hand side."""
        return self.factor.solve(right.reshape(len(right), -1)).reshape(right.shape)

    def colour(self, white: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k nodes 3"]:
        """Changes of the coefficients (mm): with covariance H^-1, from rows of independent normal numbers.

        H^-1 times right-hand sides, from these after `whiten`.
        """
        is_free = self.linearisation.shell.patch.is_free
        return np.asarray(self.factor.colour(white).reshape(len(white), *is_free.shape) * is_free)

    def whiten(self, rows: Float64[np.ndarray, "k nodes 3"]) -> Float64[np.ndarray, "k n"]:
        """Scalar products of the results are covariances of linear functions rows . c of the coefficients."""
        free = rows * self.linearisation.shell.patch.is_free
        return self.factor.whiten(free.reshape(len(rows), -1))

    def variances(
        self, node: Int64[np.ndarray, "k 16"], row: Float64[np.ndarray, "k 16 3"]
    ) -> Float64[np.ndarray, " k"]:
        """Variances of k linear functions of the coefficients of 16 nodes each."""
        patch = self.linearisation.shell.patch
        dense = np.zeros((len(node), patch.node_count, 3))
        np.put_along_axis(dense, node[:, :, None], row * patch.is_free[node], axis=1)
        white = self.factor.whiten(dense.reshape(len(node), -1))
        return np.asarray((white**2).sum(axis=1))
