"""A spline of a sheet at rest, whose frames are those of the mechanics of the sheet."""

import numpy as np

from manytouch.values import SheetSpline

FLAT = SheetSpline(
    size_mm=(120.0, 80.0),
    centre_mm=(0.0, 0.0),
    elements=(1, 1),
    is_clamped=True,
    thickness_mm=3.0,
    poisson=0.45,
    coefficient_mm=np.zeros((16, 3)),
    force_over_E_mm2=np.zeros((16, 3)),
    young_MPa=None,
)
