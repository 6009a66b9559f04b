"""Whether deviations are right: observed errors are compared with predicted deviations."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from manytouch.values.arrays import Scalars

CALIBRATION_LEVELS = tuple(np.round(np.arange(0.05, 1.0, 0.05), 2).tolist())
FEWEST = 20


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class UncertaintyCalibration:
    """Errors over their predicted deviations, z, which should be standard normal.

    Attributes:
        count: components with an error and a deviation above 0.
        given: share of the errors that come with a deviation above 0.
        chi2_per_dof: mean of z^2; 1 is right, more is overconfident. Outliers weigh heavily.
        spread: half the width of the middle 68.27 % of z; 1 is right. Outliers weigh little.
        coverage_68, coverage_95: share of |z| below 0.994 and 1.960; 0.68 and 0.95 are right. Of all frames,
            unlike `Coverage.coverage_95`.
        levels, coverage: the same for all levels from 5 to 95 %.
        predicted, observed: root mean square of predicted deviation and of error, in tenths of the
            components ordered by their deviation.
    """

    count: int
    given: float
    chi2_per_dof: float
    spread: float
    coverage_68: float
    coverage_95: float
    levels: tuple[float, ...]
    coverage: tuple[float, ...]
    predicted: tuple[float, ...]
    observed: tuple[float, ...]


def uncertainty_calibration(error: Scalars, std: Scalars) -> UncertaintyCalibration | None:
    """Compare predicted deviations with errors, component by component (both (n,)).

    Returns:
        None when fewer than 20 components have both.
    """
    is_known = np.isfinite(error)
    has_both = is_known & np.isfinite(std) & (std > 0)
    count = int(has_both.sum())
    if count < FEWEST:
        return None
    error, std = error[has_both], std[has_both]
    z = error / std
    low, high = np.percentile(z, [15.865, 84.135])
    levels = (*CALIBRATION_LEVELS, 0.68, 0.95)
    coverage = [float((np.abs(z) <= ndtri(0.5 + level / 2)).mean()) for level in levels]
    tenths = np.array_split(np.argsort(std, kind="stable"), 10)
    return UncertaintyCalibration(
        count=count,
        given=count / int(is_known.sum()),
        chi2_per_dof=float(np.mean(z**2)),
        spread=float(high - low) / 2,
        coverage_68=coverage[-2],
        coverage_95=coverage[-1],
        levels=CALIBRATION_LEVELS,
        coverage=tuple(coverage[:-2]),
        predicted=tuple(float(np.sqrt(np.mean(std[tenth] ** 2))) for tenth in tenths),
        observed=tuple(float(np.sqrt(np.mean(error[tenth] ** 2))) for tenth in tenths),
    )
