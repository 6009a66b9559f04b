"""Weights of measured displacements: a marker that moves unlike its neighbours is an outlier."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from manytouch.values.arrays import Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OutlierGate:
    """Weights from 0 to 1 by the distance of a marker's innovation from the median of its neighbours'.

    The innovation is the measured minus the expected displacement. A press displaces neighbours alike, up to
    the spread of their innovations; an outlier is isolated. The weight is Tukey's biweight (A. E. Beaton and
    J. W. Tukey 1974, doi:10.1080/00401706.1974.10489171) of the distance over a scale, which is the sum of
    two terms.

    Attributes:
        stds: first term, in standard deviations of the centres.
        spreads: second term, in median distances of the neighbours' innovations from their median.
    """

    stds: float = 6.0
    spreads: float = 5.0

    def __call__(
        self, innovation_px: Points2, std_px: Scalars, is_seen: Mask, neighbour: Int64[np.ndarray, "m k"]
    ) -> Scalars:
        """Weights (m,); 0 for markers that are not seen.

        Args:
            innovation_px: (m, 2), any value where not seen.
            std_px: (m,) standard deviations of the centres along an axis.
            is_seen: (m,) markers with an image in this frame.
            neighbour: (m, k) numbers of the markers around each one.
        """
        from manytouch.estimation.kernels import neighbour_agreement

        return np.asarray(
            neighbour_agreement(innovation_px, std_px, is_seen, neighbour, self.stds, self.spreads)
        )
