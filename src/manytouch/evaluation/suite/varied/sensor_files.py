"""Sensor files of the varied cases whose numbers have the errors of a calibration."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.values import Sensor
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.default_std import (
    FOCAL_SHARE,
    OUTLINE_STD_MM,
    POISSON_STD,
    PRETENSION_SHARE,
    ROTATION_STD_RAD,
    THICKNESS_SHARE,
    YOUNG_SHARE,
)

LARGEST_POISSON = 0.495
UNKNOWN_EVERY = 3
"""Every third file does not state the pretension."""


def drawn_sensor(case: VariedCase, true: Sensor) -> Sensor:
    """A file with errors of the size that it is taken to have where it states no deviations.

    Thickness 5 %, E 8 %, pretension 20 % or not stated, outline 0.3 mm on each side, pose 0.2 degrees, focal
    length 0.3 % (the distance, which is fitted to the picture at rest, goes with it), Poisson's ratio 0.02.
    """
    rng = np.random.default_rng(case.seed + 100_000)
    off = rng.standard_normal(12).clip(-2.5, 2.5).tolist()
    sheet, camera = true.sheet, true.camera
    assert sheet is not None
    assert sheet.poisson is not None
    focal = 1.0 + FOCAL_SHARE * off[0]
    turn = Rotation.from_rotvec(ROTATION_STD_RAD * np.array(off[1:4]))
    pose = turn * Rotation.from_rotvec(camera.rotation_vector.copy())
    is_unknown = int(case.seed) % UNKNOWN_EVERY == 0
    sides_mm = OUTLINE_STD_MM * np.array([off[4] + off[5], off[6] + off[7]])
    return replace(
        true,
        camera=replace(
            camera,
            fx_px=camera.fx_px * focal,
            fy_px=camera.fy_px * focal,
            rotation_vector=read_only(pose.as_rotvec()),
            translation_mm=read_only(camera.translation_mm * [1.0, 1.0, focal]),
        ),
        sheet=replace(
            sheet,
            size_mm=read_only(sheet.size_mm + sides_mm),
            thickness_mm=sheet.thickness_mm * (1.0 + THICKNESS_SHARE * off[8]),
            young_MPa=case.young_MPa * (1.0 + YOUNG_SHARE * off[9]),
            poisson=min(sheet.poisson + POISSON_STD * off[10], LARGEST_POISSON),
            pretension_N_per_mm=None
            if is_unknown
            else case.pretension_N_per_mm * (1.0 + PRETENSION_SHARE * off[11]),
        ),
    )
