"""Sections of the sensor file with their checks (pydantic models); all lengths in mm."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_core import PydanticCustomError
from scipy.spatial import KDTree

from manytouch.limits import MAX_MARKERS, sheet_mistake, size_mistake
from manytouch.values.sensor import Boundary
from manytouch.values.sensor_file.one_line import are_on_line
from manytouch.values.sensor_file.sections import (
    ONE_OR_LIST,
    Count,
    MistakesError,
    NonNegative,
    Number,
    One,
    Positive,
    Section,
    Several,
    without_unknown_keys,
)

PositiveOrTwo = Annotated[
    Annotated[Positive, One]
    | Annotated[Annotated[list[Positive], Field(min_length=2, max_length=2)], Several],
    ONE_OR_LIST,
]
Index = Annotated[float, Field(ge=1.0, le=3.0)]
PositiveOrEach = Annotated[Annotated[Positive, One] | Annotated[list[Positive], Several], ONE_OR_LIST]
_ONLY_BONDED = ("marker_depth_mm", "window_mm", "window_index", "pad_index")
_ONLY_CLAMPED = ("pretension_N_per_mm", "bending_factor")
_PLACES = {"rows", "columns", "pitch_mm", "rest_mm"}

MAX_CENTRE_SHARE = 10
MAX_VIEWS = 16
SCHEMA = 1
SectionType = TypeVar("SectionType", bound=Section)


class PoseSection(Section):
    """`[camera.pose]`: cam_from_sheet."""

    rotation_vector: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    translation_mm: tuple[Number, Number, Positive]
    rotation_vector_std: tuple[NonNegative, NonNegative, NonNegative] | None = None
    translation_std_mm: tuple[NonNegative, NonNegative, NonNegative] | None = None

    @field_validator(
        "rotation_vector", "translation_mm", "rotation_vector_std", "translation_std_mm", mode="before"
    )
    @classmethod
    def _as_tuple(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise PydanticCustomError("vector", "a list of 3 numbers is expected")
        return tuple(value)


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
    fx_std_px: NonNegative | None = None
    fy_std_px: NonNegative | None = None
    cx_std_px: NonNegative | None = None
    cy_std_px: NonNegative | None = None
    distortion_std: list[NonNegative] | None = None
    pose: PoseSection | None = None

    def mistakes(self, wrong: Collection[str] = ()) -> Iterator[str]:
        """What contradicts each other or exceeds a limit, in sentences; `wrong` keys are left out."""
        sides = {name: getattr(self, name) for name in ("width_px", "height_px") if name not in wrong}
        if len(sides) == 2 and (mistake := size_mistake(**sides)) is not None:
            yield mistake
        for name, side in (("cx_px", "width_px"), ("cy_px", "height_px")):
            if name in wrong or side in wrong:
                continue
            centre_px = getattr(self, name)
            if abs(centre_px) > MAX_CENTRE_SHARE * sides[side]:
                yield f"{name} = {centre_px:g} is not within {MAX_CENTRE_SHARE} images of the image's centre"
        expected = 5 if self.model == "pinhole" else 4
        if self.distortion and "model" not in wrong and len(self.distortion) != expected:
            yield f"distortion of a {self.model} camera has {expected} numbers, found {len(self.distortion)}"
        if (
            self.distortion_std is not None
            and "distortion" not in wrong
            and len(self.distortion_std) != len(self.distortion)
        ):
            yield (
                f"distortion_std has {len(self.distortion_std)} numbers, but distortion has "
                f"{len(self.distortion)}: specify one for each"
            )


class ViewSection(CameraSection):
    """`[[views]]`: one of several cameras on the sheet."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


