"""The value of a contact, from estimates over E and its footprint."""

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.regions.footprints import Footprint
from manytouch.values import ESTIMATES, Contact, Phase
from manytouch.values.arrays import read_only

_AREA = ESTIMATES.index("area")
_FORCES = [ESTIMATES.index(name) for name in ("shear_x", "shear_y", "normal_force", "torque")]


def contact_of(
    footprint: Footprint,
    covariance: Float64[np.ndarray, "8 8"],
    *,
    centre_mm: Float64[np.ndarray, "2"],
    centre_px: Float64[np.ndarray, "2"],
    depth_mm: float,
    force_mm2: Float64[np.ndarray, "3"],
    torque_mm3: float,
    young_MPa: float | None,
) -> Contact:
    """A contact without identity (id -1). An area that is less than its deviation is not known (NaN).

    Args:
        footprint: of the contact.
        covariance: of `ESTIMATES`, forces over E.
        centre_mm, centre_px, depth_mm: see `Contact`.
        force_mm2: of the object on the sheet, over E, sheet frame; a press has z < 0.
        torque_mm3: about z, over E.
        young_MPa: E; None gives forces and their deviations that are not known (NaN).
    """
    area_mm2 = footprint.area_mm2
    is_unclear = bool(covariance[_AREA, _AREA] > area_mm2**2)
    if is_unclear:
        area_mm2 = np.nan
        covariance = covariance.copy()
        covariance[_AREA, :] = covariance[:, _AREA] = np.nan
    young = np.nan if young_MPa is None else young_MPa
    unit = np.ones(len(ESTIMATES))
    unit[_FORCES] = young
    return Contact(
        id=-1,
        phase=Phase.MOVE,
        centre_mm=read_only(centre_mm.copy()),
        centre_px=read_only(centre_px.copy()),
        depth_mm=depth_mm,
        force_N=read_only(young * force_mm2),
        torque_Nmm=float(young * torque_mm3),
        area_mm2=area_mm2,
        covariance=read_only(covariance * np.outer(unit, unit)),
        normal_force_over_E_mm2=-float(force_mm2[2]),
        shear_over_E_mm2=(float(force_mm2[0]), float(force_mm2[1])),
        half_major_mm=footprint.half_major_mm,
        half_minor_mm=footprint.half_minor_mm,
        orientation_rad=footprint.orientation_rad,
        shape=footprint.shape,
        shape_probability=footprint.shape_probability,
        outline=None if is_unclear else footprint.outline,
    )
