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


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("detect.least_sharee", "detect.least_share"),
        ("least_snr", "detect.least_snr"),
        ("bridge_frames", "estimate.contact_tracker.bridge_frames"),
        ("interpolation.knd", "interpolation.kind"),
    ],
)
def test_an_unknown_parameter_is_refused_with_the_nearest_names(name: str, nearest: str) -> None:
    pipeline = pipeline_for("mechanics")
    count = len(parameters_of(pipeline))
    with pytest.raises(
        ManytouchError, match=rf"no parameter '{name}': the nearest are .*{nearest}"
    ) as raised:
        with_parameter(pipeline, name, 1.0)
    assert str(raised.value).count("estimate.") <= 4
    assert f"all {count} are in the settings of the viewer" in str(raised.value)


def test_an_unknown_parameter_like_no_other_has_no_nearest_names() -> None:
    with pytest.raises(ManytouchError, match=r"no parameter 'qqqq': all \d+ are in the settings"):
        with_parameter(pipeline_for("mechanics"), "qqqq", 1.0)
