"""Descriptions of a sensor: one line for people, a dictionary for summary.json, distances in pixels."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float64

from manytouch.errors import SensorError
from manytouch.geometry import refraction
from manytouch.geometry.camera import onto_plane
from manytouch.values import Layout, Sensor, SheetSpline
from manytouch.values.arrays import Points2


def layout_of(sensor: Sensor) -> Layout:
    """The layout of a sensor that must have one.

    Raises:
        SensorError: the sensor is a camera only.
    """
    if sensor.layout is None:
        raise SensorError(
            f"the sensor '{sensor.name}' describes a camera without markers; "
            "add [markers] to its file, or omit the file to find the markers in the recording"
        )
    return sensor.layout


def rest_px(sensor: Sensor) -> Points2:
    """(m, 2) positions of the markers in the image at rest."""
    return refraction.rest_px(sensor, layout_of(sensor))


def pitch_px(sensor: Sensor) -> Float64[np.ndarray, "2"]:
    """Median distance of neighbours in the image, along x and along y; NaN if there are none.

    A layout without rows and columns has one pitch: the median distance to the nearest neighbour.
    """
    layout = layout_of(sensor)
    position = rest_px(sensor)
    if layout.row_column is None or layout.shape is None:
        away = np.linalg.norm(position[:, None] - position[None], axis=2)
        np.fill_diagonal(away, np.inf)
        nearest = float(np.median(away.min(axis=1))) if len(position) > 1 else np.nan
        return np.full(2, nearest)
    grid = np.full((*layout.shape, 2), np.nan)
    grid[layout.row_column[:, 0], layout.row_column[:, 1]] = position
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).ravel() for axis in (1, 0)]
    return np.array([np.nanmedian(step) if np.isfinite(step).any() else np.nan for step in steps])


def view_mm(sensor: Sensor) -> list[float] | None:
    """Width and height of the part of the sheet's plane that the image shows, in mm; None where not known."""
    camera = sensor.camera
    if not sensor.scale_is_known or camera.views:
        return None
    width, height = camera.width_px, camera.height_px
    x_px, y_px = 0.5 * (width - 1), 0.5 * (height - 1)
    middle_px = [[-0.5, y_px], [width - 0.5, y_px], [x_px, -0.5], [x_px, height - 0.5]]
    left, right, top, bottom = onto_plane(camera, np.array(middle_px))
    size_mm = [float(np.linalg.norm(right - left)), float(np.linalg.norm(bottom - top))]
    return [round(each, 3) for each in size_mm] if np.isfinite(size_mm).all() else None


def describe_view(sensor: Sensor) -> str | None:
    """What the given pitch makes of the picture, so that a wrong scale is noticed; None without a pitch."""
    size_mm = view_mm(sensor)
    if size_mm is None or sensor.sheet is None or not sensor.sheet.is_assumed:
        return None
    x_mm, y_mm = (f"{each:.2g}" if each < 10.0 else f"{each:.0f}" for each in size_mm)
    return f"with this pitch the picture shows {x_mm} x {y_mm} mm of the sheet"


def describe_sensor(sensor: Sensor) -> str:
    """Describe a sensor in one line, such as "8 x 10 markers, dark, pitch 62 x 77 px, 2 missing"."""
    layout = layout_of(sensor)
    x_px, y_px = pitch_px(sensor)
    missing = int(layout.is_missing.sum())
    if layout.shape is not None:
        count = f"{layout.shape[0]} x {layout.shape[1]} markers"
        known = [f"{each:.0f}" for each in (x_px, y_px) if np.isfinite(each)]
        spacing = f"pitch {' x '.join(known)} px"
    else:
        count = f"{len(layout.rest_mm)} markers without rows and columns"
        spacing = f"about {x_px:.0f} px apart"
    parts = [count, layout.polarity, spacing]
    if missing:
        parts.append(f"{missing} missing")
    return ", ".join(parts)


def sensor_to_dict(sensor: Sensor) -> dict[str, Any]:
    """A sensor as plain numbers and lists; None where not known."""
    layout, camera, sheet = layout_of(sensor), sensor.camera, sensor.sheet
    rows, columns = layout.shape if layout.shape is not None else (None, None)
    unit = sensor.length_unit
    missing = np.flatnonzero(layout.is_missing)
    described: dict[str, Any] = {
        "name": sensor.name,
        "unit": unit,
        "rows": rows,
        "columns": columns,
        "markers": int(len(layout.rest_mm) - len(missing)),
        "missing": missing.tolist(),
        "polarity": layout.polarity,
        "pitch_px": [round(float(each), 3) if np.isfinite(each) else None for each in pitch_px(sensor)],
        f"pitch_{unit}": np.round(layout.pitch_mm, 6).tolist(),
        f"radius_{unit}": round(float(np.median(layout.radius_mm)), 6),
        "colour_weights": None if layout.colour_weights is None else layout.colour_weights.tolist(),
        "centre_noise_px": sensor.centre_noise_px,
        "camera": {
            "model": camera.model,
            "width_px": camera.width_px,
            "height_px": camera.height_px,
            "fx_px": camera.fx_px,
            "fy_px": camera.fy_px,
            "cx_px": camera.cx_px,
            "cy_px": camera.cy_px,
            "distortion": camera.distortion.tolist(),
            "rotation_vector": camera.rotation_vector.tolist(),
            f"translation_{unit}": camera.translation_mm.tolist(),
        },
        "sheet": None
        if sheet is None
        else {
            f"size_{unit}": sheet.size_mm.tolist(),
            f"thickness_{unit}": sheet.thickness_mm,
            "young_MPa": sheet.young_MPa,
            "young_std_MPa": sheet.young_std_MPa,
            "poisson": sheet.poisson,
            "boundary": sheet.boundary,
            "pretension_N_per_mm": sheet.pretension_N_per_mm,
            "bending_factor": sheet.bending_factor,
        },
        "provenance": sensor.provenance,
    }
    return {key: plain_values(value) for key, value in described.items()}


def plain_values(value: object) -> Any:
    """A value of a TOML file as JSON: dates and times are text, what is not finite is None."""
    if isinstance(value, Mapping):
        return {str(key): plain_values(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain_values(each) for each in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain_values(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def assumed_thickness(sensor: Sensor, spline: SheetSpline | None) -> dict[str, float] | None:
    """Thickness of an assumed sheet with its deviation, in the sensor's unit of length.

    None if the sheet is known, or where no frame shows it.
    """
    is_known = sensor.sheet is not None and not sensor.sheet.is_assumed
    if spline is None or is_known or not math.isfinite(spline.thickness_std_mm):
        return None
    unit = sensor.length_unit
    return {unit: spline.thickness_mm, f"std_{unit}": spline.thickness_std_mm}


def estimated_pretension(sensor: Sensor, spline: SheetSpline | None) -> dict[str, float | None] | None:
    """Pretension of a sheet whose file does not state it, with its deviation; None without an estimate.

    In N/mm where Young's modulus is known, and divided by it, in the sensor's unit of length.
    """
    sheet, unit = sensor.sheet, sensor.length_unit
    if spline is None or (sheet is not None and sheet.states_pretension):
        return None
    mean, std, young = spline.pretension_over_E_mm, spline.pretension_std_over_E_mm, spline.young_MPa
    return {
        f"over_E_{unit}": mean,
        f"std_over_E_{unit}": std,
        "N_per_mm": None if young is None else young * mean,
        "std_N_per_mm": None if young is None else young * std,
    }
