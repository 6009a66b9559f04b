"""What is expected of a contact on a pad before its images are looked at."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.pad_model import PadModel
from manytouch.estimation.pad.patch_kernels import SHAPE

LOADS = 5
"""Loads of a contact: normal force, shear x, y and torque, over E; radial shear over the normal force."""
OWN = SHAPE + LOADS
"""Parameters of a contact: those of its shape, then its loads."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchPrior:
    """Broad normal distributions of the parameters of a contact; that of its centre is as wide as the pad.

    Attributes:
        usual_radius: radius of a rigid ball, in thicknesses, whose contact on a half-space with the same
            force (H. Hertz 1882) has the expected root of the second moment,
        root_limits: within these limits, in thicknesses,
        root_spread: and the standard deviation of its logarithm.
        stretch_spread: standard deviation of the difference of both principal moments over their sum.
        friction: standard deviation of shear over normal force,
        radial_mean, radial_friction: mean and standard deviation of radial shear over normal force; it is
            negative where an object sticks to a pad that spreads under it.
    """

    usual_radius: float = 1.0
    root_limits: tuple[float, float] = (0.08, 0.35)
    root_spread: float = 0.6
    stretch_spread: float = 0.5
    friction: float = 1.0
    radial_mean: float = -0.06
    radial_friction: float = 0.12

    def __call__(
        self, model: PadModel, own: Float64[np.ndarray, "10"]
    ) -> tuple[Float64[np.ndarray, "9"], Float64[np.ndarray, "9 10"]]:
        """Differences of parameters (OWN,) from those expected, in standard deviations, and their slopes."""
        xx, yx, yy = own[2:SHAPE]
        press = max(abs(own[SHAPE]), 1e-9)
        sign = np.sign(own[SHAPE]) or 1.0
        radius_mm = self.usual_radius * model.thickness_mm
        hertz_mm = (0.75 * press * (1.0 - model.poisson**2) * radius_mm) ** (1.0 / 3.0) / np.sqrt(5.0)
        least_mm, most_mm = (limit * model.thickness_mm for limit in self.root_limits)
        usual_mm = min(max(hertz_mm, least_mm), most_mm)
        trace = xx**2 + yx**2 + yy**2
        by_trace = 2.0 * np.array([xx, yx, yy]) / trace
        spread = self.stretch_spread * trace
        value, slope = np.zeros(9), np.zeros((9, OWN))
        value[0] = np.log(np.sqrt(abs(xx * yy)) / usual_mm) / self.root_spread
        slope[0, 2], slope[0, 4] = 0.5 / (self.root_spread * xx), 0.5 / (self.root_spread * yy)
        if least_mm < hertz_mm < most_mm:
            slope[0, SHAPE] = -sign / (3.0 * press * self.root_spread)
        value[1], value[2] = (xx**2 - yx**2 - yy**2) / spread, 2.0 * xx * yx / spread
        slope[1, 2:SHAPE] = 2.0 * np.array([xx, -yx, -yy]) / spread - value[1] * by_trace
        slope[2, 2:SHAPE] = 2.0 * np.array([yx, xx, 0.0]) / spread - value[2] * by_trace
        std = self.friction * press * np.array([1.0, 1.0, np.sqrt(trace)])
        value[3:6] = own[SHAPE + 1 : SHAPE + 4] / std
        slope[range(3, 6), range(SHAPE + 1, SHAPE + 4)] = 1.0 / std
        slope[3:6, SHAPE] = -sign * value[3:6] / press
        slope[5, 2:SHAPE] = -0.5 * value[5] * by_trace
        value[6] = (own[OWN - 1] - self.radial_mean) / self.radial_friction
        slope[6, OWN - 1] = 1.0 / self.radial_friction
        size_mm = np.array(model.patch.size_mm)
        value[7:] = own[:2] / size_mm
        slope[[7, 8], [0, 1]] = 1.0 / size_mm
        return value, slope