class SheetSection(Section):
    """`[sheet]`."""

    size_mm: list[Positive] = Field(min_length=2, max_length=2)
    thickness_mm: Positive
    young_MPa: Positive | None = None
    poisson: Annotated[float, Field(ge=0, lt=0.5)] | None = None
    boundary: Boundary = "clamped"
    pretension_N_per_mm: NonNegative | None = None
    bending_factor: Positive | None = None
    density_kg_m3: Positive | None = None
    marker_depth_mm: Positive | None = None
    window_mm: Positive | None = None
    window_index: Index | None = None
    pad_index: Index | None = None
    outline_std_mm: NonNegative | None = None
    thickness_std_mm: NonNegative | None = None
    young_std_MPa: NonNegative | None = None
    poisson_std: NonNegative | None = None
    pretension_std_N_per_mm: NonNegative | None = None
    bending_factor_std: NonNegative | None = None
    density_std_kg_m3: NonNegative | None = None
    marker_depth_std_mm: NonNegative | None = None
    window_std_mm: NonNegative | None = None
    window_index_std: NonNegative | None = None
    pad_index_std: NonNegative | None = None

    def mistakes(self, wrong: Collection[str] = ()) -> Iterator[str]:
        """What contradicts each other, in sentences; `wrong` keys are left out."""
        stated = {name for name in type(self).model_fields if getattr(self, name, None) is not None}
        for name in type(self).model_fields:
            own = name.replace("_std", "")
            if name in stated and own not in {"outline_mm", *stated, *wrong}:
                yield f"{name} is the standard deviation of {own}: specify {own} too"
        if "boundary" not in wrong:
            yield from self._mistakes_of_boundary(stated, wrong)
        if not {"size_mm", "thickness_mm"} & set(wrong):
            mistake = sheet_mistake(self.size_mm[0], self.size_mm[1], self.thickness_mm)
            if mistake is not None:
                yield mistake
        depth_mm = self.marker_depth_mm
        if depth_mm is not None and "thickness_mm" in stated and depth_mm > self.thickness_mm:
            yield (
                f"marker_depth_mm = {depth_mm:g} is larger than thickness_mm = "
                f"{self.thickness_mm:g}: the markers lie inside the pad"
            )
        if "window_index" in stated and "window_mm" not in {*stated, *wrong}:
            yield "window_index is that of the window: specify window_mm, its thickness, too"

    def _mistakes_of_boundary(self, stated: Collection[str], wrong: Collection[str]) -> Iterator[str]:
        unsuitable = _ONLY_BONDED if self.boundary == "clamped" else _ONLY_CLAMPED
        found = [name for name in unsuitable if name in stated]
        if found:
            other = "bonded" if self.boundary == "clamped" else "clamped"
            yield (
                f'{", ".join(found)} belong to boundary = "{other}", but boundary = "{self.boundary}": '
                "remove these keys or change the boundary"
            )
        if self.boundary == "bonded" and "marker_depth_mm" not in {*stated, *wrong}:
            yield 'boundary = "bonded" needs marker_depth_mm, the depth of the markers below the contact face'


