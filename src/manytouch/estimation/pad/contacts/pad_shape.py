"""The displacement of a pad under fitted patches, with what large strains add to the linear response."""

from dataclasses import dataclass

import numpy as np

from manytouch.estimation.pad.pad_model import BondedPadModel
from manytouch.estimation.pad.patch_fit import PadFit, forced
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points3, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadShape:
    """Displacement of the contact face of a pad in one frame, sheet frame, and the forces that cause it.

    Attributes:
        nodal_mm2: (n, 3) nodal forces over E of objects on the pad; a press has z < 0.
        coefficient_mm: (n, 3) spline coefficients of the displacement.
        linear_mm: (n, 3) the same without `large_strain`.
        face_mm: (m, 3) displacement of the contact face over each marker.
    """

    nodal_mm2: Nodal
    coefficient_mm: Nodal
    linear_mm: Nodal
    face_mm: Points3


def large_strain(depth_mm: Scalars, thickness_mm: float) -> Scalars:
    """Depths (n,) of a pad under the loads that would press a linear pad to the given depths (n,).

    A pad becomes stiffer as it becomes thinner: with d the linear depth and h the thickness, a column with
    logarithmic strain has the depth h (1 - exp(-d / h)). Negative depths stay as they are.
    """
    return np.where(depth_mm > 0.0, -thickness_mm * np.expm1(-depth_mm / thickness_mm), depth_mm)


def pad_shape(model: BondedPadModel, fit: PadFit) -> PadShape:
    """The pad under fitted patches."""
    nodal_mm2 = fit.nodal_mm2(model)
    node = np.flatnonzero(nodal_mm2.any(axis=1))
    linear_mm = forced(nodal_mm2, model.face)
    by_parameter = nodal_mm2[node, 2] @ model.depth_by_parameter[:, node]  # symmetric
    linear_mm[:, 2] += fit.sheet[: len(by_parameter)] @ by_parameter
    coefficient_mm = linear_mm.copy()
    coefficient_mm[:, 2] = -large_strain(-coefficient_mm[:, 2], model.thickness_mm)
    return PadShape(
        nodal_mm2=nodal_mm2,
        coefficient_mm=coefficient_mm,
        linear_mm=linear_mm,
        face_mm=model.over_marker.displacement(coefficient_mm),
    )
