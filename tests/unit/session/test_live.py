"""A session: readings as offline, commands between frames, dropped frames, an end whatever happens."""

import json
import re
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from cameras import Driver
from clips import picture
from drawn_source import DrawnSource
from manytouch.errors import ManytouchError
from manytouch.paper.estimation import PaperEstimation
from manytouch.pipeline import Controls
from manytouch.recording import SESSION
from manytouch.recording.messages import decode_session
from manytouch.session import Live, ResultFiles, pipeline_for, prepare, run
from manytouch.session.methods import parameters_of
from manytouch.session.prepare import Job
from manytouch.session.run import NoObserver
from manytouch.sinks.latest_only import LatestOnly
from manytouch.sources import Capabilities
from manytouch.sources.cameras.camera import CameraSource
from manytouch.sources.cameras.capture import CameraRequest, open_camera
from manytouch.tracking import COMPRESSED_VIDEO
from manytouch.values import (
    Command,
    Contacts,
    Detections,
    Frame,
    Interpolation,
    Pause,
    Phase,
    Press,
    Reading,
    Release,
    Resume,
    Seek,
    Sensor,
    Surface,
    Tare,
    TrackedGrid,
    Tune,
    UndoTare,
    UseMethod,
)

WHOLE = next(
    name for name, value in parameters_of(pipeline_for("mechanics")).items() if isinstance(value, int)
)


class Seen:
    """A sink that keeps readings, sends commands after certain numbers of them, and waits for preparation."""

    def __init__(
        self, live: Live | None = None, *, waits_at: tuple[int, ...] | int = (), **at: Command
    ) -> None:
        self.readings: list[Reading] = []
        self.is_closed = False
        self._live, self._waits_at = live, (waits_at,) if isinstance(waits_at, int) else waits_at
        self._at = {int(name.removeprefix("at_")): command for name, command in at.items()}

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)
        if self._live is not None and len(self.readings) in self._at:
            self._live.send(self._at[len(self.readings)])
        if self._live is not None and len(self.readings) in self._waits_at:
            for _ in range(3000):
                if not self._live.health().is_preparing:
                    return
                time.sleep(0.01)
            raise AssertionError("the preparation did not end")

    def close(self) -> None:
        self.is_closed = True


def run_live(
    source: DrawnSource, *, waits_at: tuple[int, ...] | int = (), **at: Command
) -> tuple[Live, Seen]:
    live = Live(prepare(source))
    seen = Seen(live, waits_at=waits_at, **at)
    run(live, [seen])
    return live, seen


@pytest.mark.usefixtures("each_is_computed_again")
def test_live_readings_have_the_bits_of_offline_ones() -> None:
    offline = Seen()
    run(prepare(DrawnSource()), [offline])
    live, seen = run_live(DrawnSource())
    assert isinstance(live, Controls)
    assert len(seen.readings) == len(offline.readings) == 40
    for one, other in zip(seen.readings, offline.readings, strict=True):
        assert one.frame.index == other.frame.index
        np.testing.assert_array_equal(one.grid.position_px, other.grid.position_px)
        np.testing.assert_array_equal(one.surface.displacement_mm, other.surface.displacement_mm)
        assert [c.id for c in one.contacts.contacts] == [c.id for c in other.contacts.contacts]
    assert any(reading.contacts.touching for reading in seen.readings)
    assert seen.is_closed


class CountedStarts:
    """An estimator that counts how often it is started."""

    def __init__(self, estimate: Any) -> None:
        self.starts, self._estimate = 0, estimate

    def start(self, sensor: Sensor) -> Any:
        self.starts += 1
        return self._estimate.start(sensor)

    def step(self, state: Any, grid: TrackedGrid) -> tuple[Any, Surface, Contacts]:
        found: tuple[Any, Surface, Contacts] = self._estimate.step(state, grid)
        return found


@pytest.mark.parametrize("session", [lambda job: job, Live])
def test_the_state_that_was_warmed_up_is_the_one_that_begins(session: Callable[[Job], Any]) -> None:
    job, seen = prepare(DrawnSource(frames=20)), Seen()
    counted = CountedStarts(job.pipeline.estimate)
    run(session(replace(job, pipeline=replace(job.pipeline, estimate=counted))), [seen])
    assert len(seen.readings) == 20
    assert counted.starts == 1


