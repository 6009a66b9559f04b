"""A sheet of which only the markers are known, and what is assumed where a sheet lacks a number."""

import numpy as np

from manytouch.values.arrays import read_only
from manytouch.values.sensor import Layout, Sheet

ASSUMED_POISSON = 0.45  # of a clamped sheet; that of nearly incompressible rubber
THICKNESS_PITCHES, MARGIN_PITCHES = 0.75, 1.0
ASSUMED_SHEET = (
    f"The sheet is {THICKNESS_PITCHES} pitches thick, and may end or go on anywhere beyond its outermost "
    "markers."
)
"""What `assumed_sheet` assumes."""
_THICKNESS_STD_PITCHES = 0.3


def assumed_sheet(layout: Layout) -> Sheet:
    """The part of a sheet that the image shows, to a pitch beyond its outermost markers."""
    half_mm = np.abs(layout.rest_mm[:, :2]).max(axis=0)
    pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
    return Sheet(
        is_assumed=True,
        size_mm=read_only(2.0 * (half_mm + MARGIN_PITCHES * layout.pitch_mm)),
        thickness_mm=THICKNESS_PITCHES * pitch_mm,
        thickness_std_mm=_THICKNESS_STD_PITCHES * pitch_mm,
    )
