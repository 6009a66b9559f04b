"""Presses typed on a terminal are saved, for a recording and for a camera."""

import functools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bonded_pad import pad_sensor
from manytouch.calibration.sheet import typed_presses as module
from manytouch.calibration.sheet.press_table import measure_presses, read_press_table
from manytouch.calibration.sheet.typed_presses import read_typed_presses
from manytouch.errors import OutputError, SensorError, SourceError
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sources import Capabilities, open_source
from manytouch.values import Frame, Setting

WIDTH_PX = 1280


class User:
    """Answers from a list; an exception in the list is raised at its prompt."""

    def __init__(self, *answers: str | BaseException) -> None:
        self.answers, self.printed, self.prompts = list(answers), [], []

    def answer(self, prompt: str) -> str:
        self.prompts.append(prompt)
        answer = self.answers.pop(0) if self.answers else EOFError()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def type_in(self, source: str, table: Path, sensor=None):
        sensor = demo_sensor(WIDTH_PX) if sensor is None else sensor
        return read_typed_presses(sensor, source, table, report=self.printed.append, prompt=self.answer)


class Still:
    """A recording of ten seconds."""

    is_live, name, fps, frame_count, width_px, height_px = False, "still", 10.0, 101, 8, 8
    capabilities = Capabilities()

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(index=k, timestamp_ns=k * 10**8, camera="still", image=None) for k in range(101))


class Empty(Still):
    """A recording without frames."""

    def __iter__(self) -> Iterator[Frame]:
        return iter(())


@pytest.fixture
def film(monkeypatch):
    monkeypatch.setattr(module, "open_source", lambda text, fps: Still())


def test_tilted_weights_stay_in_a_table_that_is_continued(film, tmp_path):
    table = tmp_path / "presses.csv"
    head = "input,time_s,x_mm,y_mm,weight_N,tilt_x_deg,tilt_y_deg,normal_force_N\n"
    table.write_text(head + "a.mp4,1,0,0,2,30,-12.5,\na.mp4,1,3,0,2,,,\na.mp4,1,0,3,,,,1.5\n")
    before = read_press_table(table)
    after = User("5,5 1 N 3 s", "done").type_in("a.mp4", table)
    assert [row.shear_N for row in after] == [
        pytest.approx(before[0].shear_N),
        (0.0, 0.0),
        None,
        None,
    ]
    assert [row.force_N for row in after] == pytest.approx([*(row.force_N for row in before), 1.0])


def test_every_press_is_saved_at_once(film, tmp_path):
    table = tmp_path / "sensor-presses.csv"
    lines = ["0,0 50 g 2 s", "5,5 7 3 s", "5,5 7 N 3 s", "undo", "5,5 0.7 N 3 s"]
    user = User(*lines, "done", "9,9 1 N 4 s", "-9,9 5 s radius 5 mm", "done")
    rows = user.type_in(str(tmp_path / "films" / "a.mp4"), table)
    assert [(row.x_mm, row.y_mm, row.time_s, row.radius_mm) for row in rows] == [
        (0.0, 0.0, 2.0, 2.0),
        (5.0, 5.0, 3.0, 2.0),
        (9.0, 9.0, 4.0, 2.0),
        (-9.0, 9.0, 5.0, 5.0),
    ]
    assert [row.force_N for row in rows] == [pytest.approx(0.4905), 0.7, 1.0, None]
    assert read_press_table(table) == rows
    assert {row.input for row in rows} == {str(Path("films") / "a.mp4")}
    assert user.printed[1].startswith("type one press per line")
    assert "refused: 7 has no unit: N, mN, g or kg for the force" in "\n".join(user.printed)
    assert "removed the press at 5, 5 mm" in user.printed
    assert "2 presses are too few, at least 4 are needed; Ctrl-C stops" in user.printed
    assert [prompt for prompt in user.prompts if prompt == "press 2: "] == ["press 2: "] * 3


def test_an_interrupted_table_is_continued(film, tmp_path):
    table = tmp_path / "p.csv"
    user = User("0,0 50 g 2 s", KeyboardInterrupt())
    assert user.type_in("a.mp4", table) is None
    assert user.printed[-1].startswith(f"stopped; 1 press is saved in {table}")
    lines = [f"{x},3 3 s" for x in (3, 4, 5, 6)]
    later = User("undo", "1,1 2 s", "undo", "undo", *lines, EOFError())
    rows = later.type_in("a.mp4", table)
    assert later.printed[0].startswith(f"1 press is already in {table}")
    assert "there is no press to remove" in later.printed
    assert [row.x_mm for row in rows] == [3.0, 4.0, 5.0, 6.0]
    assert read_press_table(table) == rows


def test_an_input_that_ends_after_too_few_presses_raises_and_keeps_the_table(film, tmp_path):
    table = tmp_path / "p.csv"
    with pytest.raises(
        SensorError, match=r"1 press is too few.*saved in .*p\.csv.*run the same command again"
    ):
        User("0,0 50 g 2 s", EOFError()).type_in("a.mp4", table)
    assert len(read_press_table(table)) == 1
    with pytest.raises(SensorError, match="0 presses are too few, at least 4 are needed"):
        User().type_in("a.mp4", tmp_path / "none.csv")


