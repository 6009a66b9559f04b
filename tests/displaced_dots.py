"""Dots that are displaced by more than their pixels show, as in compressed video."""

from dataclasses import replace

import numpy as np

from manytouch.estimation.excess_noise import ExcessNoise
from manytouch.geometry.neighbours import Neighbours
from manytouch.values import TrackedGrid
from manytouch.values.arrays import Mask, Points2, Scalars, read_only


def displaced_dots(grid: TrackedGrid, count: int, std_px: float) -> list[TrackedGrid]:
    """In each frame three of ten dots are displaced anew, and the others stay where they were."""
    random, frames = np.random.default_rng(8), []
    off_px = random.normal(0.0, std_px, grid.position_px.shape)
    for _ in range(count):
        is_new = random.random(len(off_px)) < 0.3
        off_px = np.where(is_new[:, None], random.normal(0.0, std_px, off_px.shape), off_px)
        frames.append(replace(grid, position_px=read_only(grid.position_px + off_px)))
    return frames


class Unaware(ExcessNoise):
    """Never finds any excess."""

    def after_fit(
        self,
        excess_px2: float,
        residual_px: Points2,
        variance_px2: Scalars,
        is_used: Mask,
        neighbours: Neighbours,
        *,
        is_touched: bool = True,
    ) -> float:
        return excess_px2
