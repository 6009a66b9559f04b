"""Pose of a flat sheet or of a pad behind its window in the view of a camera, and its standard deviations."""

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float64

from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import cam_from_sheet, camera_matrix, project
from manytouch.geometry.refraction import project_through_window
from manytouch.values import Camera, Sheet
from manytouch.values.arrays import Points2, read_only
from manytouch.values.sensor_file.default_std import camera_std

_INDEPENDENT = 16
"""Markers that count as independent in a pose: regions of a sheet that sag or are printed alike; assumed."""
_ROUNDS = 3
_LEAST_PX = 0.02  # added to the RMS distance of the markers from the fitted pose; the noise of a good image
_INSIDE_PX = 1e4
"""Residual of a pose whose camera is inside of the window."""


def fit_pose(
    camera: Camera, rest_mm: np.ndarray, place_px: Points2, sheet: Sheet | None = None
) -> tuple[Camera, Float64[np.ndarray, "6"]]:
    """Fit the pose of the camera to the markers of a flat sheet; returns the camera and the pose
    deviations (6,).

    Args:
        camera: its intrinsic parameters are used, its pose is not.
        rest_mm: (n, 3) markers in the sheet frame.
        place_px: (n, 2) their measured positions in the image.
        sheet: a pad that is seen through its window; None or no window: nothing refracts.

    Raises:
        LayoutError: from no place would the camera see the markers like this.
    """
    if camera.model == "fisheye":
        straight = cv2.fisheye.undistortPoints(
            place_px.reshape(-1, 1, 2), camera_matrix(camera), camera.distortion, P=camera_matrix(camera)
        )
        lens = np.zeros(5)
    else:
        straight, lens = place_px.reshape(-1, 1, 2), camera.distortion
    # A plane has two candidate poses; the one with the smaller residual is taken.
    count, rotations, translations, _ = cv2.solvePnPGeneric(
        rest_mm, straight, camera_matrix(camera), lens, flags=cv2.SOLVEPNP_IPPE
    )
    candidates = [
        _refine_pose(
            _behind_window(_posed(camera, np.append(rotations[k], translations[k])), sheet),
            rest_mm,
            place_px,
            sheet,
        )
        for k in range(count)
    ]
    best = min(candidates, key=lambda posed: float(np.square(_seen(posed, sheet, rest_mm) - place_px).sum()))
    try:
        return best, _pose_std(best, rest_mm, place_px, sheet)
    except np.linalg.LinAlgError as error:
        raise LayoutError(
            "this recording is of another sensor: from no place would the camera of the sensor file see its "
            "markers; give the file of the sensor that was recorded, or make one (manytouch calibrate "
            "camera, then calibrate rest)"
        ) from error


def adapt_pose(camera: Camera, rest_mm: np.ndarray, place_px: Points2) -> Camera:
    """The camera in the pose that its stated pose and the markers of a flat sheet at rest determine together.

    The stated pose counts by its deviations, or by how far the markers are from it, if that is more; the
    markers count by the distances that the fit leaves. These are due to print, sag and lens, which err alike
    at neighbouring markers, so that all markers count as 16. The deviations of the pose become those of the
    fit, with the part by the lens.

    Args:
        camera: in the stated pose; deviations that it does not state are the defaults.
        rest_mm: (n, 3) markers in the sheet frame.
        place_px: (n, 2) their measured positions in the image.
    """
    stated = camera_std(camera)
    std = np.concatenate([stated.rotation_vector, stated.translation_mm])
    if not std.any():
        return camera
    first = np.concatenate([camera.rotation_vector, camera.translation_mm])
    fitted, covariance = camera, np.eye(6)
    for _ in range(_ROUNDS):
        pose = np.concatenate([fitted.rotation_vector, fitted.translation_mm])
        slope = _pose_slope(fitted, rest_mm, None) * std
        # of the stated pose, in its deviations: none for a number that is exact
        step = np.divide(pose - first, std, out=np.zeros(6), where=std > 0.0)
        aim_px = (place_px - project(fitted, rest_mm)).ravel() + slope @ step
        free, *_ = np.linalg.lstsq(slope, aim_px, rcond=None)
        variance_px2 = np.square(aim_px - slope @ free).mean() + _LEAST_PX**2
        variance_px2 *= max(len(rest_mm) / _INDEPENDENT, 1.0)
        is_stated = 1.0 / np.maximum(np.square(free), 1.0)
        covariance = np.linalg.inv(slope.T @ slope / variance_px2 + np.diag(is_stated))
        fitted = _posed(camera, first + std * (covariance @ (slope.T @ aim_px)) / variance_px2)
    rotation = _nearest_turn(fitted.rotation_vector, camera.rotation_vector)
    fitted = _posed(camera, np.append(rotation, fitted.translation_mm))
    by_lens = np.minimum(pose_std_by_lens(fitted, rest_mm), std)
    rotation_std, translation_std_mm = np.split(np.hypot(std * np.sqrt(np.diag(covariance)), by_lens), 2)
    return replace(
        fitted, rotation_vector_std=read_only(rotation_std), translation_std_mm=read_only(translation_std_mm)
    )


