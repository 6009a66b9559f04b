"""Standard deviations of the numbers of a sensor, with defaults where its file does not state them.

The defaults are realistic errors of a careful installation without calibration (docs/sensor-file.md).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.values.arrays import read_only, reduced
from manytouch.values.sensor import Camera, Sheet

THICKNESS_SHARE = 0.05
YOUNG_SHARE = 0.08
PRETENSION_SHARE = 0.2
POISSON_STD = 0.02
ASSUMED_POISSON_STD = 0.05  # of a clamped sheet whose file does not state it: rubbers 0.45 to 0.5, foams 0.3
OUTLINE_STD_MM = 0.3
BENDING_SHARE = 0.0  # the factor is 1 unless it was calibrated
FOCAL_SHARE = 0.003
ROTATION_STD_RAD = float(np.deg2rad(0.2))
TRANSLATION_SHARE = 0.003  # of the distance, which follows from the focal length
MARKER_DEPTH_SHARE = 0.05
WINDOW_SHARE = 0.02
INDEX_STD = 0.01


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetStd:
    """Standard deviations of a sheet's numbers; None where the number itself is unknown.

    Attributes:
        outline_mm: of each side of the outline.
        thickness_mm, young_MPa, poisson, pretension_N_per_mm, bending_factor: of these.
        marker_depth_mm, window_mm, window_index, pad_index: of these, of a bonded pad.
    """

    outline_mm: float
    thickness_mm: float
    young_MPa: float | None
    poisson: float | None
    pretension_N_per_mm: float | None
    bending_factor: float | None
    marker_depth_mm: float | None
    window_mm: float | None
    window_index: float | None
    pad_index: float | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CameraStd:
    """Standard deviations of a camera's numbers.

    Attributes:
        fx_px, fy_px, cx_px, cy_px, distortion: of the intrinsic parameters.
        rotation_vector: (3,) of the pose, rad.
        translation_mm: (3,) of the pose.
    """

    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: Float64[np.ndarray, " d"]
    rotation_vector: Float64[np.ndarray, "3"]
    translation_mm: Float64[np.ndarray, "3"]

    __reduce__ = reduced


def sheet_std(sheet: Sheet) -> SheetStd:
    """What the sheet states, and defaults for the rest."""
    return SheetStd(
        outline_mm=OUTLINE_STD_MM if sheet.outline_std_mm is None else sheet.outline_std_mm,
        thickness_mm=THICKNESS_SHARE * sheet.thickness_mm
        if sheet.thickness_std_mm is None
        else sheet.thickness_std_mm,
        young_MPa=_or_default(sheet.young_MPa, sheet.young_std_MPa, share=YOUNG_SHARE),
        poisson=_or_default(sheet.poisson, sheet.poisson_std, least=POISSON_STD),
        pretension_N_per_mm=_or_default(
            sheet.pretension_N_per_mm, sheet.pretension_std_N_per_mm, share=PRETENSION_SHARE
        ),
        bending_factor=_or_default(sheet.bending_factor, sheet.bending_factor_std, share=BENDING_SHARE),
        marker_depth_mm=_or_default(
            sheet.marker_depth_mm, sheet.marker_depth_std_mm, share=MARKER_DEPTH_SHARE
        ),
        window_mm=_or_default(sheet.window_mm, sheet.window_std_mm, share=WINDOW_SHARE),
        window_index=_or_default(sheet.window_index, sheet.window_index_std, least=INDEX_STD),
        pad_index=_or_default(sheet.pad_index, sheet.pad_index_std, least=INDEX_STD),
    )


def camera_std(camera: Camera) -> CameraStd:
    """What the camera states, and defaults for the rest.

    That of the principal point is the default of the focal length: both move the image by about as much as
    the default of the rotation. That of the distortion is 0.
    """
    distance_mm = abs(float(camera.translation_mm[2]))

    def known(stated: np.ndarray | None, default: np.ndarray) -> np.ndarray:
        return read_only(default) if stated is None else stated

    def number(stated: float | None, focal_px: float) -> float:
        return FOCAL_SHARE * focal_px if stated is None else stated

    return CameraStd(
        fx_px=number(camera.fx_std_px, camera.fx_px),
        fy_px=number(camera.fy_std_px, camera.fy_px),
        cx_px=number(camera.cx_std_px, camera.fx_px),
        cy_px=number(camera.cy_std_px, camera.fy_px),
        distortion=known(camera.distortion_std, np.zeros(len(camera.distortion))),
        rotation_vector=known(camera.rotation_vector_std, np.full(3, ROTATION_STD_RAD)),
        translation_mm=known(camera.translation_std_mm, np.full(3, TRANSLATION_SHARE * distance_mm)),
    )


def _or_default(
    value: float | None, stated: float | None, *, share: float = 0.0, least: float = 0.0
) -> float | None:
    if value is None or stated is not None:
        return stated
    return max(share * value, least)
