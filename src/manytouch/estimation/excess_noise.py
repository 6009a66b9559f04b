"""Noise of marker images that their detection does not know of."""

from dataclasses import dataclass

import numpy as np

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
    """

    share: float = 0.1

    def after_fit(
        self,
        excess_px2: float,
        residual_px: Points2,
        variance_px2: Scalars,
        is_used: Mask,
        neighbours: Neighbours,
    ) -> float:
        """The excess along an axis after a fit.

        Args:
            excess_px2: that was assumed in this frame.
            residual_px: (m, 2) of the fit; any value where not used.
            variance_px2: (m,) assumed along an axis, the excess included.
            is_used: (m,) markers with a residual.
            neighbours: of each marker.
        """
        near = is_used[neighbours.index]
        count = np.maximum(near.sum(axis=1), 1)[:, None]
        mean_px = np.einsum("mk,mkc->mc", near, residual_px[neighbours.index]) / count
        rough_px2 = (residual_px - mean_px) ** 2 * (count / (count + 1.0))
        # half of the squares are less than the median of their distribution if the variances are right
        more_px2 = (rough_px2 / _MEDIAN_CHI2 - variance_px2[:, None])[is_used]
        now_px2 = max(excess_px2 + float(median(more_px2.ravel())), 0.0)
        share = 1.0 if now_px2 > excess_px2 else self.share
        return excess_px2 + share * (now_px2 - excess_px2)
