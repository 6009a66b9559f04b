"""Markers on the sheet: their displacement, their images and the derivatives of both."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.camera import view_of
from manytouch.geometry.spline.patch import Nodal, PointBasis, PointWindow, SplinePatch
from manytouch.mechanics.markers import kernels as marker_kernels
from manytouch.mechanics.markers.discs import DiscPlaces, centroids, disc_places
from manytouch.mechanics.markers.projection import CameraModel, camera_model
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera
from manytouch.values.arrays import Mask, read_only_view


@dataclass(frozen=True, eq=False, kw_only=True)
class Face:
    """Points of the camera-side face, or at a height above it.

    Attributes:
        shell: the sheet.
        point_mm: (k, 2) places at rest, sheet frame.
        height_mm: distance of the points from the face, towards the camera.
    """

    shell: Shell
    point_mm: Float64[np.ndarray, "k 2"]
    height_mm: float = 0.0

    @cached_property
    def basis(self) -> PointBasis:
        """Nodes and basis functions at the points."""
        return self.shell.patch.basis(self._window)

    @property
    def node(self) -> Int64[np.ndarray, "k 16"]:
        """Nodes of `basis`."""
        return self.shell.patch.nodes_of(self._window)

    def displacement(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "k 3"]:
        """Displacement (mm) in the sheet frame; the depth is minus its z."""
        out = np.empty((len(self.point_mm), 3))
        spline = _spline_field(self.shell.patch, coefficient_mm)
        marker_kernels.face_displacement(spline, self._places, _layer(self.shell, self.height_mm), out)
        return out

    def derivative(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "k 3 16 3"]:
        """Derivative of `displacement` by the coefficients of `basis.node`."""
        return self._derivative(coefficient_mm, self._places)

    def derivative_at(
        self, number: Int64[np.ndarray, " n"], coefficient_mm: Nodal
    ) -> Float64[np.ndarray, "n 3 16 3"]:
        """`derivative` at the points with these numbers."""
        return self._derivative(
            coefficient_mm, marker_kernels.Places(*(part[number] for part in self._places))
        )

    def _derivative(
        self, coefficient_mm: Nodal, places: marker_kernels.Places
    ) -> Float64[np.ndarray, "n 3 16 3"]:
        out = np.empty((len(places.first), 3, 16, 3))
        spline = _spline_field(self.shell.patch, coefficient_mm)
        marker_kernels.face_derivatives(spline, places, _layer(self.shell, self.height_mm), out)
        return out

    @cached_property
    def _window(self) -> PointWindow:
        return self.shell.patch.window(self.point_mm)

    @cached_property
    def _places(self) -> marker_kernels.Places:
        return _places(self._window)


@dataclass(frozen=True, eq=False, kw_only=True)
class MarkerImages:
    """Images of round markers on the camera-side face, or on tips at a height above it.

    Attributes:
        shell: the sheet.
        camera: in front of the sheet; with several views, a marker has the image of one (`of_views`).
        rest_mm: (m, 3) centres at rest, sheet frame.
        radius_mm: (m,) of each marker.
        height_mm: distance of the markers from the face, towards the camera.
    """

    shell: Shell
    camera: Camera
    rest_mm: Float64[np.ndarray, "m 3"]
    radius_mm: Float64[np.ndarray, " m"]
    height_mm: float = 0.0

    def changed(self, *, shell: Shell | None = None, camera: Camera | None = None) -> "MarkerImages":
        """The same markers on another sheet, or in front of another camera.

        On the same patch they have the same outlines, 4 kB for each marker, which are kept once.
        """
        other = replace(self, shell=shell or self.shell, camera=camera or self.camera)
        if other.shell.patch is self.shell.patch:
            vars(other)["_outlines"] = self._outlines  # where `cached_property` keeps it
        return other

    def displacement_px(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 2"]:
        """Displacement of the centroids of the marker images from rest."""
        moved: Float64[np.ndarray, "m 2"] = self._centroid_px(coefficient_mm) - self._rest_px
        return moved

    def displacement_mm(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 3"]:
        """Displacement of the camera-side face at the markers, sheet frame."""
        return self.face.displacement(coefficient_mm)

    def derivative_px(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 2 16 3"]:
        """Derivative of the images of the markers' centres by the coefficients of `tips.basis.node`, px/mm.

        It approximates the derivative of `displacement_px`: the distance of the centroid from the image of
        the centre, about one pixel at most, is taken as constant.
        """
        out = np.empty((len(self.rest_mm), 2, 16, 3))
        position = self.rest_mm + self.tips.displacement(coefficient_mm)
        derivative = self.tips.derivative(coefficient_mm)
        for camera, chosen in zip(self._cameras, self.of_views, strict=True):
            if len(self._cameras) == 1:
                marker_kernels.centre_derivatives(position, camera, derivative, out)
                break
            part = np.empty((int(chosen.sum()), 2, 16, 3))
            marker_kernels.centre_derivatives(position[chosen], camera, derivative[chosen], part)
            out[chosen] = part
        return out

    @cached_property
    def of_views(self) -> tuple[Mask, ...]:
        """(m,) for each camera: whether the image of a marker is that of this camera."""
        number = view_of(self.camera, self.rest_mm)
        return tuple(number == index for index in range(len(self._cameras)))

    @cached_property
    def part_of_views(self) -> tuple[Mask | slice, ...]:
        """Indices of the markers of each camera: `of_views`, or a slice of all of them."""
        return self.of_views if len(self.of_views) > 1 else (slice(None),)

    @cached_property
    def face(self) -> Face:
        """The camera-side face at the markers."""
        return Face(shell=self.shell, point_mm=np.ascontiguousarray(self.rest_mm[:, :2]))

    @cached_property
    def tips(self) -> Face:
        """The markers' centres."""
        return Face(shell=self.shell, point_mm=self.face.point_mm, height_mm=self.height_mm)

    @cached_property
    def first(self) -> Int64[np.ndarray, "m 2"]:
        """(slow, fast) of the first of the 4 x 4 nodes of each marker."""
        return self.shell.patch.window(self.face.point_mm).first

    def _centroid_px(self, coefficient_mm: Nodal) -> Float64[np.ndarray, "m 2"]:
        out = np.empty((len(self.rest_mm), 2))
        spline, layer = _spline_field(self.shell.patch, coefficient_mm), _layer(self.shell, self.height_mm)
        for camera, chosen, discs in zip(self._cameras, self.of_views, self._discs, strict=True):
            if len(self._cameras) == 1:
                centroids(spline, discs, layer, camera, out)
                break
            part = np.empty((int(chosen.sum()), 2))
            centroids(spline, discs, layer, camera, part)
            out[chosen] = part
        return out

    @cached_property
    def _cameras(self) -> tuple[CameraModel, ...]:
        views = self.camera.views
        return tuple(camera_model(view.in_frame) for view in views) or (camera_model(self.camera),)

    @cached_property
    def _discs(self) -> tuple[DiscPlaces, ...]:
        """The markers of each camera."""
        discs = self._outlines
        return (discs,) if len(self._cameras) == 1 else tuple(discs.of(chosen) for chosen in self.of_views)

    @cached_property
    def _outlines(self) -> DiscPlaces:
        return disc_places(self.shell.patch, self.rest_mm, self.radius_mm)

    @cached_property
    def _rest_px(self) -> Float64[np.ndarray, "m 2"]:
        return self._centroid_px(np.zeros((self.shell.patch.node_count, 3)))


def _places(window: PointWindow) -> marker_kernels.Places:
    return marker_kernels.Places(window.first, window.plane, window.bending)


def _spline_field(patch: SplinePatch, coefficient_mm: Nodal) -> marker_kernels.SplineField:
    return marker_kernels.SplineField(read_only_view(coefficient_mm), patch.shape[1], patch.is_x_slow)


def _layer(shell: Shell, height_mm: float) -> marker_kernels.Layer:
    return marker_kernels.Layer(
        float(shell.thickness_mm),
        float(shell.poisson),
        float(shell.pretension_over_E_mm),
        float(height_mm),
        float(shell.shear_mm2),
        float(shell.tilt_mm2),
    )
