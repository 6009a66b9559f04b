"""Readings of an untouched sheet."""

import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from rest import rest, untouched  # noqa: E402


def test_an_untouched_sheet_has_no_contacts_and_a_depth_within_its_deviation() -> None:
    found = rest("mechanics", frames=30, noise=5.0, width_px=1280)
    assert found.frames == 30
    assert found.touched == 0
    assert found.not_ok == 0
    assert 0.0 < found.depth_rms_mm < 1.2 * found.std_rms_mm
    assert found.deepest_mm < 0.05


def test_each_frame_has_its_own_noise() -> None:
    _, frames = untouched(2, 5.0, 640)
    one, other = (frame.image.astype(float) for frame in frames if frame.image is not None)
    assert (one - other).std() == pytest.approx(5.0 * 2**0.5, rel=0.2)
