"""Intrinsic parameters of a camera from views of a board, with standard deviations.

Model: OpenCV's pinhole (Brown-Conrady, k1 k2 p1 p2 k3) or fisheye (k1..k4). The fit is OpenCV's (Z. Zhang,
doi:10.1109/34.888718); deviations come from the normal matrix of all unknowns, poses included.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float64

from manytouch.calibration.camera.board import Board, BoardDetection
from manytouch.errors import ManytouchError
from manytouch.values import Camera
from manytouch.values.arrays import Points2, read_only

Model = Literal["pinhole", "fisheye"]
NAMES: dict[Model, tuple[str, ...]] = {
    "pinhole": ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "k4"),
}
LEAST_VIEWS = 4
_POSE = 6
_LEAST_DEVIATIONS = 2.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Intrinsics:
    """Intrinsic parameters fitted to views of a board.

    Attributes:
        camera: with a placeholder pose.
        std: deviation of each parameter, by the names in `NAMES`; 0 if it is fixed at 0.
        residual_px: for each view (n, 2), measured minus predicted.
        rms_px: RMS distance of measured and predicted points.
        new_matrix: (3, 3) of a camera without distortion that shows only what this camera images, without
            borders (OpenCV's new camera matrix at alpha 0).
    """

    camera: Camera
    std: dict[str, float] = field(default_factory=dict)
    residual_px: tuple[Points2, ...]
    rms_px: float
    new_matrix: Float64[np.ndarray, "3 3"]

    @property
    def view_rms_px(self) -> Float64[np.ndarray, " v"]:
        """(v,) root of the mean squared distance, view by view."""
        return np.array([np.sqrt((part**2).sum(axis=1).mean()) for part in self.residual_px])


def fit_intrinsics(
    board: Board,
    detections: Sequence[BoardDetection],
    *,
    width_px: int,
    height_px: int,
    model: Model = "pinhole",
) -> Intrinsics:
    """Fit a camera to views of a board.

    The third radial coefficient of a pinhole is fixed at 0 if its estimate lies within two standard
    deviations
    of 0.

    Raises:
        ManytouchError: fewer than `LEAST_VIEWS` views, or no camera fits them.
    """
    if len(detections) < LEAST_VIEWS:
        raise ManytouchError(
            f"{len(detections)} good views of the board are too few: at least {LEAST_VIEWS} are needed, "
            "better 15, with the board tilted in different directions, near and far, and in every corner"
        )
    found = _fit(board, detections, (width_px, height_px), model, has_k3=True)
    if model == "pinhole" and abs(found.camera.distortion[4]) < _LEAST_DEVIATIONS * found.std["k3"]:
        found = _fit(board, detections, (width_px, height_px), model, has_k3=False)
    return found


def _fit(
    board: Board,
    detections: Sequence[BoardDetection],
    size_px: tuple[int, int],
    model: Model,
    *,
    has_k3: bool,
) -> Intrinsics:
    point_mm = [board.point_mm[detection.number] for detection in detections]
    place_px = [np.ascontiguousarray(detection.place_px) for detection in detections]
    try:
        matrix, distortion, poses = _fit_with_opencv(point_mm, place_px, size_px, model, has_k3=has_k3)
    except cv2.error as error:
        raise ManytouchError(
            f"no {model} camera fits the {len(detections)} views "
            f"({str(error.err).strip() or 'no solution'}): take views with the board tilted by 20 to "
            "45 degrees in different directions, and check the size of the board"
        ) from None
    free = np.ones(len(NAMES[model]), dtype=np.bool_)
    if model == "pinhole" and not has_k3:
        free[8] = False
    residual, derivative = _residuals_and_derivatives(point_mm, place_px, matrix, distortion, poses)
    std = _deviations(residual, derivative, free)
    width, height = size_px
    camera = Camera(
        model=model,
        width_px=width,
        height_px=height,
        fx_px=float(matrix[0, 0]),
        fy_px=float(matrix[1, 1]),
        cx_px=float(matrix[0, 2]),
        cy_px=float(matrix[1, 2]),
        distortion=read_only(distortion),
        rotation_vector=read_only(np.zeros(3)),
        translation_mm=read_only(np.array([0.0, 0.0, 1.0])),
    )
    squares = np.concatenate([(part**2).sum(axis=1) for part in residual])
    return Intrinsics(
        camera=camera,
        std=dict(zip(NAMES[model], std.tolist(), strict=True)),
        residual_px=tuple(read_only(part) for part in residual),
        rms_px=float(np.sqrt(squares.mean())),
        new_matrix=read_only(new_matrix(camera)),
    )


def new_matrix(camera: Camera) -> Float64[np.ndarray, "3 3"]:
    """Matrix of an undistorted camera whose image lies completely inside that of this camera."""
    from manytouch.geometry.camera import camera_matrix

    size = (camera.width_px, camera.height_px)
    if camera.model == "fisheye":
        found = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(
            camera_matrix(camera), camera.distortion, size, np.eye(3), balance=0.0
        )
    else:
        found, _ = cv2.getOptimalNewCameraMatrix(camera_matrix(camera), camera.distortion, size, 0.0)
    return np.asarray(found, dtype=np.float64)


def _fit_with_opencv(
    point_mm: list[np.ndarray],
    place_px: list[np.ndarray],
    size_px: tuple[int, int],
    model: Model,
    *,
    has_k3: bool,
) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-10)
    if model == "fisheye":
        _, matrix, distortion, turn, shift = cv2.fisheye.calibrate(
            [part.reshape(1, -1, 3) for part in point_mm],
            [part.reshape(1, -1, 2) for part in place_px],
            size_px,
            np.eye(3),
            np.zeros(4),
            flags=cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW,
            criteria=stop,
        )
    else:
        _, matrix, distortion, turn, shift = cv2.calibrateCamera(
            [part.astype(np.float32) for part in point_mm],
            [part.astype(np.float32) for part in place_px],
            size_px,
            None,
            None,
            flags=0 if has_k3 else cv2.CALIB_FIX_K3,
            criteria=stop,
        )
    poses = [(np.ravel(r), np.ravel(t)) for r, t in zip(turn, shift, strict=True)]
    numbers = 4 if model == "fisheye" else 5
    return np.asarray(matrix), np.asarray(distortion, dtype=np.float64).ravel()[:numbers], poses


def _residuals_and_derivatives(
    point_mm: list[np.ndarray],
    place_px: list[np.ndarray],
    matrix: np.ndarray,
    distortion: np.ndarray,
    poses: list[tuple[np.ndarray, np.ndarray]],
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Residuals (n, 2) and derivatives (2 n, 6 + p) to pose and parameters, view by view."""
    residual, derivative = [], []
    model: Model = "fisheye" if len(distortion) == 4 else "pinhole"
    project = cv2.fisheye.projectPoints if model == "fisheye" else cv2.projectPoints
    own = len(NAMES[model])
    for point, place, (turn, shift) in zip(point_mm, place_px, poses, strict=True):
        predicted, slope = project(
            np.ascontiguousarray(point).reshape(-1, 1, 3),
            turn.reshape(3, 1),
            shift.reshape(3, 1),
            matrix,
            distortion,
        )
        # OpenCV's order: a pinhole has pose, f, c, distortion; a fisheye f, c, distortion, pose, skew.
        slope = np.asarray(slope)
        by_pose = slope[:, own : own + _POSE] if model == "fisheye" else slope[:, :_POSE]
        by_own = slope[:, :own] if model == "fisheye" else slope[:, _POSE : _POSE + own]
        residual.append(place - np.asarray(predicted).reshape(-1, 2))
        derivative.append(np.hstack([by_pose, by_own]))
    return residual, derivative


def _deviations(residual: list[np.ndarray], derivative: list[np.ndarray], free: np.ndarray) -> np.ndarray:
    """Standard deviations of the camera's own parameters; the poses are eliminated (Schur complement)."""
    count = int(free.sum())
    reduced = np.zeros((count, count))
    for slope in derivative:
        by_pose, by_own = slope[:, :_POSE], slope[:, _POSE:][:, free]
        across = by_pose.T @ by_own
        reduced += by_own.T @ by_own - across.T @ np.linalg.solve(by_pose.T @ by_pose, across)
    numbers = sum(part.size for part in residual)
    variance = sum(float((part**2).sum()) for part in residual) / (numbers - count - _POSE * len(residual))
    std = np.zeros(len(free))
    std[free] = np.sqrt(variance * np.diag(np.linalg.inv(reduced)))
    return std
