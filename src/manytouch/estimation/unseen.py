"""Displacements of markers that a frame does not show, from those around them."""

from dataclasses import dataclass

import numpy as np

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
        moved = np.where(is_seen[:, None], moved_mm, 0.0)
        covariance = np.where(is_seen[:, None, None], covariance_mm2, pitch_mm**2 * np.eye(2))
        known = is_seen.copy()
        for _ in range(_ROUNDS):
            rim = np.flatnonzero(~known & known[neighbours.index].any(axis=1))
            if len(rim) == 0:
                break
            index = neighbours.index[rim]
            weight = np.where(known[index], neighbours.distance[rim] ** -2.0, 0.0)
            weight /= weight.sum(axis=1, keepdims=True)
            mean = np.einsum("rk,rkd->rd", weight, moved[index])
            off = moved[index] - mean[:, None]
            among = np.einsum("rk,rkd,rke->rde", weight, off, off)
            trust = np.einsum("rk,rkde->rde", weight, covariance[index])
            moved[rim] = mean
            covariance[rim] = trust + self.spread * among + (self.floor_pitch * pitch_mm) ** 2 * np.eye(2)
            known[rim] = True
        return moved, covariance
