"""Sections of the sensor file with their checks (pydantic models); all lengths in mm."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy.spatial import KDTree

from manytouch.values.sensor_file.sections import (
    Count,
    IsList,
    NonNegative,
    Number,
    One,
    Positive,
    Section,
    Several,
)

PositiveOrTwo = Annotated[
    Annotated[Positive, One]
    | Annotated[Annotated[list[Positive], Field(min_length=2, max_length=2)], Several],
    IsList,
]
PositiveOrEach = Annotated[Annotated[Positive, One] | Annotated[list[Positive], Several], IsList]


class PoseSection(Section):
    """`[camera.pose]`: cam_from_sheet."""

    rotation_vector: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    translation_mm: tuple[Number, Number, Positive]

    @field_validator("rotation_vector", "translation_mm", mode="before")
    @classmethod
    def _as_tuple(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value


class CameraSection(Section):
    """`[camera]`."""

    model: Literal["pinhole", "fisheye"] = "pinhole"
    width_px: Count
    height_px: Count
    fx_px: Positive
    fy_px: Positive
    cx_px: Number
    cy_px: Number
    distortion: list[Number] = Field(default_factory=list)
    pose: PoseSection | None = None

    @model_validator(mode="after")
    def _check_distortion(self) -> "CameraSection":
        expected = 5 if self.model == "pinhole" else 4
        if self.distortion and len(self.distortion) != expected:
            raise ValueError(
                f"distortion of a {self.model} camera has {expected} numbers, found {len(self.distortion)}"
            )
        return self


class SheetSection(Section):
    """`[sheet]`."""

    size_mm: list[Positive] = Field(min_length=2, max_length=2)
    thickness_mm: Positive
    young_MPa: Positive | None = None
    young_std_MPa: NonNegative | None = None
    poisson: Annotated[float, Field(ge=0, lt=0.5)] | None = None
    boundary: Literal["clamped"] = "clamped"
    pretension_N_per_mm: NonNegative | None = None
    bending_factor: Positive | None = None
    density_kg_m3: Positive | None = None

    @model_validator(mode="after")
    def _check_young(self) -> "SheetSection":
        if self.young_std_MPa is not None and self.young_MPa is None:
            raise ValueError("young_std_MPa is the standard deviation of young_MPa: specify young_MPa too")
        return self


class MarkersSection(Section):
    """`[markers]`."""

    rows: Count | None = None
    columns: Count | None = None
    pitch_mm: PositiveOrTwo | None = None
    offset_mm: list[Number] = Field(default_factory=lambda: [0.0, 0.0], min_length=2, max_length=2)
    rest_mm: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] | None = None
    radius_mm: PositiveOrEach
    height_mm: NonNegative = 0.0
    polarity: Literal["light", "dark", "auto"] = "auto"
    colour_weights: list[Number] | None = Field(default=None, min_length=3, max_length=3)
    missing: list[Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list
    )

    @model_validator(mode="after")
    def _check_layout(self) -> "MarkersSection":
        grid = (self.rows, self.columns)
        if (self.rows is None) != (self.columns is None):
            raise ValueError("rows and columns belong together: specify both, or neither and rest_mm")
        if self.rest_mm is None and (None in grid or self.pitch_mm is None):
            raise ValueError("specify rows, columns and pitch_mm, or the table rest_mm")
        if self.rest_mm is not None:
            if len(self.rest_mm) < 4:
                raise ValueError(f"rest_mm needs at least 4 markers, found {len(self.rest_mm)}")
            if (
                self.rows is not None
                and self.columns is not None
                and len(self.rest_mm) != self.rows * self.columns
            ):
                raise ValueError(
                    f"rest_mm has {len(self.rest_mm)} markers, rows * columns = {self.rows * self.columns}"
                )
        if self.missing and None in grid:
            raise ValueError("missing lists [row, column] pairs and requires rows and columns")
        for row, column in self.missing:
            if row >= (self.rows or 0) or column >= (self.columns or 0):
                raise ValueError(f"missing [{row}, {column}] is outside {self.rows} x {self.columns} markers")
        if isinstance(self.radius_mm, list) and len(self.radius_mm) != self.count:
            raise ValueError(f"radius_mm has {len(self.radius_mm)} numbers for {self.count} markers")
        apart_mm = self.min_distance_mm
        if apart_mm <= 2.0 * np.min(self.radius_mm):
            raise ValueError(
                f"markers of radius_mm = {np.min(self.radius_mm):g} overlap: the smallest distance between "
                f"two is {apart_mm:g} mm"
            )
        return self

    @property
    def count(self) -> int:
        """Number of markers, missing ones included."""
        if self.rest_mm is not None:
            return len(self.rest_mm)
        return (self.rows or 0) * (self.columns or 0)

    @property
    def rest_xy_mm(self) -> np.ndarray:
        """(m, 2) rest positions x, y."""
        if self.rest_mm is not None:
            return np.array(self.rest_mm)
        rows, columns = np.divmod(np.arange(self.count), self.columns or 1)
        step = np.column_stack([columns - columns.max() / 2, rows - rows.max() / 2])
        return np.asarray(step * np.asarray(self.pitch_mm) + self.offset_mm)

    @property
    def min_distance_mm(self) -> float:
        """Smallest distance of two markers; infinite for a single marker."""
        return float(KDTree(self.rest_xy_mm).query(self.rest_xy_mm, k=2)[0][:, 1].min())


class NoiseSection(Section):
    """`[noise]`."""

    centre_px: Positive


class SensorFile(Section):
    """The whole sensor file."""

    schema_version: Annotated[int, Field(alias="schema", ge=1, le=1)]
    name: str = Field(default="unnamed sensor", min_length=1)
    camera: CameraSection
    sheet: SheetSection | None = None
    markers: MarkersSection | None = None
    noise: NoiseSection | None = None
    provenance: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_pose_and_outline(self) -> "SensorFile":
        if self.markers is not None and self.camera.pose is None:
            raise ValueError("a sensor with [markers] needs [camera.pose]")
        if self.markers is not None and self.sheet is not None:
            slack_mm = self.markers.min_distance_mm / 2  # tolerance of a measured outline
            over = np.abs(self.markers.rest_xy_mm) > np.array(self.sheet.size_mm) / 2 + slack_mm
            if over.any():
                x, y = self.sheet.size_mm
                raise ValueError(
                    f"{int(over.any(axis=1).sum())} of {self.markers.count} markers are outside the clamped "
                    f"outline, sheet.size_mm = [{x:g}, {y:g}]"
                )
        return self
