"""Coverage of intervals: one sample of each contact, so that samples are independent.

`uncertainty_calibration` compares the same deviations with the errors of all frames, without a band.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import bdtr, ndtri

from manytouch.evaluation.metrics.contacts import ContactSamples
from manytouch.values.arrays import Scalars

COVERED_LEVELS = (0.5, 0.9, 0.95)
BAND = 0.99
"""Probability that the share within the 95 % interval is within its bounds if the deviations are right."""
FEWEST = 5
COVERED = ("position", "depth", "force", "shear", "torque", "area")
"""Quantities of a contact whose intervals are compared with the truth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """How often the intervals of one quantity contain the true value.

    Attributes:
        contacts: with an error and a deviation above 0.
        coverage_50, coverage_90, coverage_95: share of the errors within these intervals; of the last frame
            of each contact, unlike `UncertaintyCalibration.coverage_95`.
        low_95, high_95: bounds that contain coverage_95 in 99 % of cases if the deviations are right and the
            contacts independent.
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
        """Whether coverage_95 is within its bounds."""
        return self.low_95 <= self.coverage_95 <= self.high_95


def coverages(samples: ContactSamples) -> dict[str, Coverage | None]:
    """Coverage of each of `COVERED` in the last frame of each contact; x and y are two components of one.

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
    found = {}
    for name in COVERED:
        error, std = errors[name]
        found[name] = coverage_of(error[last].ravel(), std[last].ravel(), components=error[last].ndim)
    return found


def coverage_of(error: Scalars, std: Scalars, *, components: int = 1) -> Coverage | None:
    """Coverage of errors and deviations in the same unit.

    Args:
        error, std: (n,) of all contacts and components.
        components: errors of one contact: all count for the shares, the bounds are those of
            n / components contacts.

    Returns:
        None if fewer than 5 contacts have both.
    """
    has_both = np.isfinite(error) & np.isfinite(std) & (std > 0)
    contacts = int(has_both.sum()) // components
    if contacts < FEWEST:
        return None
    z = np.abs(error[has_both] / std[has_both])
    inside = [float((z <= ndtri(0.5 + level / 2)).mean()) for level in COVERED_LEVELS]
    probability = bdtr(np.arange(contacts + 1), contacts, COVERED_LEVELS[-1])  # of as many within, or fewer
    low, high = np.searchsorted(probability, (0.5 - BAND / 2, 0.5 + BAND / 2))
    return Coverage(
        contacts=contacts,
        coverage_50=inside[0],
        coverage_90=inside[1],
        coverage_95=inside[2],
        low_95=float(low) / contacts,
        high_95=float(high) / contacts,
        chi2_per_dof=float(np.mean(z**2)),
    )
