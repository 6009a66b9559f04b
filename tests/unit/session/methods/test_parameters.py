"""Parameters of pipelines by name. What a session does with them is tested with the session."""

import pytest

from manytouch.errors import ManytouchError
from manytouch.session.methods import choices_of, parameters_of, pipeline_for, with_parameter


def test_what_is_automatic_can_be_fixed_and_be_automatic_again() -> None:
    pipeline = pipeline_for("paper")
    assert parameters_of(pipeline)["detect.threshold"] is None
    fixed = with_parameter(pipeline, "detect.threshold", 120.0)
    assert (fixed.detect.threshold, parameters_of(fixed)["detect.threshold"]) == (120, 120)
    assert parameters_of(with_parameter(fixed, "detect.threshold", None)) == parameters_of(pipeline)
    with pytest.raises(ManytouchError, match="or left automatic, not inf"):
        with_parameter(pipeline, "track.gate_px", float("inf"))
    with pytest.raises(ManytouchError, match="must be a number, not otsu"):
        with_parameter(pipeline, "detect.threshold", "otsu")
    assert choices_of(pipeline)["estimate.formula"][:2] == ("corrected", "printed")
