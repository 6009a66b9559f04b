"""A designed sensor (`Design`), its layout, and the limits from which its dimensions follow."""

import math
from dataclasses import dataclass

import numpy as np

from manytouch.design.deflection import DeflectionCurve
from manytouch.design.materials import Material
from manytouch.design.requirements import Requirements
from manytouch.design.stand_off import StandOff
from manytouch.values import Layout, Sensor
from manytouch.values.arrays import read_only

MIN_RIM_MM = 10.0
"""Least width of the rim, which lies between the clamp line and the touchable area."""
RIM_THICKNESSES, RIM_PITCHES = 2.0, 1.5
"""Contact forces cannot be separated from clamp forces within two thicknesses of the clamp; a press moves
markers within 1.5 pitches."""
VIEW_MARGIN = 1.03
"""The camera sees so many times the length and the width of the sheet."""
MIN_MARKER_RADIUS_PX = 3.0
MIN_MARKER_GAP_PX = 3.0
"""Between the outlines of neighbouring markers in the image, also while the sheet is pressed."""
RESOLUTION_PITCHES = 2.0
"""Two-point resolution in pitches (docs/metrics.md)."""
MAX_PITCH_MM = 6.0
"""Largest pitch that is designed, also where a larger two-point resolution would be enough."""
RADIUS_PER_PITCH = 0.25
"""Radius of a marker over the pitch, unless that is too small to be resolved or printed."""
THICKNESSES_MM = (2.0, 3.0, 4.0)
"""Thicknesses of the sheet from which one is chosen if the requirements state none."""
STRENGTH_SHARE = 0.5
"""The sheet is stretched to at most this share of its strength."""
LEAST_DISTANCES_PER_DEPTH = 3.0
"""Least distance of the camera over the deepest press. A choice: dots then grow by half at most."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reason:
    """A choice of the design, and why it was made.

    Attributes:
        about: the dimension or part.
        chosen: its value, with the unit.
        why: one or two sentences with the decisive numbers.
    """

    about: str
    chosen: str
    why: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Design:
    """A sensor that satisfies requirements.

    Attributes:
        requirements: of the sensor.
        sensor: as designed; its forces are only calibrated after `calibrate sheet`.
        material: of the sheet.
        curve: depth in the middle of the sheet under increasing force.
        stand_off: of the camera.
        reasons: in the order of the choices.
    """

    requirements: Requirements
    sensor: Sensor
    material: Material
    curve: DeflectionCurve
    stand_off: StandOff
    reasons: tuple[Reason, ...] = ()

    @property
    def mm_per_px(self) -> float:
        """Size of a pixel on the sheet at rest."""
        return float(self.sensor.camera.translation_mm[2]) / self.sensor.camera.fx_px

    @property
    def depth_under_largest_force_mm(self) -> float:
        """Depth under the largest force."""
        return self.curve.depth_at(self.requirements.force_N[1] / self.material.young_MPa)

    @property
    def depth_under_smallest_force_mm(self) -> float:
        """Depth under the smallest force."""
        return self.curve.depth_at(self.requirements.force_N[0] / self.material.young_MPa)


def rim_mm(requirements: Requirements, thickness_mm: float) -> float:
    """Distance between the clamp line and the touchable area, mm."""
    reach_mm = RIM_THICKNESSES * thickness_mm + RIM_PITCHES * pitch_mm(requirements)
    return max(MIN_RIM_MM, math.ceil(2 * reach_mm) / 2)


def pitch_mm(requirements: Requirements) -> float:
    """Distance between neighbouring markers, mm."""
    return min(requirements.separation_mm / RESOLUTION_PITCHES, MAX_PITCH_MM)


def light_lattice(size: tuple[float, float], pitch: float, radius: float, height: float) -> Layout:
    """A lattice of light markers that fills a sheet; all arguments in mm."""
    columns, rows = (int(side / pitch + 1e-9) for side in size)
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    rest = np.zeros((rows * columns, 3))
    rest[:, 0] = (column - (columns - 1) / 2) * pitch
    rest[:, 1] = (row - (rows - 1) / 2) * pitch
    return Layout(
        rest_mm=read_only(rest),
        row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
        pitch_mm=read_only(np.array([pitch, pitch])),
        radius_mm=read_only(np.full(len(rest), radius)),
        height_mm=height,
        polarity="light",
        is_missing=read_only(np.zeros(len(rest), dtype=np.bool_)),
    )