def test_health_counts_frames_and_latency() -> None:
    live, _ = run_live(DrawnSource(frames=30, is_touched=False))
    health = live.health()
    assert (health.frames, health.dropped, health.markers, health.source_state) == (30, 0, 54, "ok")
    assert health.markers_seen >= 53
    assert 0 < health.latency_ms_p50 <= health.latency_ms_p99 < 5000
    assert health.readings_per_s > 0


def test_gaps_of_a_live_source_count_as_dropped() -> None:
    live, seen = run_live(DrawnSource(frames=40, is_live=True, skips=(20, 21, 30)))
    indices = [reading.frame.index for reading in seen.readings]
    assert indices[0] >= 15, "the frames that the sensor was found in are past"
    assert indices == sorted(indices)
    assert indices[-1] == 39
    assert not {20, 21, 30} & set(indices)
    assert live.health().dropped == 25 - len(indices)


def test_another_method_begins_between_frames_and_identities_go_on() -> None:
    live, seen = run_live(DrawnSource(frames=60), waits_at=26, at_22=UseMethod(method="paper"))
    assert live.health().method == "paper"
    indices = [reading.frame.index for reading in seen.readings]
    assert indices == list(range(60))
    found = [
        (reading.frame.index, contact) for reading in seen.readings for contact in reading.contacts.contacts
    ]
    begun = {contact.id for index, contact in found if index <= 25}
    end: dict[int, int] = {}
    for index, contact in found:
        if contact.phase is Phase.END:
            end.setdefault(contact.id, index)
    assert begun
    assert begun <= set(end)
    assert all(index <= end[contact.id] for index, contact in found if contact.id in end)
    assert {contact.id for index, contact in found if index > max(end[number] for number in begun)} - begun


def test_the_estimation_of_another_method_is_started_by_the_thread_that_prepares_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    threads, start = [], PaperEstimation.start

    def started(estimation: PaperEstimation, sensor: Sensor) -> object:
        threads.append(threading.current_thread().name)
        return start(estimation, sensor)

    monkeypatch.setattr(PaperEstimation, "start", started)
    live, _ = run_live(DrawnSource(frames=40), waits_at=26, at_22=UseMethod(method="paper"))
    assert live.health().method == "paper"
    assert set(threads) == {"manytouch-prepare"}, "the frames would wait for it"


def test_threads_switch_soon_while_a_session_runs_and_as_before_afterwards() -> None:
    class Interval(Seen):
        def write(self, reading: Reading) -> None:
            assert sys.getswitchinterval() <= 1e-3
            super().write(reading)

    before, seen = sys.getswitchinterval(), Interval()
    run(Live(prepare(DrawnSource(frames=18, is_touched=False))), [seen])
    assert seen.readings
    assert sys.getswitchinterval() == before


def test_frames_that_were_read_are_not_read_again() -> None:
    job = prepare(DrawnSource(frames=18, is_touched=False))
    assert len(list(job.readings())) == 18
    with pytest.raises(ManytouchError, match="were read already: prepare it again"):
        next(job.readings())


@pytest.mark.parametrize("is_compressed", [False, True])
def test_compressed_video_is_noted_once_while_it_runs(*, is_compressed: bool) -> None:
    first: list[np.ndarray] = []

    def left_as_before(index: int, image: np.ndarray) -> np.ndarray:
        first.append(image)
        half = image.shape[1] // 2
        return np.hstack([first[0][:, :half], image[:, half:]]) if is_compressed else image

    source = DrawnSource(frames=60, is_touched=False, change=left_as_before)
    live, seen = run_live(source, waits_at=45, at_40=UseMethod(method="perimeter"))
    assert [reading.grid.is_compressed for reading in seen.readings[::59]] == [False, is_compressed]
    assert live.health().notes.count(COMPRESSED_VIDEO) == is_compressed


