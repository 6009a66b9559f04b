"""Read a sensor file."""

import difflib
from collections.abc import Sequence
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.spatial import KDTree

from manytouch.errors import SensorError, require_type
from manytouch.values.arrays import read_only
from manytouch.values.sensor import Camera, Layout, Sensor, Sheet, camera_of_views
from manytouch.values.sensor_file.schema import (
    CameraSection,
    MarkersSection,
    PoseSection,
    SensorFile,
    further_mistakes,
)
from manytouch.values.sensor_file.sections import all_mistakes
from manytouch.values.sensor_file.toml_file import read_toml

SENSORS = files("manytouch") / "sensors"


def known_sensors() -> list[str]:
    """Names of the sensors that the package includes, described from public figures."""
    return sorted(item.name.removesuffix(".toml") for item in SENSORS.iterdir())


def load_sensor(path: str | Path) -> Sensor:
    """Read a sensor file.

    Args:
        path: of the file; or, if that file does not exist, the name of a known sensor (`known_sensors`).

    Raises:
        SensorError: the file is missing or not TOML, or has unknown keys, wrong types or impossible values;
            the message lists all of them.
    """
    require_type("the sensor file", path, (str, PathLike), "its path, or the name of a known sensor")
    path = Path(path)
    try:
        is_known = str(path) in known_sensors() and not path.exists()
        table = read_toml(SENSORS / f"{path}.toml" if is_known else path, "a sensor file", SensorError)
    except FileNotFoundError:
        raise SensorError(
            f"the sensor file {path} does not exist: give the path of an existing .toml file, or the name of "
            f"one of the known sensors {', '.join(known_sensors())}{_alike(path)}"
        ) from None
    try:
        checked = SensorFile.model_validate(table)
    except ValidationError as error:
        further = further_mistakes(table, error)
        raise SensorError(all_mistakes(f"sensor file {path}", error, SensorFile, further)) from None
    return _sensor(checked)


def _alike(path: Path) -> str:
    """The known sensor whose name is similar to that of a missing file, as the end of a message."""
    name = path.name.casefold().removesuffix(".toml")
    close = difflib.get_close_matches(name, known_sensors(), n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else ""


def _vector(values: Sequence[float]) -> Any:
    return read_only(np.asarray(values, dtype=np.float64))


def _vector_or_none(values: Sequence[float] | None) -> Any:
    return None if values is None else _vector(values)


def _sensor(file: SensorFile) -> Sensor:
    sheet, noise = file.sheet, file.noise
    if file.camera is not None:
        camera = _camera(file.camera)
    else:
        camera = camera_of_views({view.name: _camera(view) for view in file.views or ()})
    return Sensor(
        name=file.name,
        camera=camera,
        layout=None if file.markers is None else _layout(file.markers),
        sheet=None
        if sheet is None
        else Sheet(**sheet.model_dump(exclude={"size_mm"}), size_mm=_vector(sheet.size_mm)),
        centre_noise_px=None if noise is None else noise.centre_px,
        provenance=file.provenance,
    )


def _camera(camera: CameraSection) -> Camera:
    pose = camera.pose or PoseSection(translation_mm=(0.0, 0.0, 1.0))
    distortion = camera.distortion or [0.0] * (5 if camera.model == "pinhole" else 4)
    return Camera(
        **camera.model_dump(exclude={"name", "distortion", "distortion_std", "pose"}),
        distortion=_vector(distortion),
        rotation_vector=_vector(pose.rotation_vector),
        translation_mm=_vector(pose.translation_mm),
        distortion_std=_vector_or_none(camera.distortion_std),
        rotation_vector_std=_vector_or_none(pose.rotation_vector_std),
        translation_std_mm=_vector_or_none(pose.translation_std_mm),
    )


def _layout(markers: MarkersSection) -> Layout:
    row_column = None
    if markers.rows is not None and markers.columns is not None:
        rows, columns = np.divmod(np.arange(markers.count), markers.columns)
        row_column = np.column_stack([rows, columns]).astype(np.int64)
    pitch = markers.pitch_mm
    pitch_mm = None if pitch is None else np.broadcast_to(np.asarray(pitch, dtype=np.float64), 2).copy()
    rest_mm = np.column_stack([markers.rest_xy_mm, np.zeros(markers.count)])
    if pitch_mm is None:
        pitch_mm = np.full(2, _neighbour_distance(markers.rest_xy_mm))
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
