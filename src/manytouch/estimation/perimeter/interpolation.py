"""Displacements of markers that a frame does not show, from those around them."""

from dataclasses import dataclass

from manytouch.geometry.neighbours import Neighbours
from manytouch.values.arrays import Covariances2, Mask, Points2

_ROUNDS = 32


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FillUnseen:
    """Fills gaps from the rim inward; each round trusts what it fills less.

    Attributes:
        spread: variance of a filled value in units of the variance among the neighbours it is taken from.
        floor_pitch: a filled value is off by at least this part of a pitch.
    """

    spread: float = 1.0
    floor_pitch: float = 0.02

    def __call__(
        self,
        moved_mm: Points2,
        covariance_mm2: Covariances2,
        is_seen: Mask,
        neighbours: Neighbours,
        pitch_mm: float,
    ) -> tuple[Points2, Covariances2]:
        """Displacements (m, 2) and covariances (m, 2, 2) of all markers; off by a pitch when none is seen."""
        if is_seen.all():
            return moved_mm, covariance_mm2
        from manytouch.estimation.kernels import filled

        around = (neighbours.index, neighbours.distance)
        floor_mm = self.floor_pitch * pitch_mm
        moved, covariance = filled(
            moved_mm, covariance_mm2, is_seen, around, self.spread, floor_mm, pitch_mm, _ROUNDS
        )
        return moved, covariance
