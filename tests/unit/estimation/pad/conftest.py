"""One started pad for all tests of this folder."""

import pytest

from bonded_pad import pad_sensor
from manytouch.estimation.pad.estimator import PadEstimator, PadState
from manytouch.estimation.pad.pad_model import NominalPad


@pytest.fixture(scope="session")
def pad_state() -> PadState:
    return PadEstimator(nominal_pad=NominalPad(element_thickness=0.4)).start(pad_sensor())
