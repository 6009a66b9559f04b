"""Contacts of which only some values are known."""

from typing import Any

import numpy as np

from manytouch.values import Contact, Phase


def contact_with(**known: Any) -> Contact:
    """A contact of 1 mm at the origin, with the given values; the others are not known."""
    others = {
        "id": 1,
        "phase": Phase.MOVE,
        "centre_mm": np.zeros(2),
        "centre_px": np.zeros(2),
        "depth_mm": 1.0,
        "force_N": np.full(3, np.nan),
        "torque_Nmm": np.nan,
        "area_mm2": np.nan,
        "covariance": np.full((8, 8), np.nan),
    }
    return Contact(**(others | known))
