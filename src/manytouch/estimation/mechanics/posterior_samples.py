"""Samples of the posterior of the sheet, for standard deviations of anything that is computed from a surface.

The posterior at a surface is computed again, which costs a full step, so that nothing has to be stored with
the surface. With H = L L^T and u of independent normal numbers, c + L^-T u has the covariance H^-1 (A. Gelman
et al. 2013, Bayesian Data Analysis, section 13.3); forces follow from the tangent. The same numbers u serve
every frame: maps do not flicker, and processing a recording again gives the same bits.
"""

from dataclasses import replace

import numpy as np

from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.estimation.mechanics.inversion.sheet_shape import SheetShape
from manytouch.estimation.mechanics.mechanics_state import MechanicsState
from manytouch.values import Sensor, SheetSpline, Surface, TrackedGrid
from manytouch.values.arrays import read_only

_PRESSED_SHARE = 0.03
"""Nodes with this share of the largest force are pressed; the sparse prior does not hold there."""

DRAWS = 32
"""Number of samples; a standard deviation from 32 has a relative standard deviation of 12 %."""


class PosteriorSamples:
    """Draws sheets for the surfaces of one sensor.

    Attributes:
        draws: number of samples.
    """

    def __init__(
        self, sensor: Sensor, estimate: MechanicsEstimator | None = None, *, draws: int = DRAWS
    ) -> None:
        """Computes what depends on the sensor only.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has too few markers.
        """
        self.draws = draws
        self._estimate = MechanicsEstimator() if estimate is None else estimate
        self._state: MechanicsState = self._estimate.start(sensor)
        count = 3 * self._state.model.patch.node_count
        self._normal = np.random.default_rng(0).standard_normal((self.draws, count))

    def __call__(self, surface: Surface, grid: TrackedGrid) -> tuple[SheetSpline, ...]:
        """Splines around that of a surface, by the noise of its frame, the model's error and the prior.

        Args:
            surface: an estimate of `MechanicsEstimator`.
            grid: the tracked markers of its frame.

        Returns:
            `draws` splines; none where the surface has no spline or no marker is seen.
        """
        spline, estimate = surface.spline, self._estimate
        if spline is None or not grid.is_seen.any():
            return ()
        model = self._state.model
        shape = replace(
            SheetShape.at(model, spline.coefficient_mm), force_mm2=read_only(spline.force_over_E_mm2)
        )
        state = replace(self._state, shape=shape)
        measured_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        information = estimate.information(state, grid, measured_px)
        noise = estimate.marker_noise.noise_ratio(grid, state.model_std_px)
        usual_std_px = estimate.marker_noise.usual_std_px(state.model_std_px)
        weight = estimate.gauss_newton.weights(model, shape, noise, usual_std_px)
        press_mm2 = -shape.force_mm2[:, 2]
        weight[press_mm2 > _PRESSED_SHARE * press_mm2.max(initial=0.0), 2] = 0.0
        linearisation = model.normal_equations.linearise(spline.coefficient_mm, shape.force_mm2)
        posterior = model.normal_equations.solve(
            linearisation, shape.displacement_px - measured_px, information, weight
        )
        return tuple(
            replace(
                spline,
                coefficient_mm=read_only(spline.coefficient_mm + change_mm),
                force_over_E_mm2=read_only(spline.force_over_E_mm2 + linearisation.force_change(change_mm)),
            )
            for change_mm in posterior.colour(self._normal)
        )
