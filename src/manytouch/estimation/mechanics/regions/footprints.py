"""Footprints of contacts: area, ellipse, shape and outline, with deviations."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull, QhullError
from scipy.special import ndtr

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.regions.outlines import POINT_STDS, polygon_area, region_of, shape_points
from manytouch.values import ContactShape, OutlineRing
from manytouch.values.arrays import Points2, read_only

_SMALLEST_MM = 1e-3
_RIGID_SHARE = 0.5  # probability that a contact which is not seen as a rigid flat face is one
_SHAPES = tuple(ContactShape)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Footprint:
    """The region of a contact. NaN means unknown.

    Attributes:
        area_mm2, area_std_mm2: of the region, and its deviation by the noise and the parameters of the sheet.
        half_major_mm, half_minor_mm, orientation_rad: of the ellipse under uniform pressure with the same
            second moments; NaN where the deviation exceeds the value, or the axes do not differ.
        shape, shape_probability: the most probable shape of the pressure; None and NaN without evidence.
        outline: of the region.
    """

    area_mm2: float
    area_std_mm2: float
    half_major_mm: float
    half_minor_mm: float
    orientation_rad: float
    shape: ContactShape | None
    shape_probability: float
    outline: tuple[OutlineRing, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Footprints:
    """Parameters of footprints; lengths are in pitches.

    Attributes:
        smoothing: standard deviation of the smoothing of a pressure.
        moment_share: deviation of a second moment that was not fitted to the markers, over it.
        line, line_std: a rigid face is a line if its minor half axis is below this; and the deviation of that
            axis, for the probability.
        edge: standard deviation of the edge of a rigid face.
    """

    smoothing: float = 0.5
    moment_share: float = 0.5
    line: float = 0.75
    line_std: float = 0.25
    edge: float = 0.2

    def __call__(self, clusters: Clusters, number: int, pitch_mm: float) -> Footprint:
        """The footprint of one of the clusters."""
        std_mm, centre_mm = self.smoothing * pitch_mm, clusters.centre_mm[number]
        moment_mm2 = clusters.spread_mm2[number]
        own = Ellipse.of(moment_mm2, self._covariance(clusters, number, std_mm))
        if clusters.is_face[number]:
            return self._face(centre_mm, own, clusters.corner_points_mm[number], pitch_mm)
        probability = clusters.shape_probability[number]
        if not np.isfinite(probability).all():
            return _footprint(ContactShape.PATCH, centre_mm, own, std_mm)
        shape = _SHAPES[int(probability.argmax())]
        found = _footprint(shape, centre_mm, own, std_mm)
        patch_mm2, point_mm2 = (_about_area(half_mm, std_mm) for half_mm in (own.half_mm, np.zeros(2)))
        doubt = float(probability[0] * (1.0 - probability[0])) * (patch_mm2 - point_mm2) ** 2
        return replace(
            found,
            area_std_mm2=float(np.sqrt(found.area_std_mm2**2 + doubt)),
            shape=shape,
            shape_probability=float(probability.max()),
        )

    def _covariance(self, clusters: Clusters, number: int, std_mm: float) -> Float64[np.ndarray, "3 3"]:
        """Covariance of the moments xx, xy, yy."""
        fitted = clusters.covariance[number, 3:, 3:] + clusters.sheet_covariance[number, 3:, 3:]
        if np.isfinite(fitted).all():
            return np.asarray(fitted)
        std = self.moment_share * (np.diag(clusters.spread_mm2[number]) + std_mm**2)
        return np.diag([std[0] ** 2, 0.5 * std[0] * std[1], std[1] ** 2])

    def _face(
        self, centre_mm: Float64[np.ndarray, "2"], own: "Ellipse", corner_points_mm: Points2, pitch_mm: float
    ) -> Footprint:
        """A rigid face: the convex hull of where it presses, or a line."""
        own = replace(own, half_std_mm=np.full(2, self.edge * pitch_mm))
        beyond = (own.half_mm[1] / pitch_mm - self.line) / self.line_std
        corner_mm = _hull(corner_points_mm)
        if corner_mm is None or beyond < 0.0:
            found = _footprint(ContactShape.LINE, centre_mm, own, self.smoothing * pitch_mm)
            return replace(found, shape=ContactShape.LINE, shape_probability=float(ndtr(-beyond)))
        found = _footprint(ContactShape.PATCH, centre_mm, own, self.smoothing * pitch_mm)
        border_mm = np.linalg.norm(corner_mm - np.roll(corner_mm, 1, axis=0), axis=1).sum()
        return replace(
            found,
            area_mm2=polygon_area(corner_mm),
            area_std_mm2=float(border_mm) * self.edge * pitch_mm,
            outline=(OutlineRing(point_mm=read_only(corner_mm)),),
            shape=ContactShape.PATCH,
            shape_probability=float(ndtr(beyond)),
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ellipse:
    """The ellipse under uniform pressure with some second moments.

    Attributes:
        half_mm, half_std_mm: (2,) half axes, the larger one first, and their deviations.
        angle_rad: of the larger one, in (-pi/2, pi/2].
    """

    half_mm: Float64[np.ndarray, "2"]
    half_std_mm: Float64[np.ndarray, "2"]
    angle_rad: float

    @staticmethod
    def of(moment_mm2: Float64[np.ndarray, "2 2"], covariance_mm4: Float64[np.ndarray, "3 3"]) -> "Ellipse":
        """The ellipse of second moments (2, 2) with the covariance (3, 3) of xx, xy, yy."""
        size, axes = np.linalg.eigh(moment_mm2)
        size, axes = np.maximum(size[::-1], 0.0), axes[:, ::-1]
        angle_rad = float(np.arctan2(axes[1, 0], axes[0, 0]))
        weight = np.array([axes[0] ** 2, 2.0 * axes[0] * axes[1], axes[1] ** 2])
        variance = (covariance_mm4 @ weight * weight).sum(axis=0)
        wider = np.sqrt(size + np.sqrt(np.maximum(variance, 0.0)))  # finite also where the size is 0
        root = np.sqrt(size)
        return Ellipse(
            half_mm=2.0 * root,
            half_std_mm=np.maximum(2.0 * (wider - root), _SMALLEST_MM),
            angle_rad=angle_rad - np.pi * float(np.ceil(angle_rad / np.pi - 0.5)),
        )

    @property
    def frame(self) -> Float64[np.ndarray, "2 2"]:
        """Rows: the directions of the axes."""
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return np.array([[c, s], [-s, c]])


def _about_area(half_mm: Float64[np.ndarray, "2"], std_mm: float) -> float:
    """About the area of the region of an ellipse, for deviations; exact for a point."""
    first, second = np.hypot(half_mm, POINT_STDS * std_mm)
    return float(np.pi * (first * second))


def _footprint(
    shape: ContactShape, centre_mm: Float64[np.ndarray, "2"], own: Ellipse, std_mm: float
) -> Footprint:
    """The footprint of a pressure of some shape with the ellipse of its moments, without the shape's name."""
    half_mm, half_std_mm = own.half_mm, own.half_std_mm
    area_mm2, rings = region_of(shape_points(shape, half_mm), std_mm)
    about_mm2 = _about_area(half_mm, std_mm)
    is_point = shape is ContactShape.POINT
    change_mm2 = [
        0.0 if is_point else _about_area(half_mm + half_std_mm * side, std_mm) - about_mm2
        for side in np.eye(2)
    ]
    # the region of a rigid flat face is its footprint, that of all other contacts the smoothed pressure
    doubt_mm2 = np.sqrt(_RIGID_SHARE) * abs(area_mm2 - np.pi * float(np.prod(half_mm)))
    is_known = half_mm > half_std_mm
    differ = half_mm[0] - half_mm[1] > np.hypot(half_std_mm[0], half_std_mm[1])
    return Footprint(
        area_mm2=area_mm2,
        area_std_mm2=float(np.linalg.norm([*change_mm2, doubt_mm2])),
        half_major_mm=float(half_mm[0]) if is_known[0] else np.nan,
        half_minor_mm=float(half_mm[1]) if is_known[1] else np.nan,
        orientation_rad=own.angle_rad if is_known[0] and differ else np.nan,
        shape=None,
        shape_probability=np.nan,
        outline=tuple(
            OutlineRing(
                point_mm=read_only(np.ascontiguousarray(centre_mm + ring @ own.frame)), is_hole=number > 0
            )
            for number, ring in enumerate(rings)
        ),
    )


def _hull(point_mm: Points2) -> Float64[np.ndarray, "_ 2"] | None:
    """Corners (k, 2) of the convex hull, from x to y; None if the points lie on a line."""
    try:
        return np.ascontiguousarray(point_mm[ConvexHull(point_mm).vertices])
    except (QhullError, ValueError):
        return None
