"""Tables of presses that are damaged, hostile or too large are refused with a sentence."""

from pathlib import Path

import pytest

from manytouch.calibration.sheet import press_table
from manytouch.calibration.sheet.press_parser import PressContext, parse_press
from manytouch.calibration.sheet.press_table import measure_presses, read_press_table
from manytouch.calibration.sheet.typed_presses import read_typed_presses
from manytouch.errors import ManytouchError, SensorError
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values.sensor_file.read import load_sensor

HEAD = "input,x_mm,y_mm,normal_force_N\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (HEAD + "a.mp4,nan,0,1\n", "x_mm = nan, expected"),
        (HEAD + "a.mp4,0,inf,1\n", "y_mm = inf, expected"),
        (HEAD + "a.mp4,0,0,1e999\n", "normal_force_N = inf, expected"),
        (HEAD + "a.mp4,0,0,1,2,3\n", "more values than there are columns"),
        (HEAD + "a" * 200_000 + ",0,0,1\n", "not valid CSV"),
        (HEAD + '"a.mp4,0,0,1\n', "not valid CSV"),
        (b"input,x_mm\xff", "cannot be read"),
        (b"", "missing: input"),
    ],
)
def test_damaged_tables_are_refused(tmp_path: Path, content: str | bytes, words: str) -> None:
    path = tmp_path / "presses.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ManytouchError, match=words):
        read_press_table(path)


TILTED = "input,x_mm,y_mm,weight_N,tilt_x_deg,tilt_y_deg,normal_force_N\n"


def test_a_weight_on_a_tilted_sensor_pulls_along_gravity(tmp_path: Path) -> None:
    path = tmp_path / "presses.csv"
    path.write_text(TILTED + "a.mp4,0,0,2,30,0,\na.mp4,0,0,2,15,-15,\na.mp4,0,0,2,,,\na.mp4,0,0,,,,1.5\n")
    steep, skew, level, scale = read_press_table(path)
    assert steep.shear_N == pytest.approx((1.0, 0.0))
    assert steep.force_N == pytest.approx(3.0**0.5)
    assert skew.shear_N is not None
    assert skew.force_N is not None
    assert skew.shear_N[0] == pytest.approx(-skew.shear_N[1])
    assert skew.shear_N[0] ** 2 + skew.shear_N[1] ** 2 + skew.force_N**2 == pytest.approx(4.0)
    assert (level.shear_N, level.force_N) == ((0.0, 0.0), 2.0)
    assert (scale.shear_N, scale.force_N) == (None, 1.5)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("a.mp4,0,0,2,30,0,1", "both weight_N and normal_force_N"),
        ("a.mp4,0,0,,30,0,1", "a tilt needs weight_N"),
        ("a.mp4,0,0,2,70,0,", "at most 60 degrees"),
        ("a.mp4,0,0,2,50,50,", "steeper than upright"),
        ("a.mp4,0,0,-2,5,5,", "weight_N = -2, expected a positive"),
        ("a.mp4,0,0,2,x,0,", "tilt_x_deg = 'x' is not a number"),
    ],
)
def test_impossible_weights_are_refused(tmp_path: Path, row: str, words: str) -> None:
    path = tmp_path / "presses.csv"
    path.write_text(TILTED + row + "\n")
    with pytest.raises(SensorError, match=words):
        read_press_table(path)


def test_large_tables_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "presses.csv"
    path.write_text(HEAD + "a.mp4,0,0,1\n" * 11)
    monkeypatch.setattr(press_table, "MAX_PRESSES", 11)
    assert len(read_press_table(path)) == 11
    monkeypatch.setattr(press_table, "MAX_PRESSES", 10)
    with pytest.raises(ManytouchError, match="at most 10 presses"):
        read_press_table(path)


def test_typed_numbers_have_limits() -> None:
    sheet = demo_sensor().sheet
    assert sheet is not None
    context = PressContext(input="camera", begin_s=None, end_s=None, sheet=sheet)
    for text in ("0,0 " + "9" * 150 + " N", "0,0 " + "1" * 300, "9" * 180 + ",0"):
        with pytest.raises(SensorError, match=r"at most|outside"):
            parse_press(text, 1, context)


def test_a_nominal_sensor_must_be_calibrated_at_rest_first() -> None:
    nominal = load_sensor("gelsight-mini")
    with pytest.raises(SensorError, match="calibrate rest RECORDING --sensor FILE --out"):
        measure_presses(nominal, (), Path())
    with pytest.raises(SensorError, match="calibrate rest"):
        read_typed_presses(nominal, "sim:pad", Path("presses.csv"), report=print)
