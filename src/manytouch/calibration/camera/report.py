"""Report of a camera calibration: text, ROS `camera_info`, JSON and a plot."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manytouch.calibration.camera.board_views import PARTS
from manytouch.calibration.camera.calibrate import CameraCalibration
from manytouch.errors import MissingExtraError, OutputError
from manytouch.geometry.camera import camera_matrix
from manytouch.values import Camera, Sensor
from manytouch.values.arrays import read_only

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GOOD_RMS_PX = 0.5
ARROW_LENGTH_PX = 14.0
"""Length of the median residual in the plot, at an image width of 640 px."""


def describe(calibration: CameraCalibration) -> list[str]:
    """Lines of text: parameters, standard deviations and warnings."""
    found, camera = calibration.intrinsics, calibration.intrinsics.camera
    std, points = found.std, sum(len(part) for part in found.residual_px)
    window = calibration.half_window_px
    how = (
        ""
        if window is None
        else f"; corners refined in windows of {2 * window + 1} px, the best of those tried"
    )
    names = ("k1", "k2", "p1", "p2", "k3") if camera.model == "pinhole" else ("k1", "k2", "k3", "k4")
    lines = [
        f"{len(calibration.views)} views of a {calibration.board}, {points} points, "
        f"{len(calibration.refused)} images rejected{how}",
        f"focal length {camera.fx_px:.2f} ± {std['fx_px']:.2f}, {camera.fy_px:.2f} ± {std['fy_px']:.2f} px",
        f"optical centre {camera.cx_px:.2f} ± {std['cx_px']:.2f}, {camera.cy_px:.2f} ± {std['cy_px']:.2f} px",
        "distortion "
        + ", ".join(
            f"{name} {value:.5f} ± {std[name]:.5f}"
            if std[name]
            else f"{name} 0 (not significantly different from 0)"
            for name, value in zip(names, camera.distortion.tolist(), strict=True)
        ),
        f"residual {found.rms_px:.3f} px (RMS), view by view {found.view_rms_px.min():.2f} to "
        f"{found.view_rms_px.max():.2f} px",
    ]
    parts = calibration.part_rms_px
    lines.append(
        "by part of the image "
        + ", ".join(
            f"{name} {'no point' if np.isnan(rms) else f'{rms:.2f}'}"
            for name, rms in zip(PARTS, parts, strict=True)
        )
    )
    lines += [f"rejected: {name} {reason}" for name, reason in calibration.refused]
    if found.rms_px > GOOD_RMS_PX:
        lines.append(
            f"warning: a residual of {found.rms_px:.2f} px is large (usually below {GOOD_RMS_PX:g} px): "
            "check that the board is flat, that its size is correct and that the focus of the camera is "
            "fixed"
        )
    if calibration.missing:
        lines.append(f"views still missing: {'; '.join(calibration.missing)}")
    return lines


def to_dict(calibration: CameraCalibration) -> dict[str, Any]:
    """Contents of calibration.json."""
    found, camera = calibration.intrinsics, calibration.intrinsics.camera
    return {
        "board": str(calibration.board),
        "square_mm": calibration.board.square_mm,
        "model": camera.model,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "camera_matrix": camera_matrix(camera).tolist(),
        "new_camera_matrix": found.new_matrix.tolist(),
        "distortion": camera.distortion.tolist(),
        "std": found.std,
        "rms_px": found.rms_px,
        "half_window_px": calibration.half_window_px,
        "views": [
            {"name": view.name, "rms_px": rms, "points": len(view.detection.number), "edge_px": view.edge_px}
            for view, rms in zip(calibration.views, found.view_rms_px.tolist(), strict=True)
        ],
        "parts_rms_px": {
            name: None if np.isnan(rms) else rms
            for name, rms in zip(PARTS, calibration.part_rms_px.tolist(), strict=True)
        },
        "refused": [{"name": name, "reason": reason} for name, reason in calibration.refused],
        "missing": list(calibration.missing),
    }


def camera_info_yaml(camera: Camera, new_matrix: np.ndarray, name: str) -> str:
    """ROS `camera_info` as `camera_calibration_parsers` reads it."""
    projection = np.hstack([new_matrix, np.zeros((3, 1))])
    lines = [
        f"image_width: {camera.width_px}",
        f"image_height: {camera.height_px}",
        f"camera_name: {json.dumps(name)}",
        *_matrix("camera_matrix", camera_matrix(camera)),
        f"distortion_model: {'equidistant' if camera.model == 'fisheye' else 'plumb_bob'}",
        *_matrix("distortion_coefficients", camera.distortion[None]),
        *_matrix("rectification_matrix", np.eye(3)),
        *_matrix("projection_matrix", projection),
    ]
    return "\n".join(lines) + "\n"


def write_report(calibration: CameraCalibration, folder: Path, name: str) -> None:
    """Write coverage.png, calibration.json and camera_info.yaml.

    Raises:
        OutputError: the folder cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    found = calibration.intrinsics
    try:
        folder.mkdir(parents=True, exist_ok=True)
        numbers = json.dumps(to_dict(calibration), indent=1)
        (folder / "calibration.json").write_text(numbers + "\n", encoding="utf-8")
        ros = camera_info_yaml(found.camera, found.new_matrix, name)
        (folder / "camera_info.yaml").write_text(ros, encoding="utf-8")
        draw_coverage(calibration, folder / "coverage.png")
    except OSError as error:
        raise OutputError(f"cannot write the report into {folder}: {error.strerror}") from None