def test_tare_makes_the_present_sheet_the_untouched_one() -> None:
    def moved(index: int, image: np.ndarray) -> np.ndarray:
        return np.roll(image, 3 if index >= 20 else 0, axis=1)

    live, seen = run_live(DrawnSource(frames=70, is_touched=False, change=moved), waits_at=50, at_25=Tare())
    rest_px = prepare(DrawnSource(frames=70, is_touched=False)).sensor.layout.rest_px
    tared_px = live.sensor.layout.rest_px
    np.testing.assert_allclose(tared_px - rest_px, np.tile([3.0, 0.0], (54, 1)), atol=0.1)
    assert live.health().sensor_version == 1
    assert any("tared" in note for note in live.health().notes)
    assert len(seen.readings) == 70
    assert live.health().can_untare


def test_a_tare_is_undone_and_both_references_are_recorded(tmp_path: Path) -> None:
    def moved(index: int, image: np.ndarray) -> np.ndarray:
        return np.roll(image, 3 if index >= 20 else 0, axis=1)

    source = DrawnSource(frames=90, is_touched=False, change=moved)
    job = prepare(source)
    live = Live(job, record=tmp_path / "tared.mcap")
    seen = Seen(live, waits_at=(50, 65), at_25=Tare(), at_60=UndoTare())
    run(live, [seen])
    assert live.sensor.layout.rest_px is job.sensor.layout.rest_px
    assert live.health().sensor_version == 2
    assert not live.health().can_untare
    assert [note for note in live.health().notes if "undone" in note]
    with (tmp_path / "tared.mcap").open("rb") as file:
        sessions = [decode_session(each.data)[0] for *_, each in make_reader(file).iter_messages([SESSION])]
    rest_px = [float(np.median(sensor.layout.rest_px[:, 0])) for sensor in sessions]
    shift_px = [round(each - rest_px[0]) for each in rest_px]
    assert [one for one, before in pairwise([*shift_px, None]) if one != before] == [0, 3, 0]


def test_a_tare_of_a_touched_sheet_is_carried_out_with_a_warning_until_it_is_undone(tmp_path: Path) -> None:
    job = prepare(DrawnSource(frames=90))
    live, warnings = Live(job), []

    class Watching(Seen):
        def write(self, reading: Reading) -> None:
            warnings.append(live.health().reference_warning)
            super().write(reading)

    seen = Watching(live, waits_at=(50, 65), at_22=Tare(), at_60=UndoTare())
    with ResultFiles(tmp_path / "out", job, is_repeatable=False, warnings=lambda: live.warnings) as files:
        run(live, [*files.sinks, seen])
    (note,) = (note for note in live.health().notes if "touched the sheet" in note)
    assert re.fullmatch(
        r"[12] contacts? touched the sheet when it was tared at 0\.02 s: contacts, depths and forces since "
        "then are relative to the touched shape; undo the tare, and tare while nothing touches",
        note,
    )
    assert [warnings[22], warnings[55], warnings[-1]] == [None, note, None]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    (sentence,) = (each for each in summary["warnings"] if "touched the sheet" in each)
    assert re.search(r"tared at 0\.02 s: .* until 0\.0[67] s are relative to the touched shape$", sentence)


def test_a_tare_of_an_untouched_sheet_has_no_warning() -> None:
    live, _ = run_live(DrawnSource(frames=70, is_touched=False), waits_at=50, at_25=Tare())
    assert live.health().can_untare
    assert (live.warnings, live.health().reference_warning) == ((), None)


def test_without_a_tare_there_is_nothing_to_undo() -> None:
    live, _ = run_live(DrawnSource(frames=20, is_touched=False), at_17=UndoTare())
    assert any("no tare to undo" in note for note in live.health().notes)


def test_a_parameter_changes_while_it_runs() -> None:
    live, seen = run_live(
        DrawnSource(frames=40, is_touched=False),
        waits_at=12,
        at_5=Tune(parameter="detect.least_snr", value=2.5),
    )
    assert live.health().parameters["detect.least_snr"] == 2.5
    assert len(seen.readings) == 40


