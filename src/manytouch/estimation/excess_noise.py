"""Noise of marker images that their detection does not know of."""

from dataclasses import dataclass

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.geometry.neighbours import Neighbours
from manytouch.medians import median
from manytouch.values.arrays import Mask, Points2, Scalars

_MEDIAN_CHI2 = 0.4549
"""Median of the square of a normally distributed number, over its variance."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExcessNoise:
    """Variance that marker images have in excess of the one that is assumed.

    It is found where the residuals of the fits show more: those of near markers differ by more than their
    variances explain, while an error of the model is about the same at near markers. The median over all
    markers does not depend on what happens under a few contacts.

    Attributes:
        share: share of a new value where it is less than the one before. A larger one holds at once.
        untouched_share: the same where nothing touches: what is then less was an error of the model under a
            contact, or has ended.
    """

    share: float = 0.1
    untouched_share: float = 0.5

    def after_fit(
        self,
        excess_px2: float,
        residual_px: Points2,
        variance_px2: Scalars,
        is_used: Mask,
        neighbours: Neighbours,
        *,
        is_touched: bool = True,
    ) -> float:
        """The excess along an axis after a fit.

        Args:
            excess_px2: that was assumed in this frame.
            residual_px: (m, 2) of the fit; any value where not used.
            variance_px2: (m,) assumed along an axis, the excess included.
            is_used: (m,) markers with a residual.
            neighbours: of each marker.
            is_touched: whether the fit has contacts.
        """
        more_px2 = np.empty(2 * len(is_used))
        count = unexplained_variances(residual_px, variance_px2, is_used, neighbours.index, more_px2)
        if count == 0:
            return excess_px2
        now_px2 = max(excess_px2 + median(more_px2[:count]), 0.0)
        smaller = self.share if is_touched else self.untouched_share
        share = 1.0 if now_px2 > excess_px2 else smaller
        return excess_px2 + share * (now_px2 - excess_px2)


@kernel()
@no_type_check
def unexplained_variances(
    residual_px: np.ndarray,
    variance_px2: np.ndarray,
    is_used: np.ndarray,
    neighbour: np.ndarray,
    more_px2: np.ndarray,
) -> int:
    """Estimates, one along each axis of each used marker, of the variance in excess of the assumed one.

    They follow from the difference of the residual of a marker from the mean of those of its neighbours.

    Args:
        residual_px: (m, 2), any value where not used.
        variance_px2: (m,) assumed along an axis.
        is_used: (m,) markers with a residual.
        neighbour: (m, k) indices of the neighbours.
        more_px2: (2 m,) gets the estimates, each right in the median; the rest is left as it is.

    Returns:
        The number of estimates.
    """
    number = 0
    for m in range(len(is_used)):
        if not is_used[m]:
            continue
        count, x, y = 0, 0.0, 0.0
        for k in neighbour[m]:
            if is_used[k]:
                count += 1
                x += residual_px[k, 0]
                y += residual_px[k, 1]
        least = max(count, 1)
        x, y = residual_px[m, 0] - x / least, residual_px[m, 1] - y / least
        # the variance of the difference is (count + 1) / count times that of a marker
        scale = least / ((least + 1.0) * _MEDIAN_CHI2)
        more_px2[number] = x * x * scale - variance_px2[m]
        more_px2[number + 1] = y * y * scale - variance_px2[m]
        number += 2
    return number