class MarkersSection(Section):
    """`[markers]`."""

    rows: Count | None = None
    columns: Count | None = None
    pitch_mm: PositiveOrTwo | None = None
    offset_mm: list[Number] = Field(default_factory=lambda: [0.0, 0.0], min_length=2, max_length=2)
    rest_mm: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] | None = Field(
        default=None, max_length=MAX_MARKERS
    )
    radius_mm: PositiveOrEach
    height_mm: NonNegative = 0.0
    polarity: Literal["light", "dark", "auto"] = "auto"
    colour_weights: list[Number] | None = Field(default=None, min_length=3, max_length=3)
    missing: list[Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list, max_length=MAX_MARKERS
    )

    def mistakes(self, wrong: Collection[str] = ()) -> Iterator[str]:
        """What contradicts each other or exceeds a limit, in sentences; `wrong` keys are left out."""
        if not _PLACES & set(wrong):
            yield from self._mistakes_of_places()
        if self.rest_mm is not None and len(self.rest_mm) < 4:
            yield f"rest_mm needs at least 4 markers, found {len(self.rest_mm)}"
        elif not {"missing", "offset_mm", *_PLACES} & set(wrong) and self.has_positions and self._is_on_line:
            table = f"rows = {self.rows}, columns = {self.columns}, " if self.rest_mm is None else ""
            yield (
                f"{table}{self.count} markers on one line determine no pose of the camera: at least 2 rows "
                "and 2 columns, or rest_mm in two directions, are expected; state all markers of the sheet"
            )
        if not {"radius_mm", "offset_mm", *_PLACES} & set(wrong):
            yield from self._mistakes_of_radius()

    def _mistakes_of_places(self) -> Iterator[str]:
        rows, columns = self.rows, self.columns
        if (rows is None) != (columns is None):
            yield "rows and columns belong together: specify both, or neither and rest_mm"
        elif self.rest_mm is None and (rows is None or self.pitch_mm is None):
            yield "specify rows, columns and pitch_mm, or the table rest_mm"
        if self.count > MAX_MARKERS:
            yield f"{self.count} markers are too many: at most {MAX_MARKERS} are allowed"
        if rows is not None and columns is not None:
            if self.rest_mm is not None and len(self.rest_mm) != rows * columns:
                yield f"rest_mm has {len(self.rest_mm)} markers, rows * columns = {rows * columns}"
            outside = [place for place in self.missing if place[0] >= rows or place[1] >= columns]
            if outside:
                others = f", and {len(outside) - 1} more are" if len(outside) > 1 else " is"
                yield f"missing {outside[0]}{others} outside {rows} x {columns} markers"
        elif self.missing and rows is None and columns is None:
            yield "missing lists [row, column] pairs and requires rows and columns"

    def _mistakes_of_radius(self) -> Iterator[str]:
        if isinstance(self.radius_mm, list) and len(self.radius_mm) != self.count:
            yield f"radius_mm has {len(self.radius_mm)} numbers for {self.count} markers"
        elif self.has_positions and self.min_distance_mm <= 2.0 * np.min(self.radius_mm):
            yield (
                f"markers of radius_mm = {np.min(self.radius_mm):g} overlap: the smallest distance between "
                f"two is {self.min_distance_mm:g} mm"
            )

    @property
    def has_positions(self) -> bool:
        """Whether the file determines a position for each of an allowed number of markers."""
        is_determined = self.rest_mm is not None or self.pitch_mm is not None
        return is_determined and 0 < self.count <= MAX_MARKERS

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
    def _is_on_line(self) -> bool:
        """Whether all of them, with those that are missing, lie on one line."""
        return are_on_line(self.rest_xy_mm, self.min_distance_mm)

    @property
    def min_distance_mm(self) -> float:
        """Smallest distance of two markers; infinite for a single marker."""
        return float(KDTree(self.rest_xy_mm).query(self.rest_xy_mm, k=2)[0][:, 1].min())


class NoiseSection(Section):
    """`[noise]`."""

    centre_px: Positive


class SensorFile(Section):
    """The whole sensor file."""

    schema_version: Annotated[int, Field(alias="schema", examples=[SCHEMA])]
    name: str = Field(default="unnamed sensor", min_length=1)
    camera: CameraSection | None = None
    views: list[ViewSection] | None = Field(default=None, min_length=2, max_length=MAX_VIEWS)
    sheet: SheetSection | None = None
    markers: MarkersSection | None = None
    noise: NoiseSection | None = None
    provenance: dict[str, Any] = Field(default_factory=dict)

    @field_validator("schema_version")
    @classmethod
    def _is_known(cls, value: int) -> int:
        if value != SCHEMA:
            raise PydanticCustomError(
                "schema", f"{SCHEMA} is expected; a later version of manytouch may read this file"
            )
        return value

    @model_validator(mode="after")
    def _check(self) -> "SensorFile":
        if found := list(self.mistakes()):
            raise MistakesError(found)
        return self

    def mistakes(self, wrong: Collection[str] = ()) -> Iterator[str]:
        """What contradicts each other or exceeds a limit, in sentences.

        Args:
            wrong: sections that the file has, but not this object, such as "sheet", and keys that a section
                of the file has, but not that of this object, such as "sheet.size_mm": they are wrong.
        """
        views = {f"views.{number}": view for number, view in enumerate(self.views or ())}
        sections = {"camera": self.camera, **views, "sheet": self.sheet, "markers": self.markers}
        for name, section in sections.items():
            if section is not None:
                yield from (f"{name}: {mistake}" for mistake in section.mistakes(_keys_of(name, wrong)))
        if not {"camera", "views"} & set(wrong) and (self.camera is None) == (self.views is None):
            yield "a sensor has either one [camera], or several [[views]], each with its pose"
        if self.views is not None:
            yield from self._mistakes_of_views(self.views, wrong)
        is_posed = self.camera is None or self.camera.pose is not None or "camera.pose" in wrong
        if self.markers is not None and not is_posed:
            yield (
                "a sensor with [markers] needs [camera.pose]; or leave [markers] out: manytouch calibrate "
                "rest finds both"
            )
        if self.markers is not None and self.sheet is not None:
            yield from _mistakes_of_places(self.markers, self.sheet, wrong)

    def _mistakes_of_views(self, views: Sequence[ViewSection], wrong: Collection[str]) -> Iterator[str]:
        of_views = {key.rpartition(".")[2] for key in wrong if key.startswith("views.")}
        names = [] if "name" in of_views else [view.name for view in views]
        if len(set(names)) < len(names):
            yield f"views need different names, found {', '.join(names)}"
        is_posed = "pose" in of_views or all(view.pose is not None for view in views)
        if (self.markers is None and "markers" not in wrong) or not is_posed:
            yield "several [[views]] need [markers], and each view its pose ([views.pose])"
        if not {"width_px", "height_px"} & of_views:
            mistake = size_mistake(
                sum(view.width_px for view in views), max(view.height_px for view in views)
            )
            if mistake is not None:
                yield f"the pictures of the views in a row are too large: {mistake}"
        is_bonded = self.sheet is not None and self.sheet.boundary == "bonded"
        if (self.sheet is None and "sheet" not in wrong) or is_bonded:
            yield 'several [[views]] need a [sheet] with boundary = "clamped"'


