"""The sensor that the methods are given for a case of any group."""

from dataclasses import replace

import numpy as np

from manytouch.evaluation.suite.calibrated.pad_sensor import calibrated_pad
from manytouch.evaluation.suite.calibrated.sheet_sensor import calibrated_sensor
from manytouch.evaluation.suite.cases import Case, SensorPerturbation
from manytouch.evaluation.suite.pads.cases import OwnPadCase, PadCase
from manytouch.evaluation.suite.pads.pad_sensors import given_pad
from manytouch.evaluation.suite.sensors import DESIGNED_WIDTH_PX, exact_sensor, true_sensor, with_all_dots
from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.evaluation.suite.varied.drawn_sensor import drawn_sensor
from manytouch.values import Sensor
from manytouch.values.arrays import read_only


def given_sensor(case: Case) -> Sensor:
    """The sensor as the methods are given it, always with all dots printed.

    - A bonded pad: `given_pad`, whose true numbers are stated to be exactly known; of `pads_calibrated`:
      `calibrated_pad` of its pad.
    - A case of the group `drawn`: `drawn_sensor`; of `calibrated`: `calibrated_sensor` of its sheet.
    - A case with a perturbation: the true sensor with it.
    - Any other case: the true sensor, whose sheet is stated to be exactly known.
    """
    if isinstance(case, OwnPadCase) and case.group == "pads_calibrated":
        return calibrated_pad(case.pad)
    if isinstance(case, PadCase):
        return exact_sensor(given_pad(case)) if case.group != "pads_nominal" else given_pad(case)
    true = with_all_dots(true_sensor(case))
    if isinstance(case, VariedCase) and case.group == "drawn":
        return drawn_sensor(case, true)
    if isinstance(case, VariedCase) and case.group == "calibrated":
        return calibrated_sensor(case.sheet)
    if isinstance(case, VariedCase) or case.perturbation == SensorPerturbation():
        return exact_sensor(true)
    return _perturbed(case, true)


def _perturbed(case: Case, true: Sensor) -> Sensor:
    """The true sensor with the perturbation of the case."""
    assert true.sheet is not None
    assert true.sheet.young_MPa is not None
    given, camera = case.perturbation, true.camera
    off_px = given.centre_off_px * case.width_px / DESIGNED_WIDTH_PX
    return replace(
        true,
        camera=replace(
            camera,
            fx_px=camera.fx_px * given.focal_factor,
            fy_px=camera.fy_px * given.focal_factor,
            cx_px=camera.cx_px + off_px,
            cy_px=camera.cy_px + off_px,
            distortion=camera.distortion if given.is_lens_known else read_only(np.zeros(5)),
        ),
        sheet=replace(
            true.sheet,
            thickness_mm=true.sheet.thickness_mm * given.thickness_factor,
            young_MPa=true.sheet.young_MPa * given.young_factor,
        ),
    )
