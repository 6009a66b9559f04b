"""The sensor file: TOML, checked key by key, every mistake named at once."""

import os
import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tomlkit
from pydantic import Field, ValidationError, field_validator, model_validator
from scipy.spatial import KDTree

from manytouch.errors import OutputError, SensorError
from manytouch.values.arrays import read_only
from manytouch.values.sections import (
    Count,
    IsList,
    NonNegative,
    Number,
    One,
    Positive,
    Section,
    Several,
    all_mistakes,
)
from manytouch.values.sensor import Camera, Layout, Sensor, Sheet

SENSORS = files("manytouch") / "sensors"


_PositiveOrTwo = Annotated[
    Annotated[Positive, One]
    | Annotated[Annotated[list[Positive], Field(min_length=2, max_length=2)], Several],
    IsList,
]
_PositiveOrEach = Annotated[Annotated[Positive, One] | Annotated[list[Positive], Several], IsList]


class _Pose(Section):
    rotation_vector: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    translation_mm: tuple[Number, Number, Positive]

    @field_validator("rotation_vector", "translation_mm", mode="before")
    @classmethod
    def _list(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value


class _Camera(Section):
    model: Literal["pinhole", "fisheye"] = "pinhole"
    width_px: Count
    height_px: Count
    fx_px: Positive
    fy_px: Positive
    cx_px: Number
    cy_px: Number
    distortion: list[Number] = Field(default_factory=list)
    pose: _Pose | None = None

    @model_validator(mode="after")
    def _distortion_fits(self) -> "_Camera":
        expected = 5 if self.model == "pinhole" else 4
        if self.distortion and len(self.distortion) != expected:
            raise ValueError(
                f"distortion of a {self.model} camera has {expected} numbers, found {len(self.distortion)}"
            )
        return self


class _Sheet(Section):
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
    def _deviation_of_something(self) -> "_Sheet":
        if self.young_std_MPa is not None and self.young_MPa is None:
            raise ValueError("young_std_MPa is the deviation of young_MPa: give that too")
        return self


class _Markers(Section):
    rows: Count | None = None
    columns: Count | None = None
    pitch_mm: _PositiveOrTwo | None = None
    offset_mm: list[Number] = Field(default_factory=lambda: [0.0, 0.0], min_length=2, max_length=2)
    rest_mm: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] | None = None
    radius_mm: _PositiveOrEach
    height_mm: NonNegative = 0.0
    polarity: Literal["light", "dark", "auto"] = "auto"
    colour_weights: list[Number] | None = Field(default=None, min_length=3, max_length=3)
    missing: list[Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list
    )

    @model_validator(mode="after")
    def _whole(self) -> "_Markers":
        grid = (self.rows, self.columns)
        if (self.rows is None) != (self.columns is None):
            raise ValueError("rows and columns belong together: give both, or neither and rest_mm")
        if self.rest_mm is None and (None in grid or self.pitch_mm is None):
            raise ValueError("give rows, columns and pitch_mm, or the table rest_mm")
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
            raise ValueError("missing names [row, column] pairs, so it needs rows and columns")
        for row, column in self.missing:
            if row >= (self.rows or 0) or column >= (self.columns or 0):
                raise ValueError(
                    f"missing [{row}, {column}] lies outside {self.rows} x {self.columns} markers"
                )
        if isinstance(self.radius_mm, list) and len(self.radius_mm) != self.count:
            raise ValueError(f"radius_mm has {len(self.radius_mm)} numbers for {self.count} markers")
        apart_mm = self.least_distance_mm
        if apart_mm <= 2.0 * np.min(self.radius_mm):
            raise ValueError(
                f"radius_mm = {np.min(self.radius_mm):g} makes neighbours that are {apart_mm:g} mm apart "
                "overlap"
            )
        return self

    @property
    def count(self) -> int:
        if self.rest_mm is not None:
            return len(self.rest_mm)
        return (self.rows or 0) * (self.columns or 0)

    @property
    def place_mm(self) -> np.ndarray:
        """(m, 2) places at rest."""
        if self.rest_mm is not None:
            return np.array(self.rest_mm)
        rows, columns = np.divmod(np.arange(self.count), self.columns or 1)
        step = np.column_stack([columns - columns.max() / 2, rows - rows.max() / 2])
        return np.asarray(step * np.asarray(self.pitch_mm) + self.offset_mm)

    @property
    def least_distance_mm(self) -> float:
        """Of two neighbours; endless where there is one marker only."""
        return float(KDTree(self.place_mm).query(self.place_mm, k=2)[0][:, 1].min())