@pytest.mark.parametrize(
    ("method", "parameter", "value"),
    [
        ("paper", "estimate.formula", "printed"),
        pytest.param("paper", "interpolation.search_radius_pitch", 2.0, marks=pytest.mark.slow),
        pytest.param("paper", "track.gate_pitch", 0.45, marks=pytest.mark.slow),
        pytest.param("paper", "detect.kernel_px", 5.0, marks=pytest.mark.slow),
        pytest.param(
            "perimeter", "estimate.contact_finder.tracker.bridge_frames", 3.0, marks=pytest.mark.slow
        ),
        pytest.param("perimeter", "detect.least_snr", 2.5, marks=pytest.mark.slow),
        ("perimeter", "track.damping", 0.4),
        ("mechanics", "estimate.outlier_gate.stds", 7.0),
    ],
)
def test_markers_and_contacts_keep_their_identities_when_a_parameter_changes(
    method: str, parameter: str, value: int | float | str
) -> None:
    live = Live(prepare(DrawnSource(frames=60), method=method))
    seen = Seen(live, waits_at=32, at_28=Tune(parameter=parameter, value=value))
    run(live, [seen])
    assert live.health().parameters[parameter] == value
    pressed = seen.readings[27:37]
    ids = [{contact.id for contact in reading.contacts.touching} for reading in pressed]
    assert ids[0]
    assert all(ids[0] <= each for each in ids), str(ids)
    unseen = [int(reading.grid.frames_unseen.min()) for reading in pressed]
    assert max(unseen) == 0
    assert not any(reading.grid.new_ids for reading in seen.readings)


def test_the_surface_of_any_method_can_be_changed_while_it_runs() -> None:
    live, seen = run_live(
        DrawnSource(frames=40, is_touched=False),
        waits_at=12,
        at_4=Tune(parameter="interpolation.kind", value="idw"),
        at_5=Tune(parameter="interpolation.iterations", value=20.0),
    )
    assert seen.readings[0].surface.interpolation == Interpolation()
    assert seen.readings[-1].surface.interpolation == Interpolation(kind="idw", iterations=20)
    assert live.health().parameters["interpolation.kind"] == "idw"
    assert live.health().choices["interpolation.kind"] == ("spline", "idw")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (Tune(parameter="interpolation.kind", value="linear"), "must be spline or idw, not linear"),
        (Tune(parameter="interpolation.iterations", value=0.0), "from 2 to 300"),
        (Tune(parameter="detect.least_snr", value=None), "must be a finite number, not None"),
        (Tune(parameter="detect.nonsense", value=1.0), "no parameter 'detect.nonsense': "),
        (Tune(parameter=WHOLE, value=1.5), "whole number"),
        (UseMethod(method="magic"), "no method 'magic'"),
        (Tune(parameter="detect.least_share", value=float("nan")), "not nan"),
        (Seek(frame=3), "Seek is possible only in playback"),
    ],
)
def test_what_cannot_be_done_becomes_a_note(command: Command, words: str) -> None:
    live, seen = run_live(DrawnSource(frames=16, is_touched=False), at_2=command)
    assert any(words in note for note in live.health().notes)
    assert len(seen.readings) == 16


def test_a_setup_that_cannot_process_frames_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fails:
        def start(self, sensor: Sensor) -> None:
            return None

        def step(self, state: None, frame: Frame, expected_px: object) -> tuple[None, Detections]:
            raise ValueError("a window of no size")

    fails = replace(pipeline_for(), detect=Fails())
    monkeypatch.setattr("manytouch.session.live.with_parameter", lambda *_: fails)
    live, seen = run_live(
        DrawnSource(frames=25, is_touched=False),
        waits_at=10,
        at_2=Tune(parameter="detect.least_snr", value=0.0),
    )
    assert any("a window of no size" in note for note in live.health().notes)
    assert len(seen.readings) == 25


