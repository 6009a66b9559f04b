"""Forces and marker images of a sheet at given coefficients, with their derivatives."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64

from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers import kernels as marker_kernels
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell import tangent_kernels
from manytouch.mechanics.shell.shell import Shell
from manytouch.values.arrays import read_only_view


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Linearisation:
    """First-order model of the sheet and of its marker images around some coefficients.

    Forces are divided by Young's modulus E and are in the sheet frame: a press has force z < 0. The value
    owns its arrays.

    Attributes:
        shell: the sheet.
        dots: the marker images.
        force: (nodes, 3) nodal forces over E, mm^2.
        tangent: (nodes, 3, 3, 7, 8) derivative of `force` by the coefficients, mm; layout as in
            `Shell.forces_and_tangent`.
        slope: (nodes, 2) of the deflection along x and y at the nodes.
        derivative: (m, 2, 16, 3) derivative of the marker images by the coefficients of
            `dots.tips.basis.node`, px/mm; 0 for fixed coefficients.
    """

    shell: Shell
    dots: MarkerImages
    force: Nodal
    tangent: Float[np.ndarray, "nodes 3 3 7 8"]
    slope: Float64[np.ndarray, "nodes 2"]
    derivative: Float64[np.ndarray, "m 2 16 3"]

    @property
    def balance(self) -> Nodal:
        """(nodes, 3) T f: the tangential forces f_u + w,x f_w and f_v + w,y f_w, and the normal one f_w."""
        balance = self.force.copy()
        balance[:, :2] += self.slope * self.force[:, 2:]
        balance[~self.shell.patch.is_free] = 0.0
        return balance

    def force_change(self, change_mm: Nodal) -> Nodal:
        """First-order change of the forces over E (mm^2) for a change of the coefficients."""
        return np.asarray(self.force_changes(change_mm[None])[0])

    def force_changes(self, change_mm: Float64[np.ndarray, "k nodes 3"]) -> Float64[np.ndarray, "k nodes 3"]:
        """First-order changes of the forces over E (mm^2) for each of several changes of the coefficients."""
        return self.shell.products(self.tangent, change_mm)

    def balance_change(self, change_mm: Nodal) -> Nodal:
        """First-order change of `balance` for a change of the coefficients."""
        change = self.force_change(change_mm)
        turned = self.shell.patch.slopes(change_mm[:, 2])
        change[:, :2] += self.slope * change[:, 2:] + self.force[:, 2:] * turned
        change[~self.shell.patch.is_free] = 0.0
        return change

    def force_rows(
        self, share: Float64[np.ndarray, "k nodes"], component: Int64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """Derivatives of k sums sum_j share_kj f_j,component by the coefficients."""
        patch, rows = self.shell.patch, np.empty((*share.shape, 3))
        free_share = np.where(patch.is_free.T[component], share, 0.0)
        tangent_kernels.row_sums(self.tangent, patch.shape, free_share, component, rows)
        return rows

    def balance_rows(
        self, node: Int64[np.ndarray, " k"], component: Int64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """Derivatives of k free components of `balance` by the coefficients."""
        share = np.zeros((len(node), self.shell.patch.node_count))
        share[np.arange(len(node)), node] = 1.0
        rows, tangential = self.force_rows(share, component), np.flatnonzero(component < 2)
        if len(tangential) > 0:
            rows[tangential] += self._by_slopes(share[tangential], component[tangential])
        return np.asarray(rows)

    def tangential_gradients(
        self, weighted: Float64[np.ndarray, "k nodes"], component: Int64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """`balance_gradients` of one tangential component each (k, nodes), fast where few nodes are not 0."""
        gradients = self._by_slopes(weighted, component)
        gradients += self.force_rows(weighted, component)
        gradients[:, ~self.shell.patch.is_free] = 0.0
        return gradients

    def _by_slopes(
        self, share: Float64[np.ndarray, "k nodes"], component: Int64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """Derivatives of k sums sum_j share_kj w,component f_w over nodes j, for components 0 and 1."""
        patch = self.shell.patch
        shares = np.where(patch.is_free.T[component], share, 0.0)
        rows = self.force_rows(self.slope.T[component] * shares, np.full(len(shares), 2))
        for axis in range(2):
            own = np.flatnonzero(component == axis)
            rows[own, :, 2] += patch.slope_moments_along(axis, self.force[:, 2] * shares[own])
        return rows

    def balance_gradients(
        self, weighted_balance: Float64[np.ndarray, "k nodes 3"]
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """Half the gradients of k sums of weight (T f)^2, for weight times T f; 0 if not free."""
        patch = self.shell.patch
        weighted = np.where(patch.is_free, weighted_balance, 0.0)
        couples = self.force[:, 2:] * weighted[:, :, :2]
        weighted[:, :, 2] += self.slope[:, 0] * weighted[:, :, 0] + self.slope[:, 1] * weighted[:, :, 1]
        gradients = self.shell.products(self.tangent, weighted)
        for gradient, couple in zip(gradients, couples, strict=True):
            gradient[:, 2] += patch.slope_moments(couple)
        gradients[:, ~patch.is_free] = 0.0
        return gradients

    def gradient(
        self,
        residual_px: Float64[np.ndarray, "m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        weighted_balance: Nodal,
    ) -> Nodal:
        """Half the gradient of sum r^T W r + sum weight (T f)^2 with the derivatives of this linearisation.

        Args:
            residual_px: (m, 2) predicted minus measured; ignored where the information is 0.
            information_per_px2: (m, 2, 2) W.
            weighted_balance: (nodes, 3) weight times T f.
        """
        gradients = self.gradients(residual_px[None], information_per_px2, weighted_balance[None])
        return np.asarray(gradients[0])

    def gradients(
        self,
        residual_px: Float64[np.ndarray, "k m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        weighted_balance: Float64[np.ndarray, "k nodes 3"],
    ) -> Float64[np.ndarray, "k nodes 3"]:
        """As `gradient`, for each of several residuals and forces."""
        gradients = self.balance_gradients(weighted_balance)
        marker_kernels.add_pulls(
            read_only_view(self.derivative.reshape(-1, 2, 4, 12)),
            read_only_view(np.ascontiguousarray(residual_px)),
            read_only_view(information_per_px2),
            self.dots.first,
            self.shell.patch.shape[1],
            gradients,
        )
        return gradients
