"""Fields of a `SheetSpline` at fixed points: displacement of the camera-side face, and pressure."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.values import SheetSpline
from manytouch.values.arrays import Points2, Points3, Scalars

SplineShape = tuple[object, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetFace:
    """Points of the camera-side face, with the basis functions of one patch there.

    Attributes:
        node: (k, 16) nodes of the basis functions that are not 0 at each point.
        weight: (k, 6, 16) see `face_kernels.displace_face`.
        area_mm2: (nodes,) integral of each basis function.
    """

    node: Int64[np.ndarray, "k 16"]
    weight: Float64[np.ndarray, "k 6 16"]
    area_mm2: Float64[np.ndarray, " nodes"]

    def displacement_mm(self, spline: SheetSpline) -> Points3:
        """(k, 3) in the sheet frame; the depth is minus its z."""
        from manytouch.geometry.face_kernels import displace_face

        found_mm = np.empty((len(self.node), 3))
        coefficient_mm = np.ascontiguousarray(spline.coefficient_mm)
        known_mm = spline.pretension_over_E_mm
        pretension_mm = known_mm if np.isfinite(known_mm) else 0.0
        displace_face(
            coefficient_mm,
            self.node,
            self.weight,
            spline.thickness_mm,
            spline.poisson,
            pretension_mm,
            found_mm,
        )
        return found_mm

    def pressure_MPa(self, spline: SheetSpline) -> Scalars:
        """(k,) positive in compression; NaN where Young's modulus is not known.

        The force of a node is spread over the integral of its basis function, so the integral of the
        pressure is the total force, and the pressure is as smooth as the spline.
        """
        if spline.young_MPa is None:
            return np.full(len(self.node), np.nan)
        nodal_MPa = -spline.young_MPa * spline.force_over_E_mm2[:, 2] / self.area_mm2
        return np.asarray(np.einsum("kn,kn->k", self.weight[:, 0], nodal_MPa[self.node]))


def patch_of(spline: SheetSpline) -> SplinePatch:
    """The patch whose nodes have the coefficients of a spline."""
    return SplinePatch(
        size_mm=spline.size_mm,
        elements=spline.elements,
        boundary="clamped" if spline.is_clamped else "soft",
        centre_mm=spline.centre_mm,
        shear_mm2=spline.shear_mm2,
        clamped_end=spline.clamped_end,
    )


def sheet_face(spline: SheetSpline, point_mm: Points2) -> SheetFace:
    """Prepare points (k, 2) of the undeformed sheet; points outside the patch are moved to its outline."""
    patch = patch_of(spline)
    window, points = patch.window(point_mm), patch.at(point_mm)
    slow, fast = window.bending[:, 0], window.bending[:, 1]

    def product(a: int, b: int) -> np.ndarray:
        """(k, 16) derivative a along the slow axis and b along the fast one."""
        return np.asarray((slow[:, a, :, None] * fast[:, b, None, :]).reshape(-1, 16))

    turns = [product(3, 0) + product(1, 2), product(2, 1) + product(0, 3)][:: 1 if patch.is_x_slow else -1]
    fibres = [points.slope_x - spline.tilt_mm2 * turns[0], points.slope_y - spline.tilt_mm2 * turns[1]]
    return SheetFace(
        node=points.node,
        weight=np.ascontiguousarray(
            np.stack([points.value, points.dx, points.dy, points.deflection, *fibres], axis=1)
        ),
        area_mm2=patch.area_mm2,
    )


def spline_shape(spline: SheetSpline) -> SplineShape:
    """What `sheet_face` depends on; splines of equal shape can share its result."""
    return (
        spline.size_mm,
        spline.centre_mm,
        spline.elements,
        spline.is_clamped,
        spline.shear_mm2,
        spline.tilt_mm2,
        spline.clamped_end,
    )
