"""From an input to its folder: what is refused early, what is complete whatever ends the run."""

import errno
import gc
import json
import shutil
import weakref
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import pytest

from clips import COLUMNS, ROWS, picture
from drawn_source import DrawnSource
from manytouch.errors import ManytouchError, OutputError, SensorError, SourceError
from manytouch.session import (
    METHODS,
    RESULTS,
    Live,
    Request,
    ResultFiles,
    kernels,
    pipeline_for,
    prepare,
    process,
    process_job,
    request_hashes,
    result_name,
    run,
)
from manytouch.session.methods import default_method
from manytouch.session.prepare import Job
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.result_folder import CHECK_INTERVAL
from manytouch.sources import open_source
from manytouch.sources.simulated import SimulatedSource, simulated_source
from manytouch.sources.source import Capabilities
from manytouch.values import Command, Pause, Press, Reading, Resume, Roi, Tune, UseMethod
from part_of_sheet import part_of_sheet
from results import rows_of
from straight import straight_camera
from waiting import wait_until

TABLES = {
    "contacts.csv",
    "contact_list.csv",
    "regions.parquet",
    "markers.parquet",
    "frames.csv",
    "summary.json",
}


class Seen:
    """A sink that keeps what it is given."""

    def __init__(self) -> None:
        self.readings: list[Reading] = []
        self.is_closed = False

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)

    def close(self) -> None:
        self.is_closed = True


class Full:
    """A sink on a disk that fills up."""

    def write(self, reading: Reading) -> None:
        if reading.frame.index == 20:
            raise OutputError("no room")

    def close(self) -> None:
        raise OutputError("still no room")


@pytest.mark.parametrize("method", METHODS)
def test_every_method_reads_every_frame_in_order(method: str) -> None:
    seen = Seen()
    run(prepare(DrawnSource(frames=30), method=method), [seen])
    assert [reading.frame.index for reading in seen.readings] == list(range(30))
    assert seen.is_closed
    assert seen.readings[-1].grid.is_seen.sum() >= 0.9 * ROWS * COLUMNS


def test_the_first_frames_are_released_once_they_are_read() -> None:
    job = prepare(DrawnSource(frames=40, change=lambda _, image: image.copy()))
    images = [weakref.ref(frame.image) for frame in islice(job.frames, 30) if frame.image is not None]
    gc.collect()
    kept = [index for index, image in enumerate(images) if image() is not None]
    assert kept == list(range(len(job.samples)))


def test_an_unknown_method_lists_those_there_are() -> None:
    with pytest.raises(ManytouchError, match=r"magic.*mechanics, perimeter, paper"):
        pipeline_for("magic")


def test_only_the_first_frames_are_taken_before_reading_begins() -> None:
    source = DrawnSource(frames=60)
    prepare(source)
    assert source.taken == list(range(15))


def summary_of(folder: Path) -> Any:
    return json.loads((folder / "summary.json").read_text())


def test_an_interrupted_run_keeps_what_was_read_and_states_it(tmp_path: Path) -> None:
    folder = tmp_path / "press"
    with pytest.raises(KeyboardInterrupt):
        process_job(prepare(DrawnSource(fails_at=22, error=KeyboardInterrupt)), folder)
    assert {path.name for path in folder.iterdir()} == TABLES
    assert [row["frame"] for row in rows_of(folder / "frames.csv")] == [str(i) for i in range(22)]
    assert summary_of(folder)["complete"] is False


def test_a_failed_write_leaves_no_file_of_its_run(tmp_path: Path) -> None:
    folder, seen = tmp_path / "press", Seen()
    with pytest.raises(OutputError):
        process_job(prepare(DrawnSource(frames=30)), folder, sinks=[Full(), seen])
    assert seen.is_closed, "a sink that fails does not keep the others from closing"
    assert not any(tmp_path.iterdir())
    process_job(prepare(DrawnSource(frames=16)), folder)
    with pytest.raises(OutputError):
        process_job(prepare(DrawnSource(frames=30)), folder, sinks=[Full()])
    assert len(rows_of(folder / "frames.csv")) == 16
    assert [path.name for path in tmp_path.iterdir()] == ["press"]


