"""The shape of the sheet."""

from dataclasses import dataclass

from manytouch.values.arrays import Covariances3, Points3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surface:
    """The sheet's camera-side face at the markers; `manytouch.geometry.sampling` gives it anywhere else.

    Sheet frame: z out of the sensor, so a press has displacement z < 0 and depth = -z > 0.
    Lengths are in the sensor's unit (mm, or pitches when the sensor has no scale).

    Attributes:
        position_mm: (m, 3) rest position plus displacement.
        displacement_mm: (m, 3) from rest; NaN where not known.
        covariance_mm2: (m, 3, 3) of the displacement; NaN where not known.
        status: "ok", or why this surface should not be trusted.
    """

    position_mm: Points3
    displacement_mm: Points3
    covariance_mm2: Covariances3
    status: str = "ok"