def _nearest_turn(rotation_vector: np.ndarray, stated: np.ndarray) -> np.ndarray:
    """The vector of the same rotation that is nearest to the stated one: without whole revolutions."""
    angle = float(np.linalg.norm(rotation_vector))
    axis = rotation_vector / max(angle, np.finfo(np.float64).tiny)
    revolutions = np.round((stated @ axis - angle) / (2.0 * np.pi))
    return np.asarray(rotation_vector + 2.0 * np.pi * revolutions * axis)


def _seen(camera: Camera, sheet: Sheet | None, rest_mm: np.ndarray) -> Points2:
    """(n, 2) images of the markers; far outside the image if the camera is inside of the window."""
    if sheet is None or sheet.window_mm is None:
        return project(camera, rest_mm)
    try:
        return project_through_window(camera, sheet, rest_mm)
    except SensorError:
        return np.full((len(rest_mm), 2), _INSIDE_PX)


def _behind_window(camera: Camera, sheet: Sheet | None) -> Camera:
    """The camera so much farther away that markers appear as near as without refraction (near the axis)."""
    if sheet is None or sheet.window_mm is None:
        return camera
    pad_mm = sheet.thickness_mm - (sheet.marker_depth_mm or 0.0)
    apparent_mm = pad_mm / (sheet.pad_index or 1.0) + sheet.window_mm / (sheet.window_index or 1.0)
    rotation, translation = cam_from_sheet(camera)
    farther_mm = (pad_mm + sheet.window_mm - apparent_mm) * rotation[:, 2]
    return replace(camera, translation_mm=read_only(translation + farther_mm))


def _posed(camera: Camera, pose: np.ndarray) -> Camera:
    """The camera with a rotation vector and a translation (6,)."""
    return replace(
        camera, rotation_vector=read_only(pose[:3].copy()), translation_mm=read_only(pose[3:].copy())
    )


def _refine_pose(first: Camera, rest_mm: np.ndarray, place_px: Points2, sheet: Sheet | None) -> Camera:
    """Least-squares pose, starting from that of the camera."""
    from scipy.optimize import least_squares

    def residual(pose: np.ndarray) -> np.ndarray:
        return np.asarray((_seen(_posed(first, pose), sheet, rest_mm) - place_px).ravel())

    found = least_squares(
        residual,
        np.concatenate([first.rotation_vector, first.translation_mm]),
        x_scale=[0.01] * 3 + [1.0] * 3,
    )
    return _posed(first, found.x)


def pose_std_by_lens(
    camera: Camera, rest_mm: np.ndarray, sheet: Sheet | None = None
) -> Float64[np.ndarray, "6"]:
    """Deviations (6,) of a fitted pose by those of focal length, principal point and distortion.

    An error of the focal length moves the fitted sheet away by the same share, one of the principal point
    moves it to the side, and one of the distortion tilts it.

    Args:
        camera: in the fitted pose; deviations that it does not state are the defaults.
        rest_mm: (n, 3) markers in the sheet frame.
        sheet: a pad that is seen through its window; None or no window: nothing refracts.
    """
    std, here = camera_std(camera), _seen(camera, sheet, rest_mm)
    share = max(std.fx_px / camera.fx_px, std.fy_px / camera.fy_px)
    changed = [
        replace(camera, fx_px=camera.fx_px * (1.0 + share), fy_px=camera.fy_px * (1.0 + share)),
        replace(camera, cx_px=camera.cx_px + std.cx_px),
        replace(camera, cy_px=camera.cy_px + std.cy_px),
        *(
            replace(camera, distortion=camera.distortion + step)
            for step in np.diag(std.distortion)
            if step.any()
        ),
    ]
    moved_px = np.column_stack([(_seen(each, sheet, rest_mm) - here).ravel() for each in changed])
    answer, *_ = np.linalg.lstsq(_pose_slope(camera, rest_mm, sheet), moved_px, rcond=None)
    return np.asarray(np.sqrt(np.square(answer).sum(axis=1)))


def _pose_slope(camera: Camera, rest_mm: np.ndarray, sheet: Sheet | None) -> Float64[np.ndarray, "r 6"]:
    """Motion of the images of the markers by rotation vector and translation."""
    here = _seen(camera, sheet, rest_mm)
    columns = []
    for number, step in enumerate((1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4)):
        change = np.zeros(6)
        change[number] = step
        moved = replace(
            camera,
            rotation_vector=camera.rotation_vector + change[:3],
            translation_mm=camera.translation_mm + change[3:],
        )
        columns.append((_seen(moved, sheet, rest_mm) - here).ravel() / step)
    return np.stack(columns, axis=1)


def _pose_std(
    camera: Camera, rest_mm: np.ndarray, place_px: Points2, sheet: Sheet | None
) -> Float64[np.ndarray, "6"]:
    here, slope = _seen(camera, sheet, rest_mm), _pose_slope(camera, rest_mm, sheet)
    variance = float(np.square(here - place_px).sum()) / max(here.size - 6, 1)
    return np.asarray(np.sqrt(variance * np.diag(np.linalg.inv(slope.T @ slope))))
