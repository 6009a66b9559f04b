"""Pose of a flat sheet in the view of a camera, and its standard deviations."""

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float64

from manytouch.geometry.camera import camera_matrix, project
from manytouch.values import Camera
from manytouch.values.arrays import Points2, read_only


def fit_pose(
    camera: Camera, rest_mm: np.ndarray, place_px: Points2
) -> tuple[Camera, Float64[np.ndarray, "6"]]:
    """Fit the pose of the camera to the markers of a flat sheet; returns the camera and the pose
    deviations (6,).

    Args:
        camera: its intrinsic parameters are used, its pose is not.
        rest_mm: (n, 3) markers in the sheet frame.
        place_px: (n, 2) their measured positions in the image.
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
        _refine_pose(camera, rest_mm, place_px, rotations[k], translations[k]) for k in range(count)
    ]
    best = min(candidates, key=lambda posed: float(np.square(project(posed, rest_mm) - place_px).sum()))
    return best, _pose_std(best, rest_mm, place_px)


def _refine_pose(
    camera: Camera, rest_mm: np.ndarray, place_px: Points2, turn: np.ndarray, shift: np.ndarray
) -> Camera:
    """Least-squares pose, starting from a given one."""
    from scipy.optimize import least_squares

    def posed(pose: np.ndarray) -> Camera:
        return replace(
            camera, rotation_vector=read_only(pose[:3].copy()), translation_mm=read_only(pose[3:].copy())
        )

    def residual(pose: np.ndarray) -> np.ndarray:
        return np.asarray((project(posed(pose), rest_mm) - place_px).ravel())

    found = least_squares(
        residual, np.concatenate([np.ravel(turn), np.ravel(shift)]), x_scale=[0.01] * 3 + [1.0] * 3
    )
    return posed(found.x)


def _pose_std(camera: Camera, rest_mm: np.ndarray, place_px: Points2) -> Float64[np.ndarray, "6"]:
    here = project(camera, rest_mm)
    columns = []
    for number, step in enumerate((1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4)):
        change = np.zeros(6)
        change[number] = step
        moved = replace(
            camera,
            rotation_vector=camera.rotation_vector + change[:3],
            translation_mm=camera.translation_mm + change[3:],
        )
        columns.append((project(moved, rest_mm) - here).ravel() / step)
    slope = np.array(columns).T
    variance = float(np.square(here - place_px).sum()) / max(here.size - 6, 1)
    return np.sqrt(variance * np.diag(np.linalg.inv(slope.T @ slope)))
