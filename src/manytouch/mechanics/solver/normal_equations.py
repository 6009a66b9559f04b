"""One Gauss-Newton step from the dots in the image to the shape of the sheet and the forces on it."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Float64, Int64

from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers.images import Dots
from manytouch.mechanics.shell import kernels as shell_kernels
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.solver import band_kernels
from manytouch.mechanics.solver.band import BandFactor, empty_band, factorised

LEAST_DAMPING = 1e-7  # of the largest diagonal entry, when the matrix cannot be factorised without


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Linearisation:
    """The sheet at some coefficients.

    Attributes:
        displacement_px: (m, 2) of the dots' images from rest.
        force: (nodes, 3) over E, mm^2; a press has force z < 0.
        balance: (nodes, 3) the same along the deformed sheet: f_u + w,x f_w, f_v + w,y f_w, and f_w.
    """

    displacement_px: Float64[np.ndarray, "m 2"]
    force: Nodal
    balance: Nodal


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Curvature:
    """The normal matrix of a step, and the linearisation it was made of: good for all that is near.

    Attributes:
        factor: of the matrix; None before there is one.
        tangent, force, slope, derivative: of the sheet and its dots there.
        weight: (n, 3) of the balance.
        information: (m, 2, 2) of the dots.
    """

    factor: BandFactor | None
    tangent: Float[np.ndarray, "nodes 3 3 7 8"]
    force: Nodal
    slope: Float64[np.ndarray, "nodes 2"]
    derivative: Float64[np.ndarray, "m 2 16 3"]
    weight: Nodal
    information: Float64[np.ndarray, "m 2 2"]


@dataclass(eq=False, kw_only=True)
class NormalEquations:
    """The normal equations of the dots' residuals and the weighted forces, with room to build them in.

    Minimised is sum r^T W r + sum weight (T f)^2 (docs/derivations/mechanics.md, "Step"). The object
    keeps its buffers from one step to the next; what it returns depends on the arguments only. `step`
    uses the last `linearise`; `chord_step` and the read-outs of H use the last `step`, or what was recalled.

    Attributes:
        shell: the sheet.
        dots: what is seen of it.
        precision: of matrices; forces, pixels and steps are float64 whatever it is. When not given, single
            for a clamped patch, where a step is right to 1e-4, and double for a soft one, whose outside is
            hardly determined.
        damping: what had to be added to the diagonal of the last H, over its largest entry.
    """

    shell: Shell
    dots: Dots
    precision: type[np.floating] | None = None
    damping: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        patch = self.shell.patch
        fast = patch.shape[1]
        if self.precision is None:
            self.precision = np.float32 if patch.boundary == "clamped" else np.float64
        reach = 2 * shell_kernels.REACH
        self._width = 3 * reach * (fast + 1) + 2
        self._flat, self._front = empty_band(3 * patch.node_count, self._width, self.precision)
        self._tangent = self.shell.empty_tangent(self.precision)
        self._force = np.zeros((patch.node_count, 3))
        self._slope = np.zeros((patch.node_count, 2))
        self._derivative = np.zeros((len(self.dots.rest_mm), 2, 16, 3))
        self._at_nodes = patch.at(patch.place_mm)
        self._first, _ = patch.window(patch.place_mm)
        self._table_x, self._table_y = (
            np.ascontiguousarray(table.reshape(-1, 4, 4))
            * patch.is_free[self._at_nodes.node, 2].reshape(-1, 4, 4)
            for table in (self._at_nodes.dx, self._at_nodes.dy)
        )
        self._held = np.flatnonzero(~patch.is_free.ravel())
        self._near: Curvature | None = None

    def linearise(self, coefficient_mm: Nodal) -> Linearisation:
        """Work out forces, tangent and dots at these coefficients."""
        self.shell.forces_and_tangent(coefficient_mm, self._force, self._tangent)
        self._derivative = self.dots.derivative_px(coefficient_mm)
        self._derivative *= self.shell.patch.is_free[self.dots.tips.basis.node][:, None]
        w = coefficient_mm[self._at_nodes.node, 2]
        self._slope[:, 0] = (self._at_nodes.dx * w).sum(axis=1)
        self._slope[:, 1] = (self._at_nodes.dy * w).sum(axis=1)
        self._near = Curvature(
            factor=None,
            tangent=self._tangent,
            force=self._force,
            slope=self._slope,
            derivative=self._derivative,
            weight=np.zeros_like(self._force),
            information=np.zeros((len(self._derivative), 2, 2)),
        )
        force = self._force.copy()
        balance = force.copy()
        balance[:, :2] += self._slope * force[:, 2:]
        balance[~self.shell.patch.is_free] = 0.0
        return Linearisation(
            displacement_px=self.dots.displacement_px(coefficient_mm), force=force, balance=balance
        )

    def step(
        self,
        residual_px: Float64[np.ndarray, "m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        force_weight_per_mm4: Nodal,
    ) -> Nodal:
        """The change of the coefficients (mm) that minimises the linearised objective.

        Args:
            residual_px: predicted minus measured displacement of each dot.
            information_per_px2: W, inverse covariance times robust weight; 0 for a dot that is not seen.
            force_weight_per_mm4: of the balance's tangential x and y and of the normal forces.
        """
        residual = np.where(information_per_px2[:, [0, 1], [0, 1]] == 0.0, 0.0, residual_px)
        damping = 0.0
        while True:
            gradient = self._assemble(residual, information_per_px2, force_weight_per_mm4, damping)
            factor = factorised(self._flat, front=self._front, unknowns=gradient.size, width=self._width)
            if factor is not None:
                break
            damping = max(LEAST_DAMPING, 10.0 * damping)
        self.damping = damping
        self._near = replace(
            self._linear, factor=factor, weight=force_weight_per_mm4, information=information_per_px2
        )
        change: Nodal = -factor.solve(gradient[None])[0].reshape(-1, 3)
        return change

    def kept(self) -> Curvature:
        """The curvature of the last `step`, to be recalled later: nothing worked out later changes it."""
        near = self._linear
        return replace(
            near,
            factor=BandFactor(lower=self._last.lower.copy()),
            tangent=near.tangent.copy(),
            force=near.force.copy(),
            slope=near.slope.copy(),
        )

    def recall(self, near: Curvature) -> None:
        """Go back to the curvature of an earlier step, for `chord_step` and read-outs."""
        self._near = near

    def chord_step(
        self,
        residual_px: Float64[np.ndarray, "m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        balance: Nodal,
    ) -> Nodal:
        """A step with the curvature, derivatives and weights of an earlier place: a fifth of the work.

        Args:
            residual_px, information_per_px2: as for `step`.
            balance: forces along the bent sheet, where the step begins.
        """
        near, patch, at_nodes = self._linear, self.shell.patch, self._at_nodes
        is_blind = information_per_px2[:, [0, 1], [0, 1]] == 0.0
        pull = np.einsum("mij,mj->mi", information_per_px2, np.where(is_blind, 0.0, residual_px))
        spread = np.einsum("mi,mika->mka", pull, near.derivative)
        weighted = np.where(patch.is_free, near.weight * balance, 0.0)
        across = weighted.copy()
        across[:, 2] += (near.slope * weighted[:, :2]).sum(axis=1)
        gradient = self.shell.product(near.tangent, across)
        tilt = near.force[:, 2:] * weighted[:, :2]
        tilted = tilt[:, :1] * at_nodes.dx + tilt[:, 1:] * at_nodes.dy
        count, node = patch.node_count, self.dots.tips.basis.node.ravel()
        gradient[:, 2] += np.bincount(at_nodes.node.ravel(), tilted.ravel(), minlength=count)
        for axis in range(3):
            gradient[:, axis] += np.bincount(node, spread[:, :, axis].ravel(), minlength=count)
        gradient[~patch.is_free] = 0.0
        change: Nodal = -self._last.solve(gradient.reshape(1, -1))[0].reshape(-1, 3)
        return change

    def force_change(self, change_mm: Nodal) -> Nodal:
        """K times a change of the coefficients: the change of the forces over E, mm^2."""
        return self.shell.product(self._linear.tangent, change_mm)

    def balance_change(self, change_mm: Nodal) -> Nodal:
        """Change of the balance T f, to first order."""
        change = self.force_change(change_mm)
        w = change_mm[self._at_nodes.node, 2]
        slope, force_z = self._linear.slope, self._linear.force[:, 2]
        change[:, 0] += slope[:, 0] * change[:, 2] + force_z * (self._at_nodes.dx * w).sum(axis=1)
        change[:, 1] += slope[:, 1] * change[:, 2] + force_z * (self._at_nodes.dy * w).sum(axis=1)
        change[~self.shell.patch.is_free] = 0.0
        return change

    def force_row(self, share: Float64[np.ndarray, " nodes"], component: int) -> Nodal:
        """Derivative of sum_j share_j f_j,component with respect to the coefficients."""
        patch, row = self.shell.patch, np.zeros((len(share), 3))
        held = np.where(patch.is_free[:, component], share, 0.0)
        shell_kernels.row_sum(self._linear.tangent, patch.shape, held, component, row)
        return row

    def force_std(self, share: Float64[np.ndarray, "k nodes"], component: int) -> Float64[np.ndarray, " k"]:
        """Standard deviations of k sums sum_j share_kj f_j,component."""
        rows = [self.force_row(each, component).ravel() for each in share]
        if not rows:
            return np.zeros(0)
        return np.asarray(np.sqrt((self._last.whitened(np.stack(rows)) ** 2).sum(axis=1)))

    def force_rows(self, node: Int64[np.ndarray, " k"], component: int) -> Float64[np.ndarray, "k nodes 3"]:
        """Derivatives of one component of the forces on some nodes, free ones, by the coefficients."""
        patch = self.shell.patch
        rows, share = np.zeros((len(node), patch.node_count, 3)), np.zeros(patch.node_count)
        for row, number in zip(rows, node, strict=True):
            share[number] = 1.0
            shell_kernels.row_sum(self._tangent, patch.shape, share, component, row)
            share[number] = 0.0
        return rows

    def solve(self, right: Float64[np.ndarray, "k nodes 3"]) -> Float64[np.ndarray, "k nodes 3"]:
        """H^-1 times each right-hand side."""
        return self._last.solve(right.reshape(len(right), -1)).reshape(right.shape)

    def drawn(self, normal: Float64[np.ndarray, "k n"]) -> Float64[np.ndarray, "k nodes 3"]:
        """Changes of the coefficients with the covariance H^-1, from rows of independent normal numbers."""
        free = self.shell.patch.is_free
        return np.asarray(self._last.drawn(normal).reshape(len(normal), *free.shape) * free)

    def covariance(self, rows: Float64[np.ndarray, "k nodes 3"]) -> Float64[np.ndarray, "k k"]:
        """Covariance of linear read-outs rows . c."""
        white = self._last.whitened((rows * self.shell.patch.is_free).reshape(len(rows), -1))
        return np.asarray(white @ white.T)

    def variances(
        self, node: Int64[np.ndarray, "k 16"], row: Float64[np.ndarray, "k 16 3"]
    ) -> Float64[np.ndarray, " k"]:
        """Variances of many read-outs that touch 16 nodes each."""
        dense = np.zeros((len(node), self.shell.patch.node_count, 3))
        np.put_along_axis(dense, node[:, :, None], row * self.shell.patch.is_free[node], axis=1)
        white = self._last.whitened(dense.reshape(len(node), -1))
        return np.asarray((white**2).sum(axis=1))

    @property
    def _linear(self) -> Curvature:
        if self._near is None:
            raise ValueError("the normal equations have no derivatives yet: call `linearise` first")
        return self._near

    @property
    def _last(self) -> BandFactor:
        if self._near is None or self._near.factor is None:
            raise ValueError("the normal equations have no matrix yet: call `step` first")
        return self._near.factor

    @property
    def _matrix(self) -> Float[np.ndarray, "n band"]:
        return self._flat[self._front : -self._front].reshape(-1, self._width + 1)

    def _assemble(
        self, residual: np.ndarray, information: np.ndarray, weight: Nodal, damping: float
    ) -> Float64[np.ndarray, " n"]:
        """H into the buffer; returns the gradient."""
        patch = self.shell.patch
        self._flat[:] = 0.0
        gradient = np.zeros(3 * patch.node_count)
        information = information.astype(self.precision)
        place = (patch.shape, self._front, self._width, self._flat, gradient)
        band_kernels.add_forces(
            self._tangent, self._force, self._slope, self._first, self._table_x, self._table_y, weight,
            patch.shape, patch.is_free, *place[1:],
        )  # fmt: skip
        derivative = self._derivative.reshape(-1, 2, 4, 12).astype(self.precision)
        band_kernels.add_dots(derivative, residual, information, self.dots.first, *place)
        diagonal = self._matrix[:, 0]
        diagonal += damping * diagonal.max()
        diagonal[self._held] = 1.0
        gradient[self._held] = 0.0
        return gradient
