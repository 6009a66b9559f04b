"""Which measured displacements to believe: a marker that moved unlike its neighbours is an outlier."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from manytouch.values.arrays import Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OutlierGate:
    """Weights from 0 to 1 by how far a marker's innovation lies from the median of its neighbours'.

    The innovation is what is measured minus what was expected. A press moves neighbours alike, up to the
    spread of their own innovations; an outlier stands alone. Tukey's biweight (A. E. Beaton and J. W.
    Tukey 1974, doi:10.1080/00401706.1974.10489171) of the distance over its scale.

    Attributes:
        stds: the scale is this many standard deviations of the centres,
        spreads: and in addition this many times the median distance of the neighbours' own innovations
            from their median.
    """

    stds: float = 6.0
    spreads: float = 5.0

    def __call__(
        self, innovation_px: Points2, std_px: Scalars, is_seen: Mask, neighbour: Int64[np.ndarray, "m k"]
    ) -> Scalars:
        """(m,) weights; 0 for markers that are not seen.

        Args:
            innovation_px: (m, 2), anything where not seen.
            std_px: (m,) of the centres along an axis.
            is_seen: (m,).
            neighbour: (m, k) the markers around each one.
        """
        from manytouch.estimation.kernels import neighbour_agreement

        return np.asarray(
            neighbour_agreement(innovation_px, std_px, is_seen, neighbour, self.stds, self.spreads)
        )
