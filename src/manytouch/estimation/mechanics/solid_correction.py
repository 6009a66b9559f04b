"""Depth of the camera-side face of a solid sheet minus that of the shell model.

A sheet that is as thick as its dents are wide differs from a shell in two places
(docs/derivations/inversion.md, "Solid correction"): under a contact, where the curvature of its face is
larger than that of a bent plate, and along a clamp, where a solid shears while the slope of a shell is 0.
Both differences are small functions of lengths in thicknesses, fitted to 3-D finite elements.
"""

from dataclasses import dataclass

import numpy as np

from manytouch.estimation.mechanics.force_clusters import Clusters
from manytouch.estimation.mechanics.sheet_model import InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SolidCorrection:
    """Parameters of the correction; lengths are in thicknesses t.

    Attributes:
        dent, dent_width: height over F / (E t), and standard deviation, of the bell under a force F.
        ring, ring_width: the same of the wider bell that is subtracted.
        spread: variance of a load along an axis, over t^2, up to which it acts as a point force.
        clamp: depth at a clamp, over t times the slope of the sheet.
        clamp_reach: distance within which `clamp` decays by the factor e.
    """

    dent: float = 0.56
    dent_width: float = 0.41
    ring: float = 0.226
    ring_width: float = 0.806
    spread: float = 1.0
    clamp: float = 0.45
    clamp_reach: float = 1.0

    def depth_under_contacts(self, model: InversionModel, clusters: Clusters, place_mm: Points2) -> Scalars:
        """(k,) additional depth (mm) at places (k, 2) under clusters; 0 where the sheet was assumed."""
        if model.is_nominal or len(clusters) == 0:
            return np.zeros(len(place_mm))
        t = model.thickness_mm
        away2 = ((place_mm[:, None] - clusters.centre_mm) ** 2).sum(axis=2)
        broad = np.maximum(0.5 * np.trace(clusters.spread_mm2, axis1=1, axis2=2) - self.spread * t**2, 0.0)
        bells = np.zeros_like(away2)
        for height, width in ((self.dent, self.dent_width), (-self.ring, self.ring_width)):
            own = (width * t) ** 2
            bells += height * own / (own + broad) * np.exp(-0.5 * away2 / (own + broad))
        return np.asarray(bells @ clusters.normal_mm2 / t)

    def depth_along_clamp(self, model: InversionModel, coefficient_mm: Nodal) -> Scalars:
        """(m,) additional depth in mm at the markers, by the clamp; 0 where the sheet was assumed."""
        patch, points = model.patch, model.dots.face.basis
        if model.is_nominal or patch.boundary != "clamped":
            return np.zeros(len(points.node))
        w_mm = coefficient_mm[points.node, 2]
        slope = np.hypot((points.dx * w_mm).sum(axis=1), (points.dy * w_mm).sum(axis=1))
        off_mm = np.abs(model.layout.rest_mm[:, :2] - np.array(patch.centre_mm))
        left_mm = (0.5 * np.array(patch.size_mm) - off_mm).min(axis=1)
        fade = np.exp(-np.maximum(left_mm, 0.0) / (self.clamp_reach * model.thickness_mm))
        return np.asarray(self.clamp * model.thickness_mm * slope * fade)
