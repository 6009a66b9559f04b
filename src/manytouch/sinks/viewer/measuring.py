"""Measures at points that a person chose: depth with its deviation, distance, profile between two."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from manytouch.geometry.sampling import PointSampling, sampling_at
from manytouch.sinks.viewer.messages import number
from manytouch.values import Layout, Surface
from manytouch.values.arrays import Points2

PROFILE_POINTS = 121


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Measure:
    """One or two points of the undeformed sheet, measured again in every frame.

    Attributes:
        point_mm: (1, 2) or (2, 2) the points.
        at_points: samples there.
        along: samples at `PROFILE_POINTS` even steps from the first to the second; None of one point.
    """

    point_mm: Points2
    at_points: PointSampling
    along: PointSampling | None

    def __call__(self, surface: Surface) -> dict[str, Any]:
        """What is measured now, as plain numbers; None where not known."""
        moved_mm = _sampled(self.at_points, surface)
        depth_mm = -moved_mm[:, 2]
        std_mm = self.at_points.std(np.sqrt(surface.covariance_mm2[:, 2, 2]))
        points = [
            {"x_mm": number(x), "y_mm": number(y), "depth_mm": number(depth), "std_mm": number(std)}
            for (x, y), depth, std in zip(self.point_mm, depth_mm, std_mm, strict=True)
        ]
        found: dict[str, Any] = {"points": points}
        if self.along is not None:
            found |= self._between(surface, moved_mm)
            depth = self.along(-surface.displacement_mm[:, 2])
            spread = self.along.std(np.sqrt(surface.covariance_mm2[:, 2, 2]))
            found["profile"] = {
                "length_mm": number(float(np.linalg.norm(self.point_mm[1] - self.point_mm[0]))),
                "depth_mm": [number(value) for value in depth],
                "std_mm": [number(value) for value in spread],
            }
        return found

    def _between(self, surface: Surface, moved_mm: np.ndarray) -> dict[str, Any]:
        """Distances between the two points: on the sheet at rest, and in space as it is now."""
        place_mm = np.column_stack([self.point_mm, np.zeros(2)]) + moved_mm
        apart_mm = place_mm[1] - place_mm[0]
        length_mm = float(np.linalg.norm(apart_mm))
        direction = apart_mm / length_mm if length_mm > 0 else np.zeros(3)
        along = np.einsum("i,mij,j->m", direction, surface.covariance_mm2, direction)
        std_mm = self.at_points.std(np.sqrt(along))
        return {
            "distance_mm": number(length_mm),
            "distance_std_mm": number(float(np.hypot(*std_mm))),
            "rest_distance_mm": number(float(np.linalg.norm(self.point_mm[1] - self.point_mm[0]))),
            "difference_mm": number(float(-apart_mm[2])),
        }


def measure_at(layout: Layout, point_mm: Points2) -> Measure:
    """Prepare to measure at one or two points (n, 2) of the undeformed sheet."""
    along = None
    if len(point_mm) == 2:
        share = np.linspace(0.0, 1.0, PROFILE_POINTS)[:, None]
        along = sampling_at(layout, (1.0 - share) * point_mm[0] + share * point_mm[1])
    return Measure(point_mm=point_mm, at_points=sampling_at(layout, point_mm), along=along)


def _sampled(sampling: PointSampling, surface: Surface) -> np.ndarray:
    return np.column_stack([sampling(surface.displacement_mm[:, axis]) for axis in range(3)])
