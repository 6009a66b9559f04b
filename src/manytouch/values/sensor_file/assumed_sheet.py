"""A sheet of which only the markers are known, and what is assumed where a sheet lacks a number."""

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.values.arrays import read_only
from manytouch.values.sensor import Layout, Sheet

ASSUMED_POISSON = 0.45  # of a clamped sheet; that of nearly incompressible rubber
THICKNESS_PITCHES, MARGIN_PITCHES = 0.75, 1.0
OPEN_MARGIN_PITCHES = 5.0
"""Where the sheet goes on beyond the outermost markers. Chosen on views that cut two to six rows or columns
off, and on one that cuts fifteen; presses further beyond the view than this are not described."""
_LEAST_OPEN_PITCHES = 4.0
ASSUMED_SHEET = (
    f"The sheet is {THICKNESS_PITCHES} pitches thick and extends one pitch beyond its outermost markers, "
    "until presses show both."
)
"""What `assumed_sheet` assumes."""
_THICKNESS_STD_PITCHES = 0.3
_MARGIN_STD_PITCHES = 0.7

Pair = Float64[np.ndarray, "2"] | tuple[float, float]
Sides = Float64[np.ndarray, "2 2"]
"""A number of each side: the sides with the lower and the higher x, and those with the lower and higher y."""


def assumed_sheet(layout: Layout, margin_pitches: Sides | None = None) -> Sheet:
    """A clamped sheet that extends some pitches beyond its outermost markers, with wide deviations.

    Args:
        layout: of the markers.
        margin_pitches: (2, 2) by how much; one pitch at each side if not given.
    """
    margin = np.full((2, 2), MARGIN_PITCHES) if margin_pitches is None else margin_pitches
    margin_mm = margin * layout.pitch_mm[:, None]
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    return Sheet(
        is_assumed=True,
        size_mm=read_only(2.0 * _half_mm(layout) + margin_mm.sum(axis=1)),
        centre_mm=read_only(0.5 * (margin_mm[:, 1] - margin_mm[:, 0])),
        thickness_mm=THICKNESS_PITCHES * pitch_mm,
        thickness_std_mm=_THICKNESS_STD_PITCHES * pitch_mm,
        outline_std_mm=_MARGIN_STD_PITCHES * pitch_mm,
    )


def margin_pitches(layout: Layout, size_mm: Pair, centre_mm: Pair | None) -> Sides:
    """(2, 2) by how much an outline with this size and centre extends beyond the outermost markers."""
    off_mm = np.zeros(2) if centre_mm is None else np.asarray(centre_mm)
    outer_mm = 0.5 * np.asarray(size_mm)[:, None] + np.array([-1.0, 1.0]) * off_mm[:, None]
    return np.asarray((outer_mm - _half_mm(layout)[:, None]) / layout.pitch_mm[:, None])


def are_open(layout: Layout, size_mm: Pair, centre_mm: Pair | None) -> Bool[np.ndarray, "2 2"]:
    """(2, 2) whether a sheet with this outline goes on beyond the outermost markers of each side."""
    return np.asarray(margin_pitches(layout, size_mm, centre_mm) > _LEAST_OPEN_PITCHES)


def _half_mm(layout: Layout) -> np.ndarray:
    """(2,) distance of the outermost markers from the origin along x and y."""
    return np.asarray(np.abs(layout.rest_mm[:, :2]).max(axis=0))