def draw_coverage(calibration: CameraCalibration, path: Path) -> None:
    """Draw the coverage of the image by the board and the residuals as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("the coverage plot", "matplotlib", "lab") from None
    camera = calibration.intrinsics.camera
    figure = Figure(figsize=(12.0, 0.8 + 6.0 * camera.height_px / camera.width_px), layout="constrained")
    seen, left = figure.subplots(1, 2)
    _draw_views(seen, calibration)
    _draw_residuals(left, calibration)
    figure.savefig(path, dpi=110)


def _draw_views(axes: "Axes", calibration: CameraCalibration) -> None:
    from matplotlib.patches import Polygon
    from scipy.spatial import ConvexHull

    for view in calibration.views:
        place = view.detection.place_px
        axes.add_patch(Polygon(place[ConvexHull(place).vertices], fc="#0072b2", alpha=0.10, ec="none"))
        axes.plot(*place.T, ".", ms=2, color="#004a75")
    axes.set_title(f"{len(calibration.views)} views of the board; darker where more views overlap")
    _frame(axes, calibration)


def _draw_residuals(axes: "Axes", calibration: CameraCalibration) -> None:
    residual = np.concatenate(calibration.intrinsics.residual_px)
    place = np.concatenate([view.detection.place_px for view in calibration.views])
    length = np.hypot(*residual.T)
    scale = ARROW_LENGTH_PX * calibration.intrinsics.camera.width_px / 640 / float(np.median(length))
    drawn = axes.quiver(
        *place.T,
        *(scale * residual.T),
        length,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.002,
        cmap="viridis_r",
        clim=(0.0, float(np.quantile(length, 0.98))),
    )
    axes.figure.colorbar(drawn, ax=axes, label="distance of measured and predicted point, px", shrink=0.85)
    axes.set_title(f"residuals, scaled by {scale:.0f}; RMS {calibration.intrinsics.rms_px:.3f} px")
    _frame(axes, calibration)


def _frame(axes: "Axes", calibration: CameraCalibration) -> None:
    camera = calibration.intrinsics.camera
    for share in (1 / 3, 2 / 3):
        axes.axvline(share * camera.width_px - 0.5, color="0.8", lw=0.6, zorder=0)
        axes.axhline(share * camera.height_px - 0.5, color="0.8", lw=0.6, zorder=0)
    axes.set(xlim=(-0.5, camera.width_px - 0.5), ylim=(camera.height_px - 0.5, -0.5), aspect="equal")
    axes.set(xlabel="x, px", ylabel="y, px")


def _matrix(name: str, values: np.ndarray) -> list[str]:
    numbers = ", ".join(f"{value:.10g}" for value in values.ravel())
    return [f"{name}:", f"  rows: {values.shape[0]}", f"  cols: {values.shape[1]}", f"  data: [{numbers}]"]


def calibrated_camera(calibration: CameraCalibration, name: str) -> Sensor:
    """A sensor with the calibrated camera and its deviations only; its provenance has board and residuals."""
    found, board = calibration.intrinsics, calibration.board
    provenance = {
        "camera": (
            f"calibrated from {len(calibration.views)} views of a {board}, square {board.square_mm:g} mm"
        ),
        "camera_rms_px": round(found.rms_px, 4),
        "new_camera_matrix": found.new_matrix.tolist(),
    }
    camera = replace(
        found.camera,
        fx_std_px=found.std["fx_px"],
        fy_std_px=found.std["fy_px"],
        cx_std_px=found.std["cx_px"],
        cy_std_px=found.std["cy_px"],
        distortion_std=read_only(np.array([value for name, value in found.std.items() if "_px" not in name])),
    )
    return Sensor(name=name, camera=camera, provenance=provenance)
