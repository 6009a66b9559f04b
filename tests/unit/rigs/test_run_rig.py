"""A running rig: one process per sensor, one of which is killed."""

import json
import os
import signal
import threading
import urllib.error
import urllib.request
from collections.abc import Mapping
from pathlib import Path

import pytest

from manytouch.errors import OutputError, SourceError
from manytouch.recording.reader import Recording
from manytouch.rigs.overview_page import OverviewPage
from manytouch.rigs.rig_contact import RigContact
from manytouch.rigs.rig_file import load_rig
from manytouch.rigs.run_rig import SensorState, run_rig
from manytouch.session import Playback
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sources import open_source
from manytouch.sources.simulated import load_solved_scene
from manytouch.values.sensor_file.write import save_sensor
from part_of_sheet import part_of_sheet
from results import rows_of

FOUR, TWO = ("index", "middle", "ring", "thumb"), ("index", "ring")
KILLED = "ring"
SCENE = """schema = 1
name = "press"
seconds = 3.0
fps = 5.0
sensor = "sensor.toml"
mechanics = "shell"
[[bodies]]
shape = { kind = "round_punch", radius_mm = 6.0 }
motions = [{ kind = "press", at_mm = [14.0, -8.0], depth_mm = 4.0, start_s = 0.6, end_s = 2.6, ramp_s = 0.6 }]
"""


class Notes:
    def __init__(self) -> None:
        self.sentences: list[tuple[str, str]] = []
        self.times: dict[str, list[float]] = {name: [] for name in FOUR}

    def on_note(self, sensor: str, sentence: str) -> None:
        self.sentences.append((sensor, sentence))

    def on_contacts(self, sensor: str, time_s: float, contacts: tuple[RigContact, ...]) -> None:
        self.times[sensor].append(time_s)


def rig_file(folder: Path, names: tuple[str, ...]) -> Path:
    """A rig of sensors with the same press of 3 s, which is solved here and not by their processes."""
    save_sensor(part_of_sheet(demo_sensor(480), (64.0, 44.0)), folder / "sensor.toml")
    scene = folder / "press.toml"
    scene.write_text(SCENE)
    load_solved_scene(str(scene))
    sections = [
        f'[[sensors]]\nname = "{name}"\nsource = "sim:{scene}"\nfps = 5.0\nmethod = "perimeter"\n'
        f"[sensors.pose]\ntranslation_mm = [{100.0 * number}, 0.0, 0.0]\n"
        for number, name in enumerate(names)
    ]
    path = folder / "rig.toml"
    path.write_text('schema = 1\nname = "hand"\n' + "".join(sections))
    return path


@pytest.mark.parametrize("names", [TWO, pytest.param(FOUR, marks=pytest.mark.slow)], ids=["two", "four"])
def test_one_of_several_sensors_is_killed(tmp_path: Path, names: tuple[str, ...]) -> None:
    rig, notes, over = load_rig(rig_file(tmp_path, names)), Notes(), threading.Event()
    pages: list[str] = []

    def attack(states: Mapping[str, SensorState]) -> None:
        def wait_and_kill() -> None:
            state = states[KILLED]
            while state.health.frames < 3 and not over.wait(0.05):
                pass
            if state.pid is not None:
                os.kill(state.pid, signal.SIGKILL)
            page = OverviewPage("hand", states)
            for path in ("", "overview_page.js", "states"):
                with urllib.request.urlopen(page.url + path, timeout=5) as answer:
                    pages.append(answer.read().decode())
            request = urllib.request.Request(page.url, headers={"Host": "example.org:80"})
            with pytest.raises(urllib.error.HTTPError):
                urllib.request.urlopen(request, timeout=5)
            page.close()

        threading.Thread(target=wait_and_kill, daemon=True).start()

    states = run_rig(
        rig,
        notes,
        lambda: False,
        out=tmp_path / "out",
        record=tmp_path / "hand.mcap",
        on_states=attack,
    )
    over.set()
    assert [state.restarts for state in states.values()] == [name == KILLED for name in names]
    assert any(sensor == KILLED and "started again" in sentence for sensor, sentence in notes.sentences)
    assert "<script src=/overview_page.js>" in pages[0]
    assert [sensor["name"] for sensor in json.loads(pages[2])] == list(names)

    rows = rows_of(tmp_path / "out" / "contacts.csv")
    for number, name in enumerate(names):
        own = [float(row["x_mm"]) for row in rows if row["sensor"] == name]
        assert own, name
        assert all(100.0 * number - 60.0 < x < 100.0 * number + 60.0 for x in own)
        assert len([row for row in rows if row["sensor"] == name and row["phase"] == "start"]) >= 1
        assert notes.times[name] == sorted(notes.times[name])
        if name != KILLED:  # one scene, which begins at second 0 of the rig for all
            assert all(row["time_s"] == row["sensor_time_s"] for row in rows if row["sensor"] == name)
    assert (tmp_path / "out" / "index" / "contacts.csv").is_file()

    assert sorted(path.name for path in tmp_path.glob("*.mcap")) == ["hand.mcap"]
    with pytest.raises(SourceError, match=f"has the sensors {', '.join(names)}"):
        Recording(tmp_path / "hand.mcap")
    counts = {}
    for name in names:
        source = open_source(f"{tmp_path / 'hand.mcap'}#{name}")
        assert source.name == f"hand-{name}"
        counts[name] = source.frame_count
        times = [source.timestamp_ns(place) for place in range(len(source))]
        assert times == sorted(times)
        playback = Playback(Path(f"{tmp_path / 'hand.mcap'}#{name}"))
        assert playback.frame_count == counts[name]
        assert sum(source.reading(place) is not None for place in range(len(source))) >= counts[name] - 2
    others = {counts[name] for name in names if name != KILLED}
    assert len(others) == 1
    assert max(others) < counts[KILLED]


@pytest.mark.parametrize("failures", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_sensor_that_never_works_is_given_up(
    failures: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from manytouch.rigs import run_rig as module

    monkeypatch.setattr(module, "MOST_FAILURES", failures)
    path = tmp_path / "rig.toml"
    path.write_text('schema = 1\nname = "hand"\n[[sensors]]\nname = "index"\nsource = "gone.mp4"\n')
    notes = Notes()
    states = run_rig(load_rig(path), notes, lambda: False)
    assert states["index"].is_over
    assert any("There is no" in sentence for _, sentence in notes.sentences)
    assert any(f"given up after {failures} failure" in sentence for _, sentence in notes.sentences)


@pytest.mark.slow
def test_an_output_that_cannot_be_opened_ends_the_rig_at_once(tmp_path: Path) -> None:
    path = rig_file(tmp_path, TWO)
    text = path.read_text().replace('name = "ring"', 'name = "ring"\nto = ["midi:///no/such/take.mid"]')
    path.write_text(text)
    notes = Notes()
    with pytest.raises(OutputError, match=r"^ring: '/no/such/take.mid' cannot be written") as found:
        run_rig(load_rig(path), notes, lambda: False, record=tmp_path / "hand.mcap")
    assert "\n" not in str(found.value)
    assert not any("started again" in sentence or "take.mid" in sentence for _, sentence in notes.sentences)
    assert list(tmp_path.glob("*.mcap")) == []