def test_the_old_method_goes_on_until_the_new_one_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on, warmed = threading.Event(), []
    warm_up = Job.warm_up

    def slow(job: Job, on_message: object = None) -> object:
        if job.method == "paper":
            assert go_on.wait(30)
        warmed.append((job.method, threading.current_thread().name))
        return warm_up(job)

    monkeypatch.setattr(Job, "warm_up", slow)
    live = Live(prepare(DrawnSource(frames=60, is_touched=False)))

    methods: list[str] = []

    class Watching(Seen):
        def write(self, reading: Reading) -> None:
            methods.append(live.health().method)
            if len(self.readings) == 34:
                assert live.health().is_preparing
                go_on.set()
            super().write(reading)

    seen = Watching(live, at_5=UseMethod(method="paper"), waits_at=35)
    run(live, [seen])
    assert len(seen.readings) == 60
    assert methods[:35] == ["mechanics"] * 35
    assert methods[-1] == live.health().method == "paper"
    assert ("paper", "manytouch-prepare") in warmed
    assert "manytouch-prepare" not in [thread.name for thread in threading.enumerate()]


def test_a_flood_of_commands_is_carried_out_once_per_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    warmed: list[str] = []
    warm_up = Job.warm_up
    monkeypatch.setattr(Job, "warm_up", lambda job, _=None: (warmed.append(job.method), warm_up(job))[1])
    live = Live(prepare(DrawnSource(frames=60, is_touched=False)))

    class Flooding(Seen):
        def write(self, reading: Reading) -> None:
            for number in range(50):
                live.send(UseMethod(method=("paper", "perimeter")[number % 2]))
                live.send(Tare())
                live.send(Tune(parameter="detect.least_snr", value=2.0 + 0.01 * number))
            super().write(reading)

    seen = Flooding(live)
    run(live, [seen])
    assert [reading.frame.index for reading in seen.readings] == list(range(60))
    assert len(warmed) < 20, "9000 commands were sent"
    assert len(live.health().notes) <= 20


def test_fingers_reach_a_source_that_can_be_pressed() -> None:
    finger = Press(finger=1, x_mm=2.0, y_mm=3.0, depth_mm=1.0)
    source = DrawnSource(frames=25, is_touched=False)
    live, _ = run_live(source, at_2=finger, at_4=Release(finger=1))
    assert source.pressed == [finger, Release(finger=1)]
    assert live.health().can_press


def test_a_press_is_in_the_next_frame_that_is_due() -> None:
    """A frame that presses change is made when it is due, not while the session waits for that time."""

    class Pressed(DrawnSource):
        def press(self, command: Press | Release) -> None:
            made.append(len(self.taken))

        @property
        def capabilities(self) -> Capabilities:
            return Capabilities(press=self.press)

    made: list[int] = []
    source = Pressed(frames=7, fps=4.0, is_touched=False)
    job = prepare(source)
    source.taken.clear()
    live = Live(replace(job, frames=iter(source)))  # as if none had been read for the sensor
    run(live, [Seen(live, at_5=Release(finger=1))])
    assert made == [5]


def test_a_file_waits_while_held_and_goes_on() -> None:
    live = Live(prepare(DrawnSource(frames=40, is_touched=False)))
    seen = Seen(live, at_10=Pause())
    runner = threading.Thread(target=run, args=(live, [seen]))
    runner.start()
    deadline = time.monotonic() + 20
    while live.health().is_running and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.3)
    held = len(seen.readings)
    assert held < 40
    time.sleep(0.2)
    assert len(seen.readings) == held
    live.send(Resume())
    runner.join(timeout=20)
    assert len(seen.readings) == 40


def test_an_error_of_the_source_ends_the_run_with_sinks_closed() -> None:
    source = DrawnSource(fails_at=25)
    live = Live(prepare(source))
    seen = Seen()
    with pytest.raises(ValueError, match="fell off"):
        run(live, [seen])
    assert seen.is_closed
    assert [reading.frame.index for reading in seen.readings] == list(range(25))


class Textured(Driver):
    """A camera that shows the dotted sheet, ten times a second."""

    def retrieve(self) -> tuple[bool, np.ndarray]:
        return True, picture(seed=self.number)

    def grab(self) -> bool:
        time.sleep(0.03)
        return super().grab()


