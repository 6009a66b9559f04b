"""Displacements of markers that are not seen, interpolated from their neighbours."""

from dataclasses import dataclass

from manytouch.estimation.perimeter.surface_inputs import InterpolationRule
from manytouch.geometry.neighbours import Neighbours


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerInterpolation:
    """Fills gaps from their edge inward, with a standard deviation that increases from round to round.

    Attributes:
        spread: variance of an interpolated displacement in units of the variance among its neighbours.
        floor_pitch: least standard deviation of an interpolated displacement, in pitches.
        rounds: largest number of rounds; markers that none of them reaches get the displacement 0.
    """

    spread: float = 1.0
    floor_pitch: float = 0.02
    rounds: int = 32

    def rule(self, neighbours: Neighbours, pitch_mm: float) -> InterpolationRule:
        """Neighbours and parameters as the kernels take them, lengths in mm.

        Where no neighbour is known, the displacement is 0 with a standard deviation of one pitch.
        """
        floor_mm = self.floor_pitch * pitch_mm
        return InterpolationRule(
            neighbours.index, neighbours.distance, self.spread, floor_mm, pitch_mm, self.rounds
        )
