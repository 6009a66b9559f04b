"""Do intervals contain the truth? One sample of each contact, so that samples are independent."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom, norm

from manytouch.evaluation.metrics.contacts import ContactSamples
from manytouch.values.arrays import Scalars

LEVELS = (0.5, 0.9, 0.95)
BAND = 0.99
FEWEST = 5
COVERED = ("position", "depth", "force", "shear", "torque", "area")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Of one quantity.

    Attributes:
        contacts: with an error and a deviation above 0.
        coverage_50, coverage_90, coverage_95: share of the errors within these intervals.
        low_95, high_95: in which the share within the 95 % interval lies in 99 of 100 cases where the
            deviations are right and contacts independent.
        chi2_per_dof: mean square of error over deviation.
    """

    contacts: int
    coverage_50: float
    coverage_90: float
    coverage_95: float
    low_95: float
    high_95: float
    chi2_per_dof: float

    @property
    def is_right(self) -> bool:
        """Whether the share within the 95 % interval is within the band."""
        return self.low_95 <= self.coverage_95 <= self.high_95


def coverages(samples: ContactSamples) -> dict[str, Coverage | None]:
    """Of each of `COVERED`, from the last frame of each contact; x and y are components of their own.

    The area is compared on a logarithmic scale, where its error is more even.
    """
    last = samples.is_last
    shear = samples.shear_N - samples.true_shear_N
    with np.errstate(invalid="ignore", divide="ignore"):
        area = np.log(samples.area_mm2 / samples.true_area_mm2)
        area_std = samples.area_std_mm2 / samples.area_mm2
    errors = {
        "position": (samples.offset_mm, samples.offset_std_mm),
        "depth": (samples.depth_mm - samples.true_depth_mm, samples.depth_std_mm),
        "force": (samples.force_N - samples.true_force_N, samples.force_std_N),
        "shear": (shear, samples.shear_std_N),
        "torque": (samples.torque_Nmm - samples.true_torque_Nmm, samples.torque_std_Nmm),
        "area": (area, area_std),
    }
    return {
        name: coverage_of(error[last].ravel(), std[last].ravel(), components=error[last].ndim)
        for name, (error, std) in errors.items()
    }


def coverage_of(error: Scalars, std: Scalars, *, components: int = 1) -> Coverage | None:
    """Of errors and deviations (n,), `components` of them from one contact; None of less than 5 contacts."""
    has_both = np.isfinite(error) & np.isfinite(std) & (std > 0)
    contacts = int(has_both.sum()) // components
    if contacts < FEWEST:
        return None
    z = np.abs(error[has_both] / std[has_both])
    inside = [float((z <= norm.ppf(0.5 + level / 2)).mean()) for level in LEVELS]
    low, high = binom.interval(BAND, contacts, LEVELS[-1])
    return Coverage(
        contacts=contacts,
        coverage_50=inside[0],
        coverage_90=inside[1],
        coverage_95=inside[2],
        low_95=float(low) / contacts,
        high_95=float(high) / contacts,
        chi2_per_dof=float(np.mean(z**2)),
    )