def test_a_camera_that_goes_and_comes_back_goes_on_and_is_let_go_at_the_end() -> None:
    class Messages(NoObserver):
        """Keeps what a user reads on the terminal."""

        def __init__(self) -> None:
            self.sentences: list[str] = []

        def on_message(self, sentence: str) -> None:
            self.sentences.append(sentence)

    messages, out = Messages(), threading.Event()
    drivers: list[Driver] = []

    def open_with(number: int | str, api: int) -> Driver:
        drivers.append(Textured(api, period_ms=30.0, gone=out.is_set))
        drivers[-1].number = drivers[-2].number if len(drivers) > 1 else -1
        return drivers[-1]

    def again() -> object:
        request = CameraRequest(size_px=(320, 240), is_mjpg=False)
        return open_camera(0, request, open_with, "linux")  # type: ignore[arg-type]

    live = Live(prepare(CameraSource("0", again)))  # type: ignore[arg-type]
    seen = Seen()
    reported: list[str] = []

    def stop() -> bool:
        reported.append(live.health().source_state)
        if len(seen.readings) == 8 and "no image" not in " ".join(reported):
            out.set()
        if "no image" in reported[-1]:
            out.clear()
        return len(seen.readings) >= 16

    run(live, [seen], messages, stop)
    assert any("no image from camera-0" in word for word in reported)
    assert [sentence for sentence in messages.sentences if "image" in sentence] == [
        "no image from camera-0 since it was disconnected; retrying every 0.5 s",
        "camera-0 gives images again",
    ]
    assert live.health().source_state == "ok"
    indices = np.array([reading.frame.index for reading in seen.readings])
    assert live.health().dropped >= np.sum(np.diff(indices) - 1), "those before the first reading count too"
    assert len(drivers) >= 2
    assert all(driver.is_released for driver in drivers)


class Stuck:
    """A sink that waits until it is released."""

    def __init__(self, *, fails: bool = False) -> None:
        self.indices: list[int] = []
        self.is_closed = False
        self.release = threading.Event()
        self._fails = fails

    def write(self, reading: Reading) -> None:
        assert self.release.wait(20)
        if self._fails:
            raise OSError("the browser has gone")
        self.indices.append(reading.frame.index)

    def close(self) -> None:
        self.is_closed = True


def test_a_slow_sink_gets_the_latest_reading_and_delays_nothing() -> None:
    _, seen = run_live(DrawnSource(frames=20, is_touched=False))
    slow = Stuck()
    latest = LatestOnly(slow)
    for reading in seen.readings:
        latest.write(reading)
    assert slow.indices == [], "all were written while the sink waited"
    slow.release.set()
    latest.close()
    assert slow.indices[-1] == 19
    assert slow.indices == sorted(slow.indices)
    assert len(slow.indices) + latest.skipped == 20
    assert len(slow.indices) <= 2
    assert slow.is_closed


def test_writes_are_an_interval_apart_and_the_last_reading_is_written_at_once_at_the_end() -> None:
    _, seen = run_live(DrawnSource(frames=20, is_touched=False))
    quick = Stuck()
    quick.release.set()
    latest = LatestOnly(quick, interval_s=3600.0)
    latest.write(seen.readings[0])
    while not quick.indices:
        time.sleep(0.001)
    for reading in seen.readings[1:]:
        latest.write(reading)
    assert quick.indices == [0]
    latest.close()
    assert quick.indices == [0, 19]
    assert latest.skipped == 18


def test_the_error_of_a_slow_sink_is_raised_at_its_end() -> None:
    _, seen = run_live(DrawnSource(frames=20, is_touched=False))
    slow = Stuck(fails=True)
    slow.release.set()
    latest = LatestOnly(slow)
    latest.write(seen.readings[0])
    with pytest.raises(OSError, match="browser has gone"):
        latest.close()
    assert slow.is_closed


@pytest.mark.usefixtures("each_is_computed_again")
@pytest.mark.parametrize("method", ["perimeter", "paper"])
def test_a_state_of_the_estimation_can_be_started_from_twice(method: str) -> None:
    job = prepare(DrawnSource(frames=24), method=method)
    frames = [*job.frames]
    state = job.pipeline.estimate.start(job.sensor)
    runs = [
        [
            reading.surface.displacement_mm
            for reading in job.pipeline.estimate_readings(
                job.pipeline.track_frames(frames, job.sensor), job.sensor, given
            )
        ]
        for given in (state, state, None)
    ]
    assert len(runs[0]) == 24
    for other in runs[1:]:
        np.testing.assert_array_equal(runs[0], other)