def session_on_disk_of(free_bytes: Iterator[int], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a session whose disk has so much free space at each look."""
    usage = shutil.disk_usage(folder.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=next(free_bytes)))
    live = Live(prepare(DrawnSource(frames=100, fps=2000.0), method="perimeter"))
    with ResultFiles(folder, live.job, is_repeatable=False) as files:
        run(live, files.sinks)


def test_a_session_ends_while_its_disk_has_room_to_complete_the_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "press"
    with pytest.raises(OutputError, match=r"press is nearly full \(1 MB are left, and 8.39 MB are kept"):
        session_on_disk_of(iter([10**9, 10**9, 10**6]), folder, monkeypatch)
    assert {path.name for path in folder.iterdir()} == TABLES
    assert len(rows_of(folder / "frames.csv")) == 2 * CHECK_INTERVAL
    assert summary_of(folder)["complete"] is False


def test_a_session_does_not_begin_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(OutputError, match=r"its disk has 1 MB left, and 8.39 MB are kept"):
        session_on_disk_of(iter([10**6]), tmp_path / "press", monkeypatch)
    assert not any(tmp_path.iterdir())


def test_a_session_states_soon_that_the_folder_of_its_results_was_removed(tmp_path: Path) -> None:
    class Removing:
        """A sink that removes the folder where the results are written."""

        def write(self, reading: Reading) -> None:
            if reading.frame.index == 5:
                shutil.rmtree(files.folder.partial_path)

        def close(self) -> None: ...

    live = Live(prepare(DrawnSource(frames=100, fps=2000.0), method="perimeter"))
    seen = Seen()
    words = r"the folder of its files until the end, was removed"
    with (
        pytest.raises(OutputError, match=words),
        ResultFiles(tmp_path / "press", live.job, is_repeatable=False) as files,
    ):
        run(live, [Removing(), *files.sinks, seen])
    assert len(seen.readings) < CHECK_INTERVAL


def test_a_session_whose_terminal_is_on_a_full_disk_keeps_its_results(tmp_path: Path) -> None:
    class FullTerminal:
        """A sink that prints."""

        def write(self, reading: Reading) -> None:
            if reading.frame.index == 20:
                raise OSError(errno.ENOSPC, "No space left on device")

        def close(self) -> None: ...

    live = Live(prepare(DrawnSource(frames=30), method="perimeter"))
    with (
        pytest.raises(OSError, match="No space"),
        ResultFiles(tmp_path / "press", live.job, is_repeatable=False) as files,
    ):
        run(live, [*files.sinks, FullTerminal()])
    assert len(rows_of(tmp_path / "press" / "frames.csv")) == 21


@pytest.mark.parametrize("error", [KeyboardInterrupt, ManytouchError])
def test_a_run_that_fails_before_its_first_frame_leaves_the_earlier_result(error, tmp_path: Path) -> None:
    folder, job = tmp_path / "press", prepare(DrawnSource(frames=20))

    def fail(*_: object) -> None:
        raise error

    with mock.patch.object(Job, "warm_up", fail), pytest.raises(error):
        process_job(job, folder)
    assert not any(tmp_path.iterdir())
    process_job(prepare(DrawnSource(frames=16)), folder)
    with mock.patch.object(Job, "warm_up", fail), pytest.raises(error):
        process_job(job, folder)
    assert summary_of(folder)["complete"] is True
    assert len(rows_of(folder / "frames.csv")) == 16
    assert [path.name for path in tmp_path.iterdir()] == ["press"]


def test_the_results_of_an_open_source_are_in_a_folder_of_its_name(tmp_path: Path) -> None:
    folder = process(DrawnSource(frames=16), out=tmp_path, method="perimeter", pitch_mm=4.0)
    assert folder == tmp_path / "drawn"
    assert (folder / "summary.json").exists()


def test_a_rate_for_an_open_source_is_refused_as_it_has_no_effect(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"is an open source: give fps=10.0 to manytouch.open_source"):
        process(DrawnSource(frames=16), out=tmp_path, fps=10.0)
    assert not list(tmp_path.iterdir())


def test_a_parameter_that_the_chosen_method_does_not_have_releases_the_source() -> None:
    closed: list[str] = []

    class Closing(DrawnSource):
        @property
        def capabilities(self) -> Capabilities:
            return replace(super().capabilities, close=lambda: closed.append("source"))

    with pytest.raises(ManytouchError, match="nonsense"):
        prepare(Closing(frames=16), pitch_mm=4.0, parameters={"estimate.nonsense": 1.0})
    assert closed == ["source"]


def test_a_source_need_not_state_the_size_of_its_images() -> None:
    sensor = prepare(DrawnSource(frames=16), pitch_mm=4.0).sensor

    def unstated() -> DrawnSource:
        source = DrawnSource(frames=16)
        source.width_px = source.height_px = None
        return source

    readings = list(prepare(unstated(), sensor=sensor, method="perimeter").readings())
    assert [reading.contacts.status for reading in readings] == ["ok"] * 16
    other = replace(sensor, camera=replace(sensor.camera, width_px=640))
    with pytest.raises(SensorError, match="is for images of 640 x 240 px, but the input has 320 x 240 px"):
        prepare(unstated(), sensor=other)


def test_stopping_ends_after_the_frame_at_hand(tmp_path: Path) -> None:
    seen = Seen()
    files = process_job(
        prepare(DrawnSource(frames=30)),
        tmp_path / "press",
        sinks=[seen],
        stop=lambda: len(seen.readings) == 5,
    )
    assert files.summary.counts["frames"] == 5
    assert any("announced 30 frames; 5 were read" in sentence for sentence in files.summary.warnings())
    assert summary_of(tmp_path / "press")["complete"] is False


def test_files_of_an_earlier_run_do_not_stay_with_those_of_this_one(tmp_path: Path) -> None:
    folder = tmp_path / "press"
    folder.mkdir()
    for name in RESULTS:
        (folder / name.replace("[0-9]", "0").replace("*", "")).write_text("earlier")
    (folder / "notes.txt").write_text("mine")
    process_job(prepare(DrawnSource(frames=16)), folder)
    assert {path.name for path in folder.iterdir()} == TABLES | {"notes.txt"}
    assert "earlier" not in (folder / "frames.csv").read_text()
    assert summary_of(folder)["complete"] is True


def test_the_earlier_result_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    folder = tmp_path / "press"
    process_job(prepare(DrawnSource(frames=16)), folder)
    before = (folder / "summary.json").read_bytes()

    class Watching(Seen):
        def write(self, reading: Reading) -> None:
            super().write(reading)
            assert (folder / "summary.json").read_bytes() == before
            assert len(rows_of(folder / "frames.csv")) == 16

    watching = Watching()
    process_job(prepare(DrawnSource(frames=20)), folder, sinks=[watching])
    assert len(watching.readings) == len(rows_of(folder / "frames.csv")) == 20


@pytest.mark.parametrize("late", [0, 2])
def test_images_that_came_after_the_list_was_read_are_stated(late: int, tmp_path: Path) -> None:
    folder = tmp_path / "shots"
    folder.mkdir()
    for number in range(16):
        cv2.imwrite(str(folder / f"{number}.png"), picture())
    job = prepare(folder)
    (folder / "notes.txt").write_text("no image")
    for number in range(late):
        shutil.copy(folder / "0.png", folder / f"late{number}.png")
    files = process_job(job, tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert files.is_complete
    stated = [sentence for sentence in summary["warnings"] if "came into" in sentence]
    expected = "the results lack 2 images that came into the folder shots after its files were listed"
    assert [sentence.partition(":")[0] for sentence in stated] == [expected] * bool(late)


def test_the_space_that_was_needed_is_stated(tmp_path: Path) -> None:
    class FullDisk(Seen):
        def write(self, reading: Reading) -> None:
            if reading.frame.index == 20:
                with output_errors(tmp_path):
                    raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OutputError, match=r"is full; about [\d.e+-]+ MB are .* 21 of 30 .* [MG]B were free"):
        process_job(prepare(DrawnSource(frames=30)), tmp_path / "press", sinks=[FullDisk()])
    assert not any(tmp_path.iterdir())


def hash_of(tmp_path: Path, images: Path, **options: Any) -> str:
    folder = process(images, out=tmp_path / "out", **options)
    found = summary_of(folder)
    source = open_source(images)
    request = Request(**{name: value for name, value in options.items() if name != "sensor"})
    known_before = request_hashes(source, str(images), request)
    if "sensor" not in options:
        assert found["hashes"] == known_before, "the hash is known before anything is processed"
    return str(found["hash"])


def test_the_hash_follows_input_sensor_parameters_and_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    images = tmp_path / "images"
    images.mkdir()
    for index in range(2):
        cv2.imwrite(str(images / f"{index}.png"), picture(seed=index))
    first = hash_of(tmp_path, images)
    assert hash_of(tmp_path, images) == first
    found = [first, hash_of(tmp_path, images, pitch_mm=4.0), hash_of(tmp_path, images, method="paper")]
    found.append(hash_of(tmp_path, images, roi_px=Roi(0, 0, 320, 238)))
    monkeypatch.setattr("manytouch.__version__", "99")
    found.append(hash_of(tmp_path, images))
    monkeypatch.undo()
    (images / "1.png").write_bytes((images / "0.png").read_bytes())
    found.append(hash_of(tmp_path, images))
    assert len(set(found)) == len(found)


def test_parameters_of_a_method_that_the_input_decides_are_in_the_hash(tmp_path: Path) -> None:
    images = tmp_path / "images"
    images.mkdir()
    cv2.imwrite(str(images / "0.png"), picture())
    name = "estimate.contact_tracker.bridge_frames"  # of mechanics, which a pitch makes the default
    found = {hash_of(tmp_path, images, pitch_mm=4.0, parameters={name: frames}) for frames in (3, 4)}
    assert len({*found, hash_of(tmp_path, images, pitch_mm=4.0)}) == 3


def session_hash(folder: Path, *commands: Command) -> str | None:
    """The hash of a live session that gets commands at its fifth reading."""
    live = Live(job := prepare(DrawnSource(frames=25)))

    class Sending(Seen):
        def write(self, reading: Reading) -> None:
            super().write(reading)
            for command in commands if len(self.readings) == 5 else ():
                live.send(command)
            if len(self.readings) == 10:
                wait_until(lambda: not live.health().is_preparing)

    with ResultFiles(folder, job, is_repeatable=False) as files:
        files.is_complete = run(live, [*files.sinks, Sending()])
        files.is_repeatable = live.is_repeatable
    found = summary_of(folder)
    assert found["complete"]
    return found["hash"]


def test_a_session_has_the_hash_of_process_unless_a_command_changed_its_results(tmp_path: Path) -> None:
    folder = tmp_path / "press"
    process_job(prepare(DrawnSource(frames=25)), folder)
    expected = summary_of(folder)["hash"]
    assert expected is not None
    assert session_hash(folder) == expected
    assert session_hash(folder, Pause(), Resume(), UseMethod(method="mechanics")) == expected
    assert session_hash(folder, UseMethod(method="paper")) is None
    assert session_hash(folder, Tune(parameter="detect.least_snr", value=3.5)) is None
    assert session_hash(folder, Press(finger=0, x_mm=0.0, y_mm=0.0, depth_mm=1.0)) is None


def test_a_second_run_into_the_same_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "press"
    job = prepare(DrawnSource(frames=16))
    with ResultFiles(folder, job), pytest.raises(OutputError, match="is being written by process"):
        process_job(job, folder)
    process_job(prepare(DrawnSource(frames=16)), folder)


def test_the_python_call_gives_the_folder(tmp_path: Path) -> None:
    import cv2

    (tmp_path / "trial.1").mkdir()
    for index in range(3):
        cv2.imwrite(str(tmp_path / "trial.1" / f"{index}.png"), picture(seed=index))
    folder = process(tmp_path / "trial.1", out=tmp_path / "out", pitch_mm=5.0, hfov_deg=70.0)
    assert folder == tmp_path / "out" / "trial.1"
    assert {path.name for path in folder.iterdir()} == TABLES


@pytest.mark.parametrize("region", [Roi(300, 0, 21, 10), Roi(0, 200, 10, 41)])
def test_a_region_outside_the_image_is_refused(region: Roi) -> None:
    with pytest.raises(SourceError, match="320 x 240"):
        prepare(DrawnSource(), roi_px=region)


def test_a_sensor_of_another_image_size_is_refused() -> None:
    camera = straight_camera(640, 480, focal_px=500.0, distance_mm=100.0)
    found = prepare(DrawnSource(), pitch_mm=4.0, method="perimeter").sensor
    sensor = replace(found, name="other", camera=camera)
    with pytest.raises(SensorError, match="640 x 480 px, but drawn has 320 x 240"):
        prepare(DrawnSource(), sensor=sensor)
    with pytest.raises(SensorError, match="already states pitch"):
        prepare(DrawnSource(), sensor=sensor, pitch_mm=4.0)
    with pytest.raises(SensorError, match="of sim:one already states pitch and camera: omit --pitch-mm"):
        prepare("sim:one", hfov_deg=60.0)


def test_an_input_without_frames_is_refused() -> None:
    with pytest.raises(SourceError, match="no frame"):
        prepare(DrawnSource(frames=0))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        *[("a/b.c.mp4", "b.c"), ("sim:", "sim"), ("sim:one", "sim-one"), ("x/../y.avi", "y")],
        *[("0", "0"), ("/dev/video2", "video2"), ("http://10.0.0.5/", "stream-10.0.0.5")],
        ("rtsp://user:secret@10.0.0.5:554/cam/1", "stream-10.0.0.5-554-cam-1"),
        ("http://[::1]:8080/video.mjpg#x", "stream-[-1]-8080-video.mjpg"),
        *[("a/...png", "input"), ("..png", "input"), ("a/...mcap#left", "input-left"), ("/", "input")],
    ],
)
def test_names_of_results(text: str, name: str) -> None:
    assert result_name(text) == name


def test_results_of_a_link_have_its_own_name(tmp_path: Path) -> None:
    (tmp_path / "4f2a.bin").touch()
    (tmp_path / "press.mp4").symlink_to(tmp_path / "4f2a.bin")
    assert result_name(str(tmp_path / "press.mp4")) == "press"
    assert result_name(f"{tmp_path}/x/../press.mp4") == "press"


def test_streams_that_differ_only_in_the_query_have_folders_of_their_own() -> None:
    names = {result_name(f"http://cam/video.cgi?camera={number}&password=secret") for number in range(3)}
    assert len(names) == 3
    assert not any("secret" in name or "?" in name for name in names)
    assert len({result_name(f"http://cam/video.cgi?key={number}") for number in range(3)}) == 3


@pytest.mark.parametrize(("name", "folder"), [("finger.1", "finger.1"), ("left/tip", "left-tip")])
def test_results_of_an_open_source_have_its_whole_name(name: str, folder: str, tmp_path: Path) -> None:
    assert process(DrawnSource(frames=16, name=name), out=tmp_path, method="perimeter").name == folder


def test_kernels_are_known_by_name() -> None:
    found = kernels()
    assert found
    assert all(name.startswith("manytouch.") for name in found)


def small_source() -> SimulatedSource:
    """The simulated sensor at rest, with the markers of a small part of its sheet."""
    source = simulated_source("rest", width_px=160)
    sensor = part_of_sheet(source.sensor, (32.0, 24.0))
    return replace(source, simulator=replace(source.simulator, sensor=sensor, faults=None))


def test_the_default_method_is_mechanics_where_the_sheet_is_known_or_assumed() -> None:
    found = prepare(DrawnSource())
    assert found.method == "mechanics"
    few = part_of_sheet(found.sensor, (3.0, 3.0))
    assert len(few.layout.rest_mm) < 12
    assert default_method(few) == "perimeter"
    assert default_method(replace(few, sheet=replace(few.sheet, is_assumed=False))) == "mechanics"
    assert default_method(replace(found.sensor, sheet=None)) == "perimeter"
    source = small_source()
    assert prepare(source).method == "mechanics"
    assert prepare(source, method="paper").method == "paper"
    bonded = replace(source.sensor.sheet, boundary="bonded", marker_depth_mm=1.0, pretension_N_per_mm=None)
    assert default_method(replace(source.sensor, sheet=bonded)) == "mechanics"


@pytest.mark.parametrize("unknown", ["pretension_N_per_mm", "young_MPa"])
def test_mechanics_states_that_it_estimates_a_pretension_that_no_file_states(unknown: str) -> None:
    """Without Young's modulus, a pretension in N/mm says nothing about the shape of the sheet."""
    source = small_source()
    slack = replace(source.sensor, sheet=replace(source.sensor.sheet, **{unknown: None}))
    slack_source = replace(source, simulator=replace(source.simulator, sensor=slack))
    job = prepare(slack_source, method="mechanics")
    (stated,) = (sentence for sentence in job.sensor.assumptions if "pretension" in sentence)
    assert "is estimated" in stated
    assert job.pipeline.estimate.start(job.sensor).pretension.is_estimated
    assert not job.pipeline.estimate.start(source.sensor).pretension.is_estimated
    no_tension = replace(slack.sheet, pretension_N_per_mm=0.0, young_MPa=None)
    assert not job.pipeline.estimate.start(replace(slack, sheet=no_tension)).pretension.is_estimated
    bonded = replace(slack.sheet, boundary="bonded", marker_depth_mm=1.0)
    pad_source = replace(source, simulator=replace(source.simulator, sensor=replace(slack, sheet=bonded)))
    for each, method in ((source, "mechanics"), (slack_source, "perimeter"), (pad_source, "mechanics")):
        found = prepare(each, method=method).sensor
        assert not any("pretension" in sentence for sentence in found.assumptions)


def test_a_rate_that_no_input_states_is_an_assumption() -> None:
    def is_assumed(**settings: Any) -> bool:
        stated = prepare(DrawnSource(**settings)).sensor.assumptions
        return any("30 frames per second" in sentence for sentence in stated)

    assert is_assumed(fps=None)
    assert not is_assumed(fps=25.0)
    assert not is_assumed(fps=None, frames=1)


def test_results_may_have_the_name_of_a_source_that_is_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        process_job(prepare(DrawnSource(frames=3)), Path("drawn"))
    assert {path.name for path in Path("drawn").iterdir()} == TABLES
