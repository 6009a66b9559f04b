"""The shape of the sheet."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.values.arrays import Covariances3, Points3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetSpline:
    """The shape of the sheet's middle surface and what holds it there, by coefficients of cubic B-splines.

    Attributes:
        size_mm, centre_mm: of the rectangle that they describe, along x and y.
        elements: along x and y.
        is_clamped: is the outline held? Else the sheet goes on beyond it.
        thickness_mm, poisson: of the sheet, for its faces.
        coefficient_mm: (nodes, 3) of the displacement; `mechanics.SplinePatch` knows their order.
        force_over_E_mm2: (nodes, 3) forces on the sheet over Young's modulus.
        young_MPa: None when not known.
    """

    size_mm: tuple[float, float]
    centre_mm: tuple[float, float]
    elements: tuple[int, int]
    is_clamped: bool
    thickness_mm: float
    poisson: float
    coefficient_mm: Float64[np.ndarray, "nodes 3"]
    force_over_E_mm2: Float64[np.ndarray, "nodes 3"]
    young_MPa: float | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surface:
    """The sheet's camera-side face at the markers; `manytouch.geometry.sampling` gives it anywhere else.

    Sheet frame: z out of the sensor, so a press has displacement z < 0 and depth = -z > 0.
    Lengths are in the sensor's unit (mm, or pitches when the sensor has no scale).

    Attributes:
        position_mm: (m, 3) rest position plus displacement.
        displacement_mm: (m, 3) from rest; NaN where not known.
        covariance_mm2: (m, 3, 3) of the displacement; NaN where not known.
        spline: shape and forces everywhere, from methods that know them.
        status: "ok", or why this surface should not be trusted.
    """

    position_mm: Points3
    displacement_mm: Points3
    covariance_mm2: Covariances3
    spline: SheetSpline | None = None
    status: str = "ok"
