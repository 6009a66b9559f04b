"""Projection through a bonded pad and its window: flat parallel layers that refract exactly as Snell's law.

Layers from a point to the camera, all normal to the sheet's z: the pad down to its bonded face at
z = marker_depth - thickness, the window below it, then air. With s the tangent of the ray's angle in air, a
layer of index n and height h moves the ray sideways by h s / sqrt(n^2 + (n^2 - 1) s^2); the s whose sum over
the layers is the lateral distance of point and camera is found by Newton's method. The sum is increasing and
concave, so that the steps from s = 0 never overshoot.
"""

from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.errors import SensorError
from manytouch.geometry.camera import cam_from_sheet, project, ray
from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import Points2, Points3, Scalars

MAX_STEPS = 30
_TOLERANCE_MM = 1e-12


class _Layers(NamedTuple):
    """Indices of pad and window, and z of bonded face and outer face of the window, mm."""

    pad_index: float
    window_index: float
    bonded_mm: float
    outer_mm: float


def project_through_window(camera: Camera, sheet: Sheet, point_mm: Points3) -> Points2:
    """Pixels of points of a sheet; those inside a pad are seen through pad, window and air.

    Args:
        camera: with its distortion and pose; it is on the air side of the window.
        sheet: any; only a pad with `window_mm` refracts, otherwise the result is that of `camera.project`. An
            index that is not stated is 1.
        point_mm: (n, 3) sheet frame; NaN stays NaN. A point below the bonded face counts as being on it.

    Returns:
        (n, 2) pixels.

    Raises:
        SensorError: the camera lies inside the window or in front of it.
    """
    return project(camera, apparent_mm(camera, sheet, point_mm))


def rest_px(sensor: Sensor, layout: Layout) -> Points2:
    """(m, 2) where the markers of a layout show at rest: as measured, else as projected.

    Raises:
        SensorError: the camera lies inside the window or in front of it.
    """
    if layout.rest_px is not None:
        return layout.rest_px
    if sensor.sheet is None:
        return project(sensor.camera, layout.rest_mm)
    return project_through_window(sensor.camera, sensor.sheet, layout.rest_mm)


def apparent_mm(camera: Camera, sheet: Sheet, point_mm: Points3) -> Points3:
    """(n, 3) where points seem to be: on their ray in air, at their own z. Arguments and errors as above."""
    layers = _layers(sheet)
    if layers is None or len(point_mm) == 0:
        return point_mm
    origin_mm, air_mm = _camera_below(camera, layers)
    lateral_mm = point_mm[:, :2] - origin_mm[:2]
    distance_mm = np.hypot(lateral_mm[:, 0], lateral_mm[:, 1])
    pad_mm = np.maximum(point_mm[:, 2] - layers.bonded_mm, 0.0)
    tangent = _tangent_in_air(layers, air_mm, pad_mm, distance_mm)
    reach_mm = tangent * (point_mm[:, 2] - origin_mm[2])
    scale = np.divide(reach_mm, distance_mm, out=np.ones_like(reach_mm), where=distance_mm > 0)
    apparent: Points3 = np.column_stack([origin_mm[:2] + scale[:, None] * lateral_mm, point_mm[:, 2]])
    return apparent


def onto_plane_through_window(camera: Camera, sheet: Sheet, pixel: Points2, z_mm: float = 0.0) -> Points3:
    """Where the rays of pixels meet the plane z = z_mm of the sheet frame, inside the pad; (n, 3) mm.

    Raises:
        SensorError: the camera lies inside the window or in front of it.
    """
    rotation, translation = cam_from_sheet(camera)
    direction = np.column_stack([ray(camera, pixel), np.ones(len(pixel))]) @ rotation
    slope = direction[:, :2] / direction[:, 2:]
    layers = _layers(sheet)
    if layers is None:
        origin_mm = -translation @ rotation
        lateral_mm = slope * (z_mm - origin_mm[2])
    else:
        origin_mm, air_mm = _camera_below(camera, layers)
        tangent = np.hypot(slope[:, 0], slope[:, 1])
        sideways_mm = _lateral_way(layers, air_mm, max(z_mm - layers.bonded_mm, 0.0), tangent)
        scale = np.divide(sideways_mm, tangent, out=np.zeros_like(tangent), where=tangent > 0)
        lateral_mm = slope * scale[:, None]
    point_mm: Points3 = np.column_stack([origin_mm[:2] + lateral_mm, np.full(len(pixel), z_mm)])
    return point_mm


def _layers(sheet: Sheet) -> _Layers | None:
    """None if nothing refracts."""
    if sheet.window_mm is None:
        return None
    bonded_mm = (sheet.marker_depth_mm or 0.0) - sheet.thickness_mm
    pad_index = 1.0 if sheet.pad_index is None else sheet.pad_index
    window_index = 1.0 if sheet.window_index is None else sheet.window_index
    return _Layers(pad_index, window_index, bonded_mm, bonded_mm - sheet.window_mm)


def _camera_below(camera: Camera, layers: _Layers) -> tuple[np.ndarray, float]:
    """Place of the camera (3,) in the sheet frame and its distance to the window, mm."""
    rotation, translation = cam_from_sheet(camera)
    origin_mm = -translation @ rotation
    air_mm = float(layers.outer_mm - origin_mm[2])
    if air_mm <= 0.0:
        raise SensorError(
            f"the camera is {-origin_mm[2]:.4g} mm behind the markers, but pad and window reach "
            f"{-layers.outer_mm:.4g} mm behind them: increase camera.pose.translation_mm or correct "
            "thickness_mm and window_mm of [sheet]"
        )
    return origin_mm, air_mm


@kernel()
@no_type_check
def _tangent_in_air(layers: _Layers, air_mm: float, pad_mm: Scalars, distance_mm: Scalars) -> Scalars:
    """(n,) tangent of the angle in air at which rays from the camera meet points at these distances."""
    tangent = np.zeros(len(distance_mm))
    for k in range(len(distance_mm)):
        here = 0.0
        for _ in range(MAX_STEPS):
            sideways_mm, slope_mm = _sideways(layers, air_mm, pad_mm[k], here)
            missing_mm = distance_mm[k] - sideways_mm
            here += missing_mm / slope_mm
            if not abs(missing_mm) > _TOLERANCE_MM * (1.0 + distance_mm[k]):
                break
        tangent[k] = here
    return tangent


@kernel()
@no_type_check
def _lateral_way(layers: _Layers, air_mm: float, pad_mm: float, tangent: Scalars) -> Scalars:
    """(n,) lateral way, mm, of rays of these tangents in air up to points at one height in the pad."""
    sideways_mm = np.empty(len(tangent))
    for k in range(len(tangent)):
        sideways_mm[k], _ = _sideways(layers, air_mm, pad_mm, tangent[k])
    return sideways_mm


@kernel()
@no_type_check
def _sideways(layers: _Layers, air_mm: float, pad_mm: float, tangent: float) -> tuple[float, float]:
    """Lateral way of a ray of this tangent in air up to a point, and its derivative, mm."""
    window_square, pad_square = layers.window_index * layers.window_index, layers.pad_index * layers.pad_index
    window_mm, squared = layers.bonded_mm - layers.outer_mm, tangent * tangent
    window_root = np.sqrt(window_square + (window_square - 1.0) * squared)
    pad_root = np.sqrt(pad_square + (pad_square - 1.0) * squared)
    sideways_mm = tangent * (air_mm + window_mm / window_root + pad_mm / pad_root)
    slope_mm = air_mm + window_mm * window_square / window_root**3 + pad_mm * pad_square / pad_root**3
    return sideways_mm, slope_mm
