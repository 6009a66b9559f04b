"""Sheets that are as likely as the one that was found: deviations of whatever is worked out from a sheet.

The normal matrix H of the inversion at a surface is worked out again, which costs a whole step, so
nothing has to be kept with the surface. With H = L L^T and u of independent normal numbers, c + L^-T u has
the covariance H^-1 (A. Gelman et al. 2013, Bayesian Data Analysis, section 13.3); forces follow by the
tangent. The same numbers u are used for every frame, so that maps do not flicker and a replay gives the
same bits.
"""

from dataclasses import replace

import numpy as np

from manytouch.estimation.mechanics.estimator import MechanicsEstimator
from manytouch.estimation.mechanics.gauss_newton import SheetShape
from manytouch.values import Sensor, SheetSpline, Surface, TrackedGrid
from manytouch.values.arrays import read_only

DRAWS = 32
"""Deviations from so many are right to 12 % (one deviation)."""


class PosteriorSamples:
    """Draws sheets for the surfaces of one sensor.

    Attributes:
        draws: how many.
    """

    def __init__(
        self, sensor: Sensor, estimate: MechanicsEstimator | None = None, *, draws: int = DRAWS
    ) -> None:
        """Works out what only the sensor decides.

        Raises:
            SensorError: the sensor has no layout.
            LayoutError: it has too few markers.
        """
        self.draws = draws
        self._estimate = MechanicsEstimator() if estimate is None else estimate
        self._memory = self._estimate.start(sensor)
        count = 3 * self._memory.model.patch.node_count
        self._normal = np.random.default_rng(0).standard_normal((draws, count))

    def __call__(self, surface: Surface, grid: TrackedGrid) -> tuple[SheetSpline, ...]:
        """Splines around the surface's, by the noise of its frame, the model's error of a dot, and the prior.

        Args:
            surface: as the inversion told it.
            grid: of its frame.

        Returns:
            Empty where the surface has no spline, or nothing is seen.
        """
        spline, estimate, model = surface.spline, self._estimate, self._memory.model
        if spline is None or not grid.is_seen.any():
            return ()
        shape = SheetShape.of(model, spline.coefficient_mm)
        state = replace(self._memory, shape=shape)
        measured_px = np.where(grid.is_seen[:, None], grid.position_px - state.reference_px, 0.0)
        information = estimate.information(state, grid, measured_px)
        weight = estimate.descend.weights(model, shape.force_mm2, estimate.noise(state, grid))
        model.normal.linearise(spline.coefficient_mm)
        model.normal.step(shape.moved_px - measured_px, information, weight)
        return tuple(
            replace(
                spline,
                coefficient_mm=read_only(spline.coefficient_mm + change_mm),
                force_over_E_mm2=read_only(spline.force_over_E_mm2 + model.normal.force_change(change_mm)),
            )
            for change_mm in model.normal.drawn(self._normal)
        )
