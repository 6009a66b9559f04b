"""Measurements at points that a user chose: depth, distance, and the profile between two."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from manytouch.geometry.surface_sampling import SurfaceSampler, sampler_at
from manytouch.sinks.viewer.update_format import number
from manytouch.values import Layout, Surface
from manytouch.values.arrays import Points2

PROFILE_POINTS = 121
DIGITS = 7
"""Decimals of lengths in mm: as many as the float32 of the drawn surface has."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Measurement:
    """One or two points of the undeformed sheet, measured in every frame.

    Attributes:
        point_mm: (1, 2) or (2, 2) the points.
        at_points: evaluates surfaces there.
        along: evaluates them at `PROFILE_POINTS` even steps from the first point to the second; None for one
            point.
    """

    point_mm: Points2
    at_points: SurfaceSampler
    along: SurfaceSampler | None

    def __call__(self, surface: Surface) -> dict[str, Any]:
        """The measurement of a surface as plain numbers; None where not known."""
        displacement_mm = self.at_points.displacement(surface)
        std_mm = self.at_points.depth_std(surface)
        found: dict[str, Any] = {
            "points": [
                {"x_mm": number(x), "y_mm": number(y), "depth_mm": _length(depth), "std_mm": _length(std)}
                for (x, y), depth, std in zip(self.point_mm, -displacement_mm[:, 2], std_mm, strict=True)
            ]
        }
        if self.along is not None:
            found |= self._distances(surface, displacement_mm)
            found["profile"] = {
                "length_mm": _length(float(np.linalg.norm(self.point_mm[1] - self.point_mm[0]))),
                "depth_mm": [_length(value) for value in self.along.depth(surface)],
                "std_mm": [_length(value) for value in self.along.depth_std(surface)],
            }
        return found

    def _distances(self, surface: Surface, displacement_mm: np.ndarray) -> dict[str, Any]:
        """Distances between the two points: on the sheet at rest, and in space in this frame."""
        position_mm = np.column_stack([self.point_mm, np.zeros(2)]) + displacement_mm
        difference_mm = position_mm[1] - position_mm[0]
        length_mm = float(np.linalg.norm(difference_mm))
        direction = difference_mm / length_mm if length_mm > 0 else np.zeros(3)
        std_mm = self.at_points.std_along(surface, direction)
        return {
            "distance_mm": _length(length_mm),
            "distance_std_mm": _length(float(np.hypot(*std_mm))),
            "rest_distance_mm": _length(float(np.linalg.norm(self.point_mm[1] - self.point_mm[0]))),
            "difference_mm": _length(float(-difference_mm[2])),
        }


def measure_at(layout: Layout, point_mm: Points2) -> Measurement:
    """Prepare to measure at one or two points (n, 2) of the undeformed sheet."""
    along = None
    if len(point_mm) == 2:
        share = np.linspace(0.0, 1.0, PROFILE_POINTS)[:, None]
        along = sampler_at(layout, (1.0 - share) * point_mm[0] + share * point_mm[1])
    return Measurement(point_mm=point_mm, at_points=sampler_at(layout, point_mm), along=along)


def _length(value_mm: float) -> float | None:
    return number(value_mm, DIGITS)
