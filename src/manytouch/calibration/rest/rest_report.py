"""A calibration at rest as lines of text."""

from collections.abc import Iterator

import numpy as np

from manytouch.calibration.outline.clamp_line import describe as describe_clamp
from manytouch.calibration.rest.rest_calibration import RestCalibration


def describe(calibration: RestCalibration) -> Iterator[str]:
    """Lines about layout, pose, residuals and clamp line, and the warnings."""
    camera, layout = calibration.sensor.camera, calibration.sensor.layout
    assert layout is not None
    count = f"{len(layout.rest_mm)}" if layout.shape is None else f"{layout.shape[0]} x {layout.shape[1]}"
    rotation_deg, shift_mm = np.rad2deg(camera.rotation_vector), camera.translation_mm
    rotation_std, shift_std = np.rad2deg(calibration.pose_std[:3]), calibration.pose_std[3:]
    yield f"{count} markers, {int(layout.is_missing.sum())} missing, {_frames_used(calibration)}"
    yield (
        f"distance of the sheet {shift_mm[2]:.2f} ± {shift_std[2]:.2f} mm, offset from the optical axis "
        f"{shift_mm[0]:.2f}, {shift_mm[1]:.2f} mm"
    )
    yield (
        f"rotation {rotation_deg[0]:.3f}, {rotation_deg[1]:.3f}, {rotation_deg[2]:.3f} ± "
        f"{rotation_std.max():.3f} degrees about x, y, z"
    )
    yield (
        f"residual from a flat lattice {calibration.rms_px:.3f} px (RMS), "
        f"noise {calibration.noise_px:.3f} px, contrast {calibration.contrast:.0f} grey levels"
    )
    yield describe_clamp(calibration.clamp, calibration.sensor.sheet)
    yield from (f"warning: {sentence}" for sentence in calibration.warnings)


def _frames_used(calibration: RestCalibration) -> str:
    first, last = calibration.first_and_last
    left_out = calibration.frames_given - calibration.frames
    used = "the frame" if calibration.frames == 1 else f"{calibration.frames} of the frames {first} to {last}"
    return f"measured in {used}, in which they stay within {calibration.motion_px:.2f} px" + (
        f"; {left_out} of {calibration.frames_given} frames were left out, because markers move in them"
        if left_out
        else ""
    )
