"""A press of an assumed sheet, and how well another sheet explains its markers.

The markers of one frame are fitted from rest. The cost is that of `gauss_newton`, with the prior of the
forces: forces everywhere explain any residuals of a sheet that is too thin or ends elsewhere, so that
residuals alone do not show it.
"""

from dataclasses import dataclass, replace

import numpy as np

from manytouch.estimation.mechanics.inversion.gauss_newton import Fit, GaussNewton
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel, NominalSheet
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.values import Sensor
from manytouch.values.arrays import Covariances2, Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SearchedPress:
    """The markers of a frame in which something presses the sheet; see `GaussNewton.__call__`.

    Attributes:
        measured_px: (m, 2) displacements of the marker images, also by a motion of the whole image; any
            finite value where not seen.
        information: (m, 2, 2) per px^2; 0 where not seen.
        noise: ratio of the marker noise to the usual one.
        usual_std_px: the usual standard deviation of the marker images.
        moved_pitch: RMS motion of the markers, in pitches of the image.
        view_px: (m, 2) motion of the whole image that the outermost markers show, if the sheet ends there.
    """

    measured_px: Points2
    information: Covariances2
    noise: float
    usual_std_px: float
    moved_pitch: float
    view_px: Points2

    def without_view_motion(self) -> "SearchedPress":
        """The press without the motion of the whole image."""
        return replace(self, measured_px=self.measured_px - self.view_px)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetTrial:
    """How well a sheet explains a press.

    Attributes:
        log_cost: natural logarithm of the cost of the fit.
        misfit: RMS residual over the RMS motion of the markers.
        elements: number of elements, which the time of the fit grows with.
    """

    log_cost: float
    misfit: float
    elements: int


@dataclass(frozen=True, slots=True, eq=False)
class SheetTrials:
    """Fits presses with other sheets.

    Attributes:
        gauss_newton: the inversion.
        nominal_sheet: properties that a sheet does not state.
        present: the model now, whose strain by the pretension is kept.
    """

    gauss_newton: GaussNewton
    nominal_sheet: NominalSheet
    present: InversionModel

    def __call__(self, sensor: Sensor, press: SearchedPress) -> SheetTrial:
        """The fit from rest with the sheet of a sensor."""
        now = self.present
        thickness_mm = now.thickness_mm if sensor.sheet is None else sensor.sheet.thickness_mm
        stretched_mm = now.shell.pretension_over_E_mm * thickness_mm / now.thickness_mm
        model = self.nominal_sheet(sensor, press.usual_std_px, stretched_mm)
        seen = press.measured_px, press.information, press.noise
        shape, usual_std_px = SheetShape.at_rest(model), press.usual_std_px
        first = self.gauss_newton(model, shape, *seen, usual_std_px=usual_std_px)
        # the second time with the weights of the forces that the first one has found
        fit = self.gauss_newton(model, first.shape, *seen, usual_std_px=usual_std_px)
        return SheetTrial(
            log_cost=float(np.log(_cost(fit))),
            misfit=_misfit(fit, press),
            elements=int(np.prod(model.patch.elements)),
        )


def _cost(fit: Fit) -> float:
    """What `GaussNewton` minimises."""
    pulled = np.einsum("mij,mj->mi", fit.posterior.information, fit.residual_px)
    return float((pulled * fit.residual_px).sum() + (fit.posterior.weight * fit.balance_mm2**2).sum())


def _misfit(fit: Fit, press: SearchedPress) -> float:
    is_used = press.information[:, 0, 0] > 0.0
    left, whole = (np.square(each[is_used]).sum() for each in (fit.residual_px, press.measured_px))
    return float(np.sqrt(left / max(whole, np.finfo(np.float64).tiny)))
