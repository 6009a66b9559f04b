"""A shape of the sheet in the course of a fit, compared with the measured marker images."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Covariances2, Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Iterate:
    """A shape with the residuals of the markers, their misfit, and the tangential and normal forces.

    Attributes:
        shape: with its forces.
        measured_px: (m, 2) displacements of the marker images.
        information: (m, 2, 2) their inverse covariances times their weights, per px^2.
        usual_std_px: the usual standard deviation of the marker images.
        residual_px: (m, 2) predicted minus measured displacements of the marker images.
        misfit: sum of the weighted squared residuals.
        worst_chi2: mean square of the residuals of a marker over their deviation, where it is largest.
        balance_mm2: (n, 3) tangential and normal nodal forces over E.
    """

    shape: SheetShape
    measured_px: Points2
    information: Covariances2
    residual_px: Points2
    misfit: float
    worst_chi2: float
    balance_mm2: Nodal
    usual_std_px: float

    @staticmethod
    def at(
        model: InversionModel,
        shape: SheetShape,
        measured_px: Points2,
        information: Covariances2,
        usual_std_px: float,
    ) -> "Iterate":
        residual_px = np.asarray(shape.displacement_px - measured_px)
        x, y = residual_px[:, 0], residual_px[:, 1]
        pull_x = information[:, 0, 0] * x + information[:, 0, 1] * y
        pull_y = information[:, 1, 0] * x + information[:, 1, 1] * y
        misfit = x * pull_x + y * pull_y
        return Iterate(
            shape=shape,
            measured_px=measured_px,
            information=information,
            residual_px=residual_px,
            misfit=float(misfit.sum()),
            worst_chi2=0.5 * float(misfit.max(initial=0.0)),
            balance_mm2=balance(model, shape.slope, shape.force_mm2),
            usual_std_px=usual_std_px,
        )

    def move(self, model: InversionModel, change_mm: Nodal) -> "Iterate":
        coefficient_mm = self.shape.coefficient_mm + change_mm
        there = SheetShape.at(model, coefficient_mm, self.shape.body_force)
        return Iterate.at(model, there, self.measured_px, self.information, self.usual_std_px)

    @property
    def chi2(self) -> float:
        return self.misfit / max(2.0 * float((self.information[:, 0, 0] > 0.0).sum()), 1.0)

    def cost(self, weight: Nodal) -> float:
        return self.misfit + float((weight * self.balance_mm2**2).sum())


def balance(model: InversionModel, slope: Float64[np.ndarray, "nodes 2"], force_mm2: Nodal) -> Nodal:
    """(n, 3) nodal forces over E tangential to the sheet with these slopes, and their z components."""
    along = force_mm2.copy()
    along[:, :2] += slope * force_mm2[:, 2:]
    along[~model.patch.is_free] = 0.0
    return along
