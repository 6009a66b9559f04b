"""Tables of presses that are damaged, hostile or too large are refused with a sentence."""

from pathlib import Path

import pytest

from manytouch.calibration.sheet import press_table
from manytouch.calibration.sheet.press_parser import PressContext, parse_press
from manytouch.calibration.sheet.press_table import read_press_table
from manytouch.errors import ManytouchError, SensorError
from manytouch.simulation.demo_sensor import demo_sensor

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
