"""The normal equations of a Gauss-Newton step from marker images to the coefficients of the sheet."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.spline.patch import Nodal, PointBasis
from manytouch.mechanics.banded.band import BandFactor, band_rows, factorise, new_band
from manytouch.mechanics.markers.images import MarkerImages
from manytouch.mechanics.shell import tangent_kernels
from manytouch.mechanics.shell.shell import Shell
from manytouch.mechanics.solver import band_kernels
from manytouch.mechanics.solver.linearisation import Linearisation
from manytouch.mechanics.solver.posterior import Posterior, PosteriorCache, WhiteRows

MIN_DAMPING = 1e-7
"""First addition to the diagonal of a singular normal matrix, over its largest entry."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NormalEquations:
    """Assembles and solves the normal equations of marker residuals and weighted nodal forces.

    The objective is sum r^T W r + sum weight (T f)^2 (docs/derivations/mechanics.md, "Step"). Methods are
    functions of their arguments; results own their arrays.

    Attributes:
        shell: the sheet.
        dots: the marker images.
        precision: of matrices; forces, pixels and steps are float64. By default float32 for a clamped patch,
            whose steps are then accurate to 1e-4 of their size, and float64 for a soft one, whose outer part
            is poorly determined.
    """

    shell: Shell
    dots: MarkerImages
    precision: type[np.floating] | None = None

    def __post_init__(self) -> None:
        if self.precision is None:
            is_clamped = self.shell.patch.boundary == "clamped"
            object.__setattr__(self, "precision", np.float32 if is_clamped else np.float64)

    def linearise(self, coefficient_mm: Nodal, force: Nodal | None = None) -> Linearisation:
        """Forces, marker images and their derivatives at coefficients (nodes, 3).

        `force` is `Shell.forces` of these coefficients, if they are known.
        """
        patch = self.shell.patch
        tangent = self.shell.empty_tangent(self._precision)
        self.shell.tangent_at(coefficient_mm, tangent)
        derivative = self.dots.derivative_px(coefficient_mm)
        derivative *= patch.is_free[self.dots.tips.basis.node][:, None]
        return Linearisation(
            shell=self.shell,
            dots=self.dots,
            force=self.shell.forces(coefficient_mm) if force is None else force.copy(),
            tangent=tangent,
            slope=patch.slopes(coefficient_mm[:, 2]),
            derivative=derivative,
        )

    def solve(
        self,
        linearisation: Linearisation,
        residual_px: Float64[np.ndarray, "m 2"],
        information_per_px2: Float64[np.ndarray, "m 2 2"],
        force_weight_per_mm4: Nodal,
    ) -> Posterior:
        """The posterior of the coefficients, and the step that leads to its mean.

        Args:
            linearisation: at the present coefficients.
            residual_px: (m, 2) predicted minus measured marker images.
            information_per_px2: (m, 2, 2) W, inverse covariance times robust weight; 0 for a marker that is
                not seen, whose residual may be NaN.
            force_weight_per_mm4: (nodes, 3) of the tangential x and y and of the normal part of T f.
        """
        is_used = information_per_px2[:, [0, 1], [0, 1]] != 0.0
        residual = np.where(is_used, residual_px, 0.0)
        damping = 0.0
        while True:
            factor, gradient = self._factorise(
                linearisation, residual, information_per_px2, force_weight_per_mm4, damping
            )
            if factor is not None:
                break
            damping = max(MIN_DAMPING, 10.0 * damping)
        return Posterior(
            linearisation=linearisation,
            change_mm=-factor.solve(gradient[None])[0].reshape(-1, 3),
            factor=factor,
            weight=force_weight_per_mm4,
            weighed_mm2=linearisation.force,
            information=information_per_px2,
            damping=damping,
            rows=WhiteRows(linearisation, factor),
            workspace=PosteriorCache(),
        )

    def _factorise(
        self, at: Linearisation, residual: np.ndarray, information: np.ndarray, weight: Nodal, damping: float
    ) -> tuple[BandFactor | None, Float64[np.ndarray, " n"]]:
        """Factor of H, None if it is not positive definite, and the gradient (n,)."""
        patch = self.shell.patch
        width = 3 * 2 * tangent_kernels.REACH * (patch.shape[1] + 1) + 2
        gradient = np.zeros(3 * patch.node_count)
        band = new_band(gradient.size, width, self._precision)
        sheet = band_kernels.SheetDerivatives(at.force, at.tangent, at.slope)
        band_kernels.add_forces(sheet, self._slope_tables, weight, patch.is_free, patch.shape, band, gradient)
        band_kernels.add_markers(
            at.derivative.reshape(-1, 2, 4, 12).astype(self._precision),
            residual,
            information.astype(self._precision),
            self.dots.first,
            patch.shape[1],
            band,
            gradient,
        )
        is_fixed = ~patch.is_free.ravel()
        diagonal = band_rows(band)[:, 0]
        diagonal += damping * diagonal.max()
        diagonal[is_fixed] = 1.0
        gradient[is_fixed] = 0.0
        return factorise(band), gradient

    @property
    def _precision(self) -> type[np.floating]:
        assert self.precision is not None
        return self.precision

    @cached_property
    def _nodes(self) -> PointBasis:
        return self.shell.patch.at(self.shell.patch.place_mm)

    @cached_property
    def _slope_tables(self) -> band_kernels.SlopeTables:
        patch = self.shell.patch
        first = patch.window(patch.place_mm).first
        is_free = patch.is_free[self._nodes.node, 2].reshape(-1, 4, 4)
        table_x, table_y = (
            np.ascontiguousarray(table.reshape(-1, 4, 4)) * is_free
            for table in (self._nodes.slope_x, self._nodes.slope_y)
        )
        return band_kernels.SlopeTables(first, table_x, table_y)
