"""Whether markers lie on one line, from which no pose of the camera follows."""

import numpy as np

from manytouch.values.arrays import Points2

_WIDTH_SHARE = 0.2
"""Width of a line of markers, in smallest distances of two: a choice."""


def are_on_line(points_mm: Points2, min_distance_mm: float) -> bool:
    """Whether points (n, 2) lie on one line, as fewer than 3 always do."""
    if len(points_mm) < 3:
        return True
    across = np.linalg.eigh(np.cov(points_mm.T))[1][:, 0]
    return float(np.ptp(points_mm @ across)) <= _WIDTH_SHARE * min_distance_mm
