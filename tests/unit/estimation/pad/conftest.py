"""One started pad for all tests of this folder."""

import pytest

from bonded_pad import pad_sensor
from manytouch.estimation.pad.estimator import PadEstimator, PadState


@pytest.fixture(scope="session")
def pad_state() -> PadState:
    return PadEstimator().start(pad_sensor())
