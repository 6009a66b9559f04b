"""What is expected of a contact on a pad before its images are looked at."""

from dataclasses import dataclass

from manytouch.estimation.pad.pad_model import BondedPadModel
from manytouch.estimation.pad.patch_steps import PriorNumbers


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchPrior:
    """Broad normal distributions of the parameters of a contact; that of its centre is as wide as the pad.

    The root of the second moment is the square root of the determinant of its triangular root
    (`patch_kernels.SHAPE`): the geometric mean of the standard deviations of the place of the pressure along
    its two principal directions.

    Attributes:
        usual_radius: radius, in thicknesses, of the rigid ball whose contact with the same force on a
            half-space (H. Hertz 1882) has the expected root of the second moment.
        root_limits: least and largest expected root of the second moment, in thicknesses; an estimated root
            may lie outside.
        root_spread: standard deviation of the logarithm of the ratio of the root of the second moment to the
            expected one.
        stretch_spread: standard deviation of the logarithm of the ratio of the standard deviations of the
            pressure along its two principal directions.
        friction: standard deviation of each component of the shear over the normal force; of the torque over
            the normal force times the square root of the trace of the second moment.
        radial_mean: mean of the radial shear over the normal force; negative where an object sticks to a pad
            that spreads under it.
        radial_friction: standard deviation of the radial shear over the normal force, of a narrow contact.
        radial_growth: its growth with the root of the second moment in thicknesses, in quadrature: markers
            show the radial shear of wide contacts, and hardly that of narrow ones.
    """

    usual_radius: float = 1.0
    root_limits: tuple[float, float] = (0.08, 0.35)
    root_spread: float = 0.6
    stretch_spread: float = 0.8
    friction: float = 1.0
    radial_mean: float = -0.06
    radial_friction: float = 0.02
    radial_growth: float = 0.2

    def numbers(self, model: BondedPadModel) -> PriorNumbers:
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
            radial_growth_per_mm=self.radial_growth / thickness_mm,
            size_x_mm=float(model.patch.size_mm[0]),
            size_y_mm=float(model.patch.size_mm[1]),
        )