class _Noise(Section):
    centre_px: Positive


class _File(Section):
    schema_version: Annotated[int, Field(alias="schema", ge=1, le=1)]
    name: str = Field(default="unnamed sensor", min_length=1)
    camera: _Camera
    sheet: _Sheet | None = None
    markers: _Markers | None = None
    noise: _Noise | None = None
    provenance: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _posed(self) -> "_File":
        if self.markers is not None and self.camera.pose is None:
            raise ValueError("a sensor with [markers] needs [camera.pose]")
        if self.markers is not None and self.sheet is not None:
            slack_mm = self.markers.least_distance_mm / 2  # an outline is not known to the last mm
            over = np.abs(self.markers.place_mm) > np.array(self.sheet.size_mm) / 2 + slack_mm
            if over.any():
                x, y = self.sheet.size_mm
                raise ValueError(
                    f"{int(over.any(axis=1).sum())} of {self.markers.count} markers lie outside the clamped "
                    f"outline, sheet.size_mm = [{x:g}, {y:g}]"
                )
        return self


def known_sensors() -> list[str]:
    """Names of the sensors that the package describes, from public figures."""
    return sorted(item.name.removesuffix(".toml") for item in SENSORS.iterdir())


def load_sensor(path: str | Path) -> Sensor:
    """Read a sensor file.

    Args:
        path: of the file, or the name of a known sensor (`known_sensors`) where there is no such file.

    Raises:
        SensorError: the file is missing, is no TOML, or has unknown keys, wrong types or impossible
            values; the message lists all of them.
    """
    path = Path(path)
    try:
        is_known = str(path) in known_sensors() and not path.exists()
        text = (SENSORS / f"{path}.toml" if is_known else path).read_text(encoding="utf-8")
        table = tomllib.loads(text)
    except FileNotFoundError:
        raise SensorError(
            f"there is no sensor file {path}: give the path of an existing .toml, or one of the known "
            f"sensors {', '.join(known_sensors())}"
        ) from None
    except IsADirectoryError:
        raise SensorError(f"{path} is a folder, expected a sensor file (.toml)") from None
    except (UnicodeDecodeError, OSError) as error:
        raise SensorError(f"{path} cannot be read as a sensor file: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise SensorError(f"{path} is not valid TOML: {error}") from None
    try:
        checked = _File.model_validate(table)
    except ValidationError as error:
        raise SensorError(all_mistakes(f"sensor file {path}", error)) from None
    return _sensor(checked)


def _vector(values: Sequence[float]) -> Any:
    return read_only(np.asarray(values, dtype=np.float64))


def _sensor(file: _File) -> Sensor:
    camera, sheet, noise = file.camera, file.sheet, file.noise
    pose = camera.pose or _Pose(translation_mm=(0.0, 0.0, 1.0))
    distortion = camera.distortion or [0.0] * (5 if camera.model == "pinhole" else 4)
    return Sensor(
        name=file.name,
        camera=Camera(
            **camera.model_dump(exclude={"distortion", "pose"}),
            distortion=_vector(distortion),
            rotation_vector=_vector(pose.rotation_vector),
            translation_mm=_vector(pose.translation_mm),
        ),
        layout=None if file.markers is None else _layout(file.markers),
        sheet=None
        if sheet is None
        else Sheet(**sheet.model_dump(exclude={"size_mm"}), size_mm=_vector(sheet.size_mm)),
        centre_noise_px=None if noise is None else noise.centre_px,
        provenance=file.provenance,
    )


def _layout(markers: _Markers) -> Layout:
    row_column = None
    if markers.rows is not None and markers.columns is not None:
        rows, columns = np.divmod(np.arange(markers.count), markers.columns)
        row_column = np.column_stack([rows, columns]).astype(np.int64)
    pitch = markers.pitch_mm
    pitch_mm = None if pitch is None else np.broadcast_to(np.asarray(pitch, dtype=np.float64), 2).copy()
    rest_mm = np.column_stack([markers.place_mm, np.zeros(markers.count)])
    if pitch_mm is None:
        pitch_mm = np.full(2, _neighbour_distance(markers.place_mm))
    is_missing = np.zeros(markers.count, dtype=np.bool_)
    for row, column in markers.missing:
        is_missing[row * (markers.columns or 0) + column] = True
    return Layout(
        rest_mm=read_only(rest_mm),
        row_column=None if row_column is None else read_only(row_column),
        pitch_mm=read_only(pitch_mm),
        radius_mm=read_only(
            np.broadcast_to(np.asarray(markers.radius_mm, dtype=np.float64), markers.count).copy()
        ),
        height_mm=markers.height_mm,
        polarity=markers.polarity,
        colour_weights=None if markers.colour_weights is None else _vector(markers.colour_weights),
        is_missing=read_only(is_missing),
    )


def _neighbour_distance(points: Any) -> float:
    distance, _ = KDTree(points).query(points, k=2)
    return float(np.median(distance[:, 1]))


def save_sensor(sensor: Sensor, path: str | Path) -> None:
    """Write a sensor file; it is complete or absent.

    Raises:
        SensorError: the sensor has no scale (its lengths are pitches, not mm), or is impossible.
        OutputError: the place cannot be written.
    """
    if sensor.length_unit != "mm":
        raise SensorError(
            f"sensor {sensor.name!r} has lengths in pitches and a sensor file needs mm: give the pitch in mm"
        )
    path = Path(path)
    document = tomlkit.document()
    document.update(_tables(sensor))
    try:
        _File.model_validate(tomllib.loads(tomlkit.dumps(document)))
    except ValidationError as error:
        raise SensorError(all_mistakes(f"what is known of the sensor {sensor.name!r}", error)) from None
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        aside.write_text(tomlkit.dumps(document), encoding="utf-8")
        aside.replace(path)
    except OSError as error:
        raise OutputError(
            f"cannot write the sensor file {path}: {error.strerror}; choose a folder that can be written"
        ) from None


def _tables(sensor: Sensor) -> dict[str, Any]:
    camera = sensor.camera
    tables: dict[str, Any] = {"schema": 1, "name": sensor.name}
    tables["camera"] = {
        "model": camera.model,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "fx_px": camera.fx_px,
        "fy_px": camera.fy_px,
        "cx_px": camera.cx_px,
        "cy_px": camera.cy_px,
        "distortion": camera.distortion.tolist(),
    }
    if sensor.layout is not None or sensor.sheet is not None:  # a camera alone looks at nothing
        tables["camera"]["pose"] = {
            "rotation_vector": camera.rotation_vector.tolist(),
            "translation_mm": camera.translation_mm.tolist(),
        }
    sheet = sensor.sheet
    if sheet is not None:
        named = [
            name for name in Sheet.__slots__ if name != "is_assumed" and getattr(sheet, name) is not None
        ]
        known = {name: getattr(sheet, name) for name in named}
        tables["sheet"] = known | {"size_mm": sheet.size_mm.tolist()}
    if sensor.layout is not None:
        tables["markers"] = _markers_table(sensor.layout)
    if sensor.centre_noise_px is not None:
        tables["noise"] = {"centre_px": sensor.centre_noise_px}
    if sensor.provenance:
        tables["provenance"] = dict(sensor.provenance)
    return tables


def _markers_table(layout: Layout) -> dict[str, Any]:
    table: dict[str, Any] = {}
    place = layout.rest_mm[:, :2]
    shape = layout.shape
    if shape is not None and layout.row_column is not None:
        table = {"rows": shape[0], "columns": shape[1], "pitch_mm": layout.pitch_mm.tolist()}
        middle = (layout.row_column.max(axis=0) / 2)[::-1]
        offset = place.mean(axis=0)
        regular = (layout.row_column[:, ::-1] - middle) * layout.pitch_mm + offset
        if np.abs(regular - place).max() < 1e-9 * float(np.abs(place).max() + 1):
            table["offset_mm"] = np.round(offset, 12).tolist()
        else:
            table["rest_mm"] = place.tolist()
        table["missing"] = layout.row_column[layout.is_missing].tolist()
    else:
        table["rest_mm"] = place.tolist()
    radius = layout.radius_mm
    same = float(np.ptp(radius)) == 0.0
    table |= {
        "radius_mm": float(radius[0]) if same else radius.tolist(),
        "height_mm": layout.height_mm,
        "polarity": layout.polarity,
    }
    if layout.colour_weights is not None:
        table["colour_weights"] = layout.colour_weights.tolist()
    return table
