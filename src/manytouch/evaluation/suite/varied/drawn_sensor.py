"""Sensors of the group `drawn`, whose numbers have errors that are sampled at random."""

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
"""Every third sensor does not state the pretension."""


def drawn_sensor(case: VariedCase, true: Sensor) -> Sensor:
    """The sensor of a case of the group `drawn`: the true one with randomly sampled errors.

    The sensor as a careful user would state it: each number below differs from the true one by a normal error
    with the default standard deviation of sensor files (`default_std`), limited to 2.5 deviations: thickness
    5 %, E 8 %, pretension 20 %, outline 0.3 mm on each side, rotation 0.2 degrees about each axis, focal
    length 0.3 %, Poisson's ratio 0.02, but at most `LARGEST_POISSON`. The distance is multiplied by the same
    factor as the focal length. Every third case states no pretension. The seed of the case determines the
    errors.

    Args:
        case: whose numbers are stated.
        true: its true sensor.
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
