"""The rig file (TOML): names, sources and poses of the sensors, and cameras found by serial number.

All mistakes of a file are reported at once.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator
from scipy.spatial.transform import Rotation

from manytouch.errors import SourceError
from manytouch.source_names import VIEWS_PREFIX
from manytouch.values.arrays import Floats, read_only
from manytouch.values.sensor_file.sections import (
    ONE_OR_LIST,
    Number,
    One,
    Positive,
    Section,
    Several,
    all_mistakes,
)
from manytouch.values.sensor_file.toml_file import read_toml

BY_ID = Path("/dev/v4l/by-id")
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Line = Annotated[str, Field(min_length=1, max_length=1000)]
Lines = Annotated[list[Line], Field(min_length=2, max_length=16)]
OneOrSeveral = Annotated[Annotated[Line, One] | Annotated[Lines, Several], ONE_OR_LIST]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
SidePx = Annotated[int, Field(gt=0, le=32_768)]


class RigPoseSection(Section):
    """Pose of a sensor: x_rig = R x_sheet + t; `rotation_vector` in rad (Rodrigues)."""

    rotation_vector: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    translation_mm: Vector = Field(default_factory=lambda: [0.0, 0.0, 0.0])


class SensorSection(Section):
    """One sensor.

    Its camera is given by `source` (path, address, file) or `serial`; a list means several cameras on one
    sheet.
    """

    name: Name
    source: OneOrSeveral | None = None
    serial: OneOrSeveral | None = Field(default=None, validate_default=True)
    sensor: Line | None = None
    method: Literal["mechanics", "perimeter", "paper"] | None = None
    fps: Positive | None = None
    size_px: Annotated[list[SidePx], Field(min_length=2, max_length=2)] | None = None
    to: Annotated[list[Line], Field(max_length=16)] = Field(default_factory=list)
    pose: RigPoseSection = Field(default_factory=RigPoseSection)

    @field_validator("source")
    @classmethod
    def _is_no_index(cls, source: str | list[str] | None) -> str | list[str] | None:
        if any(each.isdecimal() or each.startswith("/dev/video") for each in _texts(source)):
            raise ValueError(
                "the number of a camera changes when it is plugged in again; give serial = or a path in "
                "/dev/v4l/by-id"
            )
        return source

    @field_validator("serial")
    @classmethod
    def _is_instead_of_source(
        cls, serial: str | list[str] | None, info: ValidationInfo
    ) -> str | list[str] | None:
        if "source" in info.data and (info.data["source"] is None) == (serial is None):
            raise ValueError("a sensor needs either source or serial")
        return serial


class RigFile(Section):
    """Content of a rig file."""

    schema_: Literal[1] = Field(alias="schema", examples=[1])
    name: Name
    sensors: Annotated[list[SensorSection], Field(min_length=1, max_length=64)]

    @model_validator(mode="after")
    def _names_differ(self) -> "RigFile":
        if mistakes := _same_names([sensor.name for sensor in self.sensors]):
            raise ValueError(*mistakes)
        return self


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RigSensor:
    """A sensor of a rig.

    Attributes:
        name: in the rig.
        source: what `open_source` takes.
        sensor: path of the sensor file; None: the layout is found in the first frames.
        method, fps: see `manytouch.session.prepare`.
        size_px: see `CameraRequest` (`sources/cameras/capture.py`).
        to: addresses of its outputs.
        rotation, translation_mm: x_rig = rotation @ x_sheet + translation_mm.
    """

    name: str
    source: str
    sensor: str | None
    method: str | None
    fps: float | None
    size_px: tuple[int, int] | None
    rotation: Floats
    translation_mm: Floats
    to: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Rig:
    """Several sensors whose contacts are given in rig coordinates."""

    name: str
    sensors: tuple[RigSensor, ...]


def load_rig(path: Path) -> Rig:
    """Read a rig file; paths in it are relative to it.

    Raises:
        SourceError: it does not exist, is wrong, or a camera with a serial number is not connected.
    """
    try:
        table = read_toml(path, "a rig file", SourceError)
    except FileNotFoundError:
        raise SourceError(f"the rig file {path} does not exist: give the path of an existing one") from None
    try:
        file = RigFile.model_validate(table)
    except ValidationError as error:
        further = _same_names(_names_in(table))
        raise SourceError(all_mistakes(f"rig file {path}", error, RigFile, further)) from None
    return Rig(name=file.name, sensors=tuple(_rig_sensor(each, path.parent) for each in file.sensors))


def camera_with_serial(serial: str, folder: Path = BY_ID) -> str:
    """Path of the camera whose name by the system ends in a serial number.

    Raises:
        SourceError: there is none, there are several, or this system does not list them.
    """
    found = sorted(
        each
        for each in (folder.iterdir() if folder.is_dir() else ())
        if f"_{serial}-video-index0" in each.name
    )
    if len(found) == 1:
        return str(found[0])
    if not sys.platform.startswith("linux"):
        raise SourceError(f"cameras have no serial numbers on this system: give source instead of {serial!r}")
    names = ", ".join(sorted(each.name for each in folder.iterdir())) if folder.is_dir() else ""
    raise SourceError(
        f"{len(found)} cameras have the serial number {serial!r}, expected one; {folder} contains: "
        f"{names or 'nothing'}"
    )


def _names_in(table: Mapping[str, Any]) -> list[str]:
    """The names of sensors in a file that may be wrong elsewhere."""
    sensors = table.get("sensors")
    tables = [each for each in sensors if isinstance(each, dict)] if isinstance(sensors, list) else []
    return [each["name"] for each in tables if isinstance(each.get("name"), str)]


def _same_names(names: list[str]) -> list[str]:
    """The mistake that several sensors have the same name; empty if none have."""
    folded = [name.casefold() for name in names]
    twice = sorted({name for name in folded if folded.count(name) > 1})
    return [f"several sensors are named {', '.join(twice)}"] if twice else []


def _rig_sensor(section: SensorSection, folder: Path) -> RigSensor:
    cameras = [camera_with_serial(serial) for serial in _texts(section.serial)]
    sources = cameras or [_relative(source, folder) for source in _texts(section.source)]
    size = section.size_px
    return RigSensor(
        name=section.name,
        source=sources[0] if len(sources) == 1 else VIEWS_PREFIX + ",".join(sources),
        sensor=None if section.sensor is None else _relative(section.sensor, folder),
        method=section.method,
        fps=section.fps,
        size_px=None if size is None else (size[0], size[1]),
        rotation=read_only(Rotation.from_rotvec(section.pose.rotation_vector).as_matrix()),
        translation_mm=read_only(np.array(section.pose.translation_mm)),
        to=tuple(section.to),
    )


def _texts(given: str | list[str] | None) -> list[str]:
    """The texts of a key that is one text, several, or absent."""
    return [] if given is None else [given] if isinstance(given, str) else given


def _relative(text: str, folder: Path) -> str:
    """A path from the folder of the rig file, if there is such a file; else the text."""
    if "://" in text or (text.startswith("sim:") and not text.endswith(".toml")):
        return text
    scheme, path = ("sim:", text[4:]) if text.startswith("sim:") else ("", text)
    inner = folder / path.partition("#")[0]  # without the #topic of a recording
    return f"{scheme}{folder / path}" if inner.exists() else text
