"""Prompts for presses line by line: what was typed is kept, of a recording and before a camera."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.calibration.sheet import typed_presses as dialogue
from manytouch.calibration.sheet.press_table import measure_presses, read_press_table
from manytouch.calibration.sheet.typed_presses import typed_presses
from manytouch.errors import OutputError, SensorError
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sources import open_source
from manytouch.values import Frame, Setting

WIDTH_PX = 1280


class Person:
    """Answers from a list; an exception in it happens while the line is typed."""

    def __init__(self, *answers: str | BaseException) -> None:
        self.answers, self.heard, self.asked = list(answers), [], []

    def ask(self, prompt: str) -> str:
        self.asked.append(prompt)
        answer = self.answers.pop(0) if self.answers else EOFError()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def typed(self, source: str, table: Path, sensor=None):
        sensor = demo_sensor(WIDTH_PX) if sensor is None else sensor
        return typed_presses(sensor, source, table, say=self.heard.append, ask=self.ask)


class Still:
    """A recording of ten seconds."""

    is_live, name, fps, frame_count, width_px, height_px = False, "still", 10.0, 101, 8, 8

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(index=k, timestamp_ns=k * 10**8, camera="still", image=None) for k in range(101))


@pytest.fixture
def film(monkeypatch):
    monkeypatch.setattr(dialogue, "open_source", lambda text: Still())


def test_lines_are_kept_as_they_come(film, tmp_path):
    table = tmp_path / "sensor-presses.csv"
    lines = ["0,0 50 g 2 s", "5,5 7 3 s", "5,5 7 N 3 s", "undo", "5,5 0.7 N 3 s"]
    person = Person(*lines, "done", "9,9 1 N 4 s", "-9,9 5 s radius 5 mm", "done")
    rows = person.typed(str(tmp_path / "films" / "a.mp4"), table)
    assert [(row.x_mm, row.y_mm, row.time_s, row.radius_mm) for row in rows] == [
        (0.0, 0.0, 2.0, 2.0),
        (5.0, 5.0, 3.0, 2.0),
        (9.0, 9.0, 4.0, 2.0),
        (-9.0, 9.0, 5.0, 5.0),
    ]
    assert [row.force_N for row in rows] == [pytest.approx(0.4905), 0.7, 1.0, None]
    assert read_press_table(table) == rows
    assert {row.input for row in rows} == {str(Path("films") / "a.mp4")}
    assert person.heard[1].startswith("type one press per line")
    assert "not taken: 7 has no unit: N, mN, g or kg for the force" in "\n".join(person.heard)
    assert "took back the press at 5, 5 mm" in person.heard
    assert "2 presses are too few, at least 4 are needed; Ctrl-C stops" in person.heard
    assert [prompt for prompt in person.asked if prompt == "press 2: "] == ["press 2: "] * 3


def test_what_was_typed_survives_being_stopped_and_is_gone_on_with(film, tmp_path):
    table = tmp_path / "p.csv"
    person = Person("0,0 50 g 2 s", KeyboardInterrupt())
    assert person.typed("a.mp4", table) is None
    assert person.heard[-1].startswith(f"stopped; 1 press is kept in {table}")
    later = Person("undo", "1,1 2 s", "undo", "undo", "3,3 3 s", EOFError())
    (row,) = later.typed("a.mp4", table)
    assert later.heard[0].startswith(f"1 press is in {table} already")
    assert "there is nothing to take back" in later.heard
    assert (row.x_mm, len(read_press_table(table))) == (3.0, 1)


def test_what_cannot_be_asked_for_is_refused(film, tmp_path):
    with pytest.raises(SensorError, match=r"has no \[sheet\] or no \[markers\]"):
        Person().typed("a.mp4", tmp_path / "p.csv", replace(demo_sensor(WIDTH_PX), sheet=None))
    with pytest.raises(OutputError, match="cannot write the table of presses"):
        Person("0,0 50 g 2 s").typed("a.mp4", tmp_path / "nowhere" / "p.csv")


class Camera:
    """Shows the simulated sensor, pressed or not, as a person says."""

    is_live, name, status = True, "camera-0", "ok"
    fps = frame_count = None
    width_px = height_px = WIDTH_PX
    settings: tuple[Setting, ...] = ()

    def __init__(self) -> None:
        self.source = open_source("sim:one")
        self.at_s, self.is_colour, self.is_closed = 0.0, True, False

    def listen(self, tap) -> None:
        raise AssertionError("nothing listens")

    def close(self) -> None:
        self.is_closed = True

    def __iter__(self) -> Iterator[Frame]:
        number = 0
        while True:
            shown = self.source.simulator.frame(round(self.at_s * self.source.fps))
            broken = number % 7 == 3
            yield replace(shown, index=number, image=None if broken else shown.image)
            number += 1


def test_a_camera_is_watched_while_it_is_pressed(monkeypatch, tmp_path):
    camera, table, sensor = Camera(), tmp_path / "sensor-presses.csv", demo_sensor(WIDTH_PX)
    monkeypatch.setattr(dialogue, "open_source", lambda text: camera)
    person = Person("", "14,-8 1 N", "", "14,-8 1 N", "", "undo", "14,-8 2 N", "")

    def ask(prompt: str) -> str:
        # Held at the second and third time it is asked for, the first time forgotten.
        if "hold still" in prompt:
            camera.at_s = 0.0 if sum("hold" in said for said in person.asked) == 0 else 3.0
        return Person.ask(person, prompt)

    rows = typed_presses(sensor, "0", table, say=person.heard.append, ask=ask)
    assert camera.is_closed
    assert not camera.is_colour
    assert "was it pressed, and hard enough?" in person.heard[2]
    assert (rows[-1].force_N, rows[-1].input) == (2.0, "sensor-presses-1")
    assert read_press_table(table) == rows
    (seen,) = measure_presses(sensor, rows, tmp_path)
    (tmp_path / "direct.csv").write_text("input,time_s,x_mm,y_mm\nsim:one,3.0,14,-8\n")
    (direct,) = measure_presses(sensor, read_press_table(tmp_path / "direct.csv"), tmp_path)
    both = seen.is_seen & direct.is_seen
    assert both.sum() > 590
    assert np.abs(seen.displacement_px - direct.displacement_px)[both].max() < 0.2
    moved = float(np.linalg.norm(direct.displacement_px, axis=1).max())
    assert f"markers moved by up to {moved:.0f}" in person.heard[3].replace(f"{moved:.1f}", f"{moved:.0f}")