def test_a_pad_needs_two_presses_with_a_force(film, tmp_path):
    table, pad = tmp_path / "p.csv", pad_sensor()
    user = User(
        "0,0 50 g 2 s", "3,0 3 s", "done", "0,3 20 g 4 s", "done", AssertionError("a prompt too many")
    )
    rows = user.type_in("a.mp4", table, pad)
    assert [row.force_N is None for row in rows] == [False, True, False]
    assert "1 press with a force is too few, at least 2 are needed; Ctrl-C stops" in user.printed
    with pytest.raises(SensorError, match="1 press with a force is too few"):
        User("0,0 50 g 2 s", "3,0 3 s").type_in("a.mp4", tmp_path / "other.csv", pad)


def test_a_source_without_frames_raises(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "open_source", lambda text, fps: Empty())
    with pytest.raises(SourceError, match=r"a\.mp4 has no frames"):
        User().type_in("a.mp4", tmp_path / "p.csv")


def test_a_sensor_without_a_sheet_and_an_unwritable_table_raise(film, tmp_path):
    with pytest.raises(SensorError, match=r"has no \[sheet\] or no \[markers\]"):
        User().type_in("a.mp4", tmp_path / "p.csv", replace(demo_sensor(WIDTH_PX), sheet=None))
    with pytest.raises(OutputError, match="cannot write the table of presses"):
        User("0,0 50 g 2 s").type_in("a.mp4", tmp_path / "nowhere" / "p.csv")


class Camera:
    """A camera of the simulated sensor, whose time the test sets."""

    is_live, name, status = True, "camera-0", "ok"
    fps = frame_count = None
    width_px = height_px = WIDTH_PX
    settings: tuple[Setting, ...] = ()

    @property
    def capabilities(self) -> Capabilities:
        return Capabilities(device=self)

    def __init__(self) -> None:
        self.source = open_source("sim:one")
        self.frame_at = functools.cache(self.source.simulator.frame)
        self.at_s, self.is_colour, self.is_closed = 0.0, True, False

    def listen(self, tap) -> None:
        raise AssertionError("nothing listens")

    def close(self) -> None:
        self.is_closed = True

    def __iter__(self) -> Iterator[Frame]:
        number = 0
        while True:
            shown = self.frame_at(round(self.at_s * self.source.fps))
            broken = number % 7 == 3
            yield replace(shown, index=number, image=None if broken else shown.image)
            number += 1


def test_a_frame_rate_is_refused_with_a_camera(monkeypatch, tmp_path):
    camera, user = Camera(), User()
    monkeypatch.setattr(module, "open_source", lambda text, fps: camera)
    with pytest.raises(SourceError, match=r"a frame rate of 60 .* '0', which has its own: leave out --fps"):
        read_typed_presses(
            demo_sensor(WIDTH_PX), "0", tmp_path / "a.csv", report=print, prompt=user.answer, fps=60.0
        )
    assert camera.is_closed
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_camera_measures_each_press(monkeypatch, tmp_path):
    camera, table, sensor = Camera(), tmp_path / "sensor-presses.csv", demo_sensor(WIDTH_PX)
    monkeypatch.setattr(module, "open_source", lambda text, fps: camera)
    monkeypatch.setattr(module, "LEAST_PRESSES", 1)
    user = User("", "14,-8 1 N", "", "14,-8 1 N", "", "undo", "14,-8 2 N", "")

    def prompt(text: str) -> str:
        # The first press is forgotten, the second and third are held.
        if "hold still" in text:
            camera.at_s = 0.0 if sum("hold" in shown for shown in user.prompts) == 0 else 2.2
        return User.answer(user, text)

    rows = read_typed_presses(sensor, "0", table, report=user.printed.append, prompt=prompt)
    assert camera.is_closed
    assert not camera.is_colour
    assert "press harder, or check the position" in user.printed[2]
    assert (rows[-1].force_N, rows[-1].input) == (2.0, "sensor-presses-1")
    assert read_press_table(table) == rows
    (seen,) = measure_presses(sensor, rows, tmp_path)
    (tmp_path / "direct.csv").write_text("input,time_s,x_mm,y_mm\nsim:one,2.2,14,-8\n")
    (direct,) = measure_presses(sensor, read_press_table(tmp_path / "direct.csv"), tmp_path)
    both = seen.is_seen & direct.is_seen
    assert both.sum() > 590
    assert np.abs(seen.displacement_px - direct.displacement_px)[both].max() < 0.2
    moved = float(np.linalg.norm(direct.displacement_px, axis=1).max())
    assert f"markers moved by up to {moved:.0f}" in user.printed[3].replace(f"{moved:.1f}", f"{moved:.0f}")
