"""What a fit of patches of pressure to the markers results in."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

PAIR_PARAMETERS = 7
"""Number of parameters of two round patches of one size: the forces and centres, and the size."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PatchFit:
    """A uniform elliptical patch of pressure, or a rigid face, that was fitted to the markers.

    Attributes:
        misfit: of the patch.
        force_mm2: normal force over E.
        centre_mm: (2,) undeformed coordinates.
        spread_mm2: (2, 2) second moment of the pressure about the centre.
        covariance: (6, 6) of force, x, y, and the moments xx, xy, yy by the noise; it is scaled by the mean
            misfit.
        nodal_mm2: (n,) its forces on the nodes of the evidence, over E, positive in compression.
        outline_mm: (k, 2) outline of a rigid face: 4 corners of a bar, 24 points of an elliptic face; (0, 2)
            of an even ellipse.
    """

    misfit: float
    force_mm2: float
    centre_mm: Float64[np.ndarray, "2"]
    spread_mm2: Float64[np.ndarray, "2 2"]
    covariance: Float64[np.ndarray, "6 6"]
    nodal_mm2: Float64[np.ndarray, " n"]
    outline_mm: Float64[np.ndarray, "_ 2"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PairFit:
    """Two round patches of pressure of one size that were fitted to the markers.

    Attributes:
        misfit: of the patches.
        force_mm2: (2,) normal forces over E.
        centre_mm: (2, 2) undeformed coordinates.
        deviation_mm: standard deviation of the pressure of each along an axis.
        covariance: (2, 3, 3) of force, x, y of each, as that of `PatchFit`.
        nodal_mm2: (n,) the forces of both on the nodes of the evidence, over E, positive in compression.
    """

    misfit: float
    force_mm2: Float64[np.ndarray, "2"]
    centre_mm: Float64[np.ndarray, "2 2"]
    deviation_mm: float
    covariance: Float64[np.ndarray, "2 3 3"]
    nodal_mm2: Float64[np.ndarray, " n"]
