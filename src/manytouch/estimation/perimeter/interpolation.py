"""Displacements of markers that are not seen, interpolated from their neighbours."""

from dataclasses import dataclass

from manytouch.geometry.neighbours import Neighbours
from manytouch.values.arrays import Covariances2, Mask, Points2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerInterpolation:
    """Fills gaps from their rim inward, with a standard deviation that increases from round to round.

    Attributes:
        spread: variance of an interpolated displacement in units of the variance among its neighbours.
        floor_pitch: least standard deviation of an interpolated displacement, in pitches.
        rounds: largest number of rounds; markers that none of them reaches get the displacement 0.
    """

    spread: float = 1.0
    floor_pitch: float = 0.02
    rounds: int = 32

    def __call__(
        self,
        displacement_mm: Points2,
        covariance_mm2: Covariances2,
        is_seen: Mask,
        neighbours: Neighbours,
        pitch_mm: float,
    ) -> tuple[Points2, Covariances2]:
        """Displacements (m, 2) and covariances (m, 2, 2) of all markers.

        Where no neighbour is known, the displacement is 0 with a standard deviation of one pitch.
        """
        if is_seen.all():
            return displacement_mm, covariance_mm2
        from manytouch.estimation.perimeter.interpolation_kernels import InterpolationRule, interpolate_unseen

        floor_mm = self.floor_pitch * pitch_mm
        rule = InterpolationRule(
            neighbours.index, neighbours.distance, self.spread, floor_mm, pitch_mm, self.rounds
        )
        displacement, covariance = interpolate_unseen(displacement_mm, covariance_mm2, is_seen, rule)
        return displacement, covariance
