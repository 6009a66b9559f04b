"""The grid on which files and pictures show a surface."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.sampling import BEYOND_PITCH
from manytouch.geometry.surface_sampling import SurfaceSampler, sampler_on
from manytouch.values import Layout

POINTS_PER_PITCH = 4


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DisplayGrid:
    """An even grid over the markers and half a pitch beyond.

    Attributes:
        x_mm, y_mm: (nx,) columns and (ny,) rows, undeformed sheet coordinates in the unit of the layout.
        sampler: evaluates surfaces there; its results are (ny, nx).
    """

    x_mm: Float64[np.ndarray, " nx"]
    y_mm: Float64[np.ndarray, " ny"]
    sampler: SurfaceSampler


def display_grid(layout: Layout) -> DisplayGrid:
    """A grid with `POINTS_PER_PITCH` points per pitch."""
    low, high = grid_corners(layout)
    step = float(np.sqrt(np.prod(layout.pitch_mm))) / POINTS_PER_PITCH
    x_mm, y_mm = (
        np.linspace(begin, end, max(int(np.ceil((end - begin) / step)) + 1, 2))
        for begin, end in zip(low, high, strict=True)
    )
    return DisplayGrid(x_mm=x_mm, y_mm=y_mm, sampler=sampler_on(layout, x_mm, y_mm))


def grid_corners(layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """(2,) least and (2,) largest x and y up to which a surface is sampled."""
    rest_mm = layout.rest_mm[:, :2]
    beyond_mm = BEYOND_PITCH * layout.pitch_mm
    return rest_mm.min(axis=0) - beyond_mm, rest_mm.max(axis=0) + beyond_mm
