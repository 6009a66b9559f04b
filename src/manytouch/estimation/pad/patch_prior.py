"""What is expected of a contact on a pad before its images are looked at."""

from dataclasses import dataclass

from manytouch.estimation.pad.pad_model import ObservedPad
from manytouch.estimation.pad.patch_forces import OWN
from manytouch.estimation.pad.patch_kernels import SHAPE
from manytouch.estimation.pad.patch_steps import PriorNumbers

LOADS = OWN - SHAPE
"""Loads of a contact: normal force, shear x, y and torque, over E; radial shear over the normal force."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchPrior:
    """Broad normal distributions of the parameters of a contact; that of its centre is as wide as the pad.

    Attributes:
        usual_radius: radius of a rigid ball, in thicknesses, whose contact on a half-space with the same
            force (H. Hertz 1882) has the expected root of the second moment,
        root_limits: within these limits, in thicknesses,
        root_spread: and the standard deviation of its logarithm.
        stretch_spread: standard deviation of the logarithm of the ratio of its two principal roots.
        friction: standard deviation of shear over normal force,
        radial_mean, radial_friction: mean and standard deviation of radial shear over normal force; it is
            negative where an object sticks to a pad that spreads under it.
    """

    usual_radius: float = 1.0
    root_limits: tuple[float, float] = (0.08, 0.35)
    root_spread: float = 0.6
    stretch_spread: float = 0.8
    friction: float = 1.0
    radial_mean: float = -0.06
    radial_friction: float = 0.04

    def numbers(self, model: ObservedPad) -> PriorNumbers:
        """The prior on a pad, for compiled functions."""
        thickness_mm = model.thickness_mm
        return PriorNumbers(
            usual_radius_mm=self.usual_radius * thickness_mm,
            poisson=model.poisson,
            least_mm=self.root_limits[0] * thickness_mm,
            most_mm=self.root_limits[1] * thickness_mm,
            root_spread=self.root_spread,
            stretch_spread=self.stretch_spread,
            friction=self.friction,
            radial_mean=self.radial_mean,
            radial_friction=self.radial_friction,
            size_x_mm=float(model.patch.size_mm[0]),
            size_y_mm=float(model.patch.size_mm[1]),
        )
