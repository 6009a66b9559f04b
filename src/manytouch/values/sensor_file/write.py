"""Write a sensor file."""

import os
import tomllib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from pydantic import ValidationError

from manytouch.errors import OutputError, SensorError, require_type
from manytouch.values.sensor import Camera, Layout, Sensor, Sheet
from manytouch.values.sensor_file.schema import SensorFile
from manytouch.values.sensor_file.sections import all_mistakes


def save_sensor(sensor: Sensor, path: str | Path) -> None:
    """Write a sensor file; the file is complete or absent, also after an error.

    Raises:
        SensorError: the scale of the sensor is unknown, or its values are impossible.
        OutputError: the file cannot be written.
    """
    require_type("the sensor", sensor, Sensor, "a Sensor first, then the path of the file")
    require_type("the sensor file", path, (str, PathLike), "a Sensor first, then the path of the file")
    if not sensor.scale_is_known:
        raise SensorError(
            f"the scale of the sensor {sensor.name!r} is unknown, but a sensor file needs it: "
            "give the pitch in mm"
        )
    path = Path(path)
    document = tomlkit.document()
    document.update(_plain(_tables(sensor)))
    try:
        SensorFile.model_validate(tomllib.loads(tomlkit.dumps(document)))
    except ValidationError as error:
        raise SensorError(all_mistakes(f"the sensor {sensor.name!r}", error)) from None
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_text(tomlkit.dumps(document), encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise OutputError(
            f"cannot write the sensor file {path}: {error.strerror}; choose a folder that can be written"
        ) from None


def _tables(sensor: Sensor) -> dict[str, Any]:
    tables: dict[str, Any] = {"schema": 1, "name": sensor.name}
    sheet, views = sensor.sheet, sensor.camera.views
    has_pose = sensor.layout is not None or sheet is not None  # without a sheet there is none
    if views:
        tables["views"] = [{"name": view.name} | _camera_table(view.camera, has_pose) for view in views]
    else:
        tables["camera"] = _camera_table(sensor.camera, has_pose)
    if sheet is not None:
        names = [name for name in Sheet.__slots__ if name != "is_assumed"]
        known = {name: getattr(sheet, name) for name in names if getattr(sheet, name) is not None}
        tables["sheet"] = known | {"size_mm": sheet.size_mm.tolist()}
    if sensor.layout is not None:
        tables["markers"] = _markers_table(sensor.layout)
    if sensor.centre_noise_px is not None:
        tables["noise"] = {"centre_px": sensor.centre_noise_px}
    if sensor.provenance:
        tables["provenance"] = dict(sensor.provenance)
    return tables


def _plain(value: Any) -> Any:
    """Tables and lists with numbers of Python, which TOML requires, instead of those of numpy."""
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _camera_table(camera: Camera, has_pose: bool) -> dict[str, Any]:
    names = ("model", "width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")
    table = {name: getattr(camera, name) for name in names} | {"distortion": camera.distortion.tolist()}
    for name in ("fx_std_px", "fy_std_px", "cx_std_px", "cy_std_px"):
        if getattr(camera, name) is not None:
            table[name] = getattr(camera, name)
    if camera.distortion_std is not None:
        table["distortion_std"] = camera.distortion_std.tolist()
    if has_pose:
        pose = ("rotation_vector", "translation_mm", "rotation_vector_std", "translation_std_mm")
        known = {name: getattr(camera, name) for name in pose}
        table["pose"] = {name: value.tolist() for name, value in known.items() if value is not None}
    return table


def _markers_table(layout: Layout) -> dict[str, Any]:
    table: dict[str, Any] = {}
    rest_xy_mm = layout.rest_mm[:, :2]
    shape = layout.shape
    if shape is not None and layout.row_column is not None:
        table = {"rows": shape[0], "columns": shape[1], "pitch_mm": layout.pitch_mm.tolist()}
        middle = (layout.row_column.max(axis=0) / 2)[::-1]
        offset = rest_xy_mm.mean(axis=0)
        regular = (layout.row_column[:, ::-1] - middle) * layout.pitch_mm + offset
        if np.abs(regular - rest_xy_mm).max() < 1e-9 * float(np.abs(rest_xy_mm).max() + 1):
            table["offset_mm"] = np.round(offset, 12).tolist()
        else:
            table["rest_mm"] = rest_xy_mm.tolist()
        table["missing"] = layout.row_column[layout.is_missing].tolist()
    else:
        table["rest_mm"] = rest_xy_mm.tolist()
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