def _keys_of(section: str, wrong: Collection[str]) -> set[str]:
    """The wrong keys that belong to a section, without its name."""
    return {key.removeprefix(f"{section}.") for key in wrong if key.startswith(f"{section}.")}


def _mistakes_of_places(
    markers: MarkersSection, sheet: SheetSection, wrong: Collection[str]
) -> Iterator[str]:
    """Markers that do not lie where the sheet is."""
    if sheet.boundary == "bonded" and markers.height_mm > 0.0:
        yield (
            f"markers.height_mm = {markers.height_mm:g} is for a clamped sheet; the markers of "
            "a bonded pad lie at sheet.marker_depth_mm below its contact face"
        )
    of_places = {"sheet.size_mm", "markers.offset_mm", *(f"markers.{key}" for key in _PLACES)}
    if of_places & set(wrong) or not markers.has_positions:
        return
    slack_mm = markers.min_distance_mm / 2  # tolerance of a measured outline
    over = np.abs(markers.rest_xy_mm) > np.array(sheet.size_mm) / 2 + slack_mm
    if over.any():
        x, y = sheet.size_mm
        outline = "outline" if "sheet.boundary" in wrong else f"{sheet.boundary} outline"
        yield (
            f"{int(over.any(axis=1).sum())} of {markers.count} markers are outside the "
            f"{outline}, sheet.size_mm = [{x:g}, {y:g}]"
        )


def further_mistakes(table: Mapping[str, Any], error: ValidationError) -> list[str]:
    """Contradictions among those keys of a file whose names and types are right, in sentences.

    Args:
        table: the file, some of whose keys or types are wrong.
        error: which ones; unknown keys do not make a section wrong.
    """
    faults = [item["loc"] for item in error.errors() if item["loc"] and item["type"] != "extra_forbidden"]
    known = without_unknown_keys(table, error)
    wrong: set[str] = set()
    for place in faults:
        depth = 3 if place[0] == "views" else 2
        is_key = len(place) >= depth and place[0] in ("camera", "views", "sheet", "markers")
        wrong.add(".".join(str(part) for part in place[:depth]) if is_key else str(place[0]))

    def of_right_keys(section: type[SectionType], name: str, values: Mapping[str, Any]) -> SectionType:
        return section.model_construct(**{key: values[key] for key in values if f"{name}.{key}" not in wrong})

    sections: dict[str, Any] = {}
    for name, section in (("camera", CameraSection), ("sheet", SheetSection), ("markers", MarkersSection)):
        if name in known and name not in wrong:
            sections[name] = of_right_keys(section, name, known[name])
    if "views" in known and "views" not in wrong:
        sections["views"] = [
            of_right_keys(ViewSection, f"views.{number}", view) for number, view in enumerate(known["views"])
        ]
    return list(SensorFile.model_construct(**sections).mistakes(wrong))
