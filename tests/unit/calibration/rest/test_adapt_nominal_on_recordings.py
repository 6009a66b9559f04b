"""Nominal sensor files on recordings of real sensors; skipped where these are absent."""

import itertools
from pathlib import Path

import numpy as np
import pytest

import manytouch
from manytouch.calibration.rest.adapt_nominal import register_nominal
from manytouch.errors import LayoutError
from manytouch.values.sensor_file.read import load_sensor

SHARED = Path(__file__).resolve().parents[5] / "shared" / "data"


def registered(path: Path, sensor: str) -> manytouch.Sensor:
    if not path.exists():
        pytest.skip("the recordings are not there")
    return register_nominal(load_sensor(sensor), list(itertools.islice(manytouch.open_source(path), 15)))


def test_a_nominal_lattice_that_a_survey_sees_in_part_is_kept() -> None:
    found = registered(SHARED / "um_fingervision" / "images", "fingervision-um")
    assert found.layout is not None
    assert found.layout.shape == (7, 5)
    assert not any("were found" in sentence for sentence in found.assumptions)


@pytest.mark.parametrize(
    ("name", "shape", "pitch_mm"),
    [
        pytest.param("gelsight_mini_grip/giraffe7.avi", (5, 7), 2.8, marks=pytest.mark.slow),
        pytest.param("gelsight_mini_grip/ball7.avi", (5, 7), 2.8, marks=pytest.mark.slow),
        ("gsrobotics/mini_example.avi", (7, 10), 2.0),
    ],
)
def test_other_prints_of_a_gel_have_their_own_pitch(
    name: str, shape: tuple[int, int], pitch_mm: float
) -> None:
    nominal, found = load_sensor("gelsight-mini"), registered(SHARED / name, "gelsight-mini")
    assert found.layout is not None
    assert found.layout.shape == shape
    assert float(np.sqrt(np.prod(found.layout.pitch_mm))) == pytest.approx(pitch_mm, rel=0.03)
    assert found.camera.translation_mm[2] == pytest.approx(nominal.camera.translation_mm[2], rel=0.05)
    assert not any("were not seen" in sentence for sentence in found.assumptions)


@pytest.mark.slow  # test_adapt_nominal.py refuses drawn markers of another sensor
def test_a_recording_of_another_sensor_is_refused() -> None:
    path = SHARED / "fingervision" / "cam1_0002_first900.mp4"
    with pytest.raises(LayoutError, match=r"no dots|from no place|of another sensor"):
        registered(path, "fingervision-um")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "touched"),
    [("gelsight_mini_grip/ball7.avi", (20, 80)), ("gsrobotics/mini_example.avi", (100, 140))],
)
def test_one_object_on_a_gel_is_one_contact_with_a_nominal_file(name: str, touched: tuple[int, int]) -> None:
    path = SHARED / name
    if not path.exists():
        pytest.skip("the recordings are not there")
    readings = manytouch.prepare(path, sensor="gelsight-mini").readings()
    counts = [len(reading.contacts.touching) for reading in itertools.islice(readings, touched[1])]
    during = np.array(counts[slice(*touched)])
    assert (during > 0).mean() > 0.95
    assert (during == 1).mean() > 0.9
