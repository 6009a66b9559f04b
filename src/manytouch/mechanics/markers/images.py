"""The dots on the sheet: where they are on it, and where they show in the image."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.spline.patch import Nodal, PointBasis
from manytouch.mechanics.markers import kernels as dot_kernels
from manytouch.mechanics.markers.projection import parameters
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera

OUTLINE_POINTS = 12
OUTLINE_RADIUS = float(np.sqrt(3.0 / (2.0 + np.cos(2.0 * np.pi / OUTLINE_POINTS))))
"""The polygon with this radius has the second moments of the unit disc (1.0231)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Face:
    """Points of the camera-side face, or standing off it.

    Attributes:
        shell: the sheet.
        point_mm: (k, 2) undeformed places.
        height_mm: how far the points stand off the face, towards the camera.
    """

    shell: Shell
    point_mm: Float64[np.ndarray, "k 2"]
    height_mm: float = 0.0

    @cached_property
    def basis(self) -> PointBasis:
        """Nodes and basis functions at the points."""
        return self.shell.patch.at(self.point_mm)

    def displacement(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "k 3"]:
        """Displacement (mm) in the sheet frame; the depth is minus its z."""
        out = np.empty((len(self.point_mm), 3))
        dot_kernels.face_displacement(coefficient_mm, *self._arguments, out)
        return out

    def derivative(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "k 3 16 3"]:
        """Derivative of `displacement` with respect to the coefficients of `basis.node`."""
        out = np.empty((len(self.point_mm), 3, 16, 3))
        dot_kernels.face_derivatives(coefficient_mm, *self._arguments, out)
        return out

    @cached_property
    def _arguments(self) -> tuple[object, ...]:
        patch = self.shell.patch
        first, table = patch.window(self.point_mm)
        sheet = (self.shell.thickness_mm, self.shell.poisson, self.height_mm, self.shell.shear_mm2)
        return (patch.shape[1], first, table, patch.is_x_slow, sheet)


@dataclass(frozen=True, eq=False, kw_only=True)
class Dots:
    """Round dots on the camera-side face (or on tips that stand off it) before a camera.

    Attributes:
        shell: the sheet they are on.
        camera: what looks at them.
        rest_mm: (m, 3) their centres at rest, in the sheet frame.
        radius_mm: (m,) of each.
        height_mm: how far they stand off the face.
    """

    shell: Shell
    camera: Camera
    rest_mm: Float64[np.ndarray, "m 3"]
    radius_mm: Float64[np.ndarray, " m"]
    height_mm: float = 0.0

    def displacement_px(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 2"]:
        """How far the centroids of the dots' images lie from where they are at rest."""
        moved: Float64[np.ndarray, "m 2"] = self._centroid_px(coefficient_mm) - self._rest_px
        return moved

    def displacement_mm(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 3"]:
        """Displacement of the sheet's camera-side face at the dots."""
        return self.face.displacement(coefficient_mm)

    def derivative_px(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 2 16 3"]:
        """Derivative of the dots' centres in the image with respect to the coefficients at `tips.basis.node`.

        It stands for the derivative of `displacement_px`: the centroid's distance from the centre's
        image (at most about a pixel) is held fixed in it.
        """
        out = np.empty((len(self.rest_mm), 2, 16, 3))
        position = self.rest_mm + self.tips.displacement(coefficient_mm)
        derivative = self.tips.derivative(coefficient_mm)
        dot_kernels.centre_derivatives(position, self._camera, derivative, out)
        return out

    @cached_property
    def face(self) -> Face:
        """The camera-side face at the dots."""
        return Face(shell=self.shell, point_mm=np.ascontiguousarray(self.rest_mm[:, :2]))

    @cached_property
    def tips(self) -> Face:
        """The dots' centres."""
        return Face(shell=self.shell, point_mm=self.face.point_mm, height_mm=self.height_mm)

    @cached_property
    def first(self) -> Int64[np.ndarray, "m 2"]:
        """(slow, fast) of the first of the 4 x 4 nodes of each dot."""
        first, _ = self.shell.patch.window(self.face.point_mm)
        return first

    def _centroid_px(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 2"]:
        out = np.empty((len(self.rest_mm), 2))
        dot_kernels.centroids(coefficient_mm, *self._arguments, out)
        return out

    @cached_property
    def _camera(self) -> np.ndarray:
        return parameters(self.camera)

    @cached_property
    def _arguments(self) -> tuple[object, ...]:
        angle = 2.0 * np.pi / OUTLINE_POINTS * np.arange(OUTLINE_POINTS)
        circle = OUTLINE_RADIUS * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(OUTLINE_POINTS)])
        edge_mm = self.rest_mm[:, None] + self.radius_mm[:, None, None] * circle
        patch = self.shell.patch
        first, table = patch.window(self.face.point_mm)
        edge_first, edge_table = patch.window(edge_mm[..., :2].reshape(-1, 2))
        shape = edge_mm.shape[:2]
        sheet = (self.shell.thickness_mm, self.shell.poisson, self.height_mm, self.shell.shear_mm2)
        return (
            patch.shape[1],
            first,
            table,
            edge_first.reshape(*shape, 2),
            edge_table.reshape(*shape, 2, 4, 4),
            edge_mm,
            patch.is_x_slow,
            sheet,
            self._camera,
        )

    @cached_property
    def _rest_px(self) -> Float64[np.ndarray, "m 2"]:
        return self._centroid_px(np.zeros((self.shell.patch.node_count, 3)))
