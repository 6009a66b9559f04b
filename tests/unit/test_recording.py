"""Recordings: values in single precision, in well-known schemas, whole up to where they were cut off."""

import errno
import json
import re
import sys
import threading
import time
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cameras import jpeg
from clips import picture, press_of
from faults.recording_kills import kill_recording
from manytouch.errors import OutputError, SourceError
from manytouch.geometry.camera import project
from manytouch.recording.json_codec import from_json, to_json
from manytouch.recording.packed import FLOAT32_BITS, SIGNIFICANT_BITS
from manytouch.recording.reader import Recording
from manytouch.recording.repair import repair
from manytouch.session import Live, Playback, prepare, process, run
from manytouch.sinks import recorder as recorder_module
from manytouch.sinks.recorder import Recorder, UnbufferedFile
from manytouch.sources import Capabilities, open_source
from manytouch.sources.encoded import decoded
from manytouch.values import (
    Command,
    Contact,
    Frame,
    Pause,
    Phase,
    Play,
    Reading,
    Record,
    Resume,
    Seek,
    StopRecording,
    UseMethod,
)
from measured_once import layouts_measured_once

pytest.importorskip("mcap")


@pytest.fixture(scope="module", autouse=True)
def layouts() -> Iterator[None]:
    with layouts_measured_once():
        yield


@dataclass
class Pictures:
    """A source of dotted pictures, JPEG as a camera gives them or plain."""

    frames: int = 40
    is_jpeg: bool = True
    name: str = "drawn"
    fps: float | None = 200.0
    width_px: int = 320
    height_px: int = 240
    is_live: bool = False
    capabilities: Capabilities = field(default_factory=Capabilities)

    @property
    def frame_count(self) -> int:
        return self.frames

    def __iter__(self) -> Iterator[Frame]:
        for index in range(self.frames):
            image = picture(press_of(index), seed=index)
            encoded = jpeg(image[..., 0]) if self.is_jpeg else None
            frame = Frame(
                index=index,
                timestamp_ns=index * 5_000_000,
                camera=self.name,
                image=None if self.is_jpeg else image,
                encoded=encoded,
            )
            yield decoded(frame, is_colour=False)


class Seen:
    """A sink that stores readings, sends commands after given numbers of them, and waits for preparation."""

    def __init__(
        self, controls: Live | Playback | None = None, *, waits_at: int | None = None, **at: Command
    ) -> None:
        self.readings: list[Reading] = []
        self._controls, self._waits_at = controls, waits_at
        self._at = {int(name.removeprefix("at_")): command for name, command in at.items()}

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)
        if self._controls is not None and len(self.readings) in self._at:
            self._controls.send(self._at[len(self.readings)])
        if self._controls is not None and len(self.readings) == self._waits_at:
            deadline = time.monotonic() + 30.0
            while self._controls.health().is_preparing:
                assert time.monotonic() < deadline
                time.sleep(0.01)

    def close(self) -> None:
        pass


def same(one: Any, other: Any) -> bool:
    """Are two values the same to the last bit?"""
    if is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one)
        )
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other or (one != one and other != other)  # noqa: PLR0124 - NaN


def alike(one: Any, other: Any, name: str = "") -> bool:
    """Are two values the same but for the rounding of recordings?"""
    if is_dataclass(one):
        return type(one) is type(other) and all(
            alike(getattr(one, field.name), getattr(other, field.name), field.name) for field in fields(one)
        )
    if isinstance(one, np.ndarray) and one.dtype == np.float64:
        source = "displacement_mm" if name == "position_mm" else name  # rest plus displacement
        rounding = 2.0 ** -SIGNIFICANT_BITS.get(source, FLOAT32_BITS)
        atol = 5.1e-4 if name == "point_mm" else 1e-6
        return one.shape == other.shape and np.allclose(
            one, other, rtol=2.0 * rounding, atol=atol, equal_nan=True
        )
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(alike, one, other))
    return same(one, other)


def without_time(reading: Reading) -> tuple[Any, ...]:
    """What must be the same when a frame is read again."""
    return (reading.frame.index, reading.detections, reading.grid, reading.surface, reading.contacts)


@pytest.fixture(scope="module", params=[True, False], ids=["jpeg", "png"])
def recorded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Seen, Live]:
    """A recording of a whole run, what was read in it, and its session."""
    path = tmp_path_factory.mktemp("recorded") / "press.mcap"
    live = Live(prepare(Pictures(is_jpeg=request.param)), record=path)
    seen = Seen()
    run(live, [seen])
    return path, seen, live


PNG_UNLESS_SLOW = pytest.mark.parametrize(
    "recorded",
    [pytest.param(True, marks=pytest.mark.slow, id="jpeg"), pytest.param(False, id="png")],
    indirect=True,
)


def test_sensors_and_contacts_come_back_to_the_last_bit(recorded: tuple[Path, Seen, Live]) -> None:
    _, seen, live = recorded
    for value in (live.sensor, seen.readings[30].contacts, seen.readings[30].surface, seen.readings[0].grid):
        assert same(from_json(json.loads(json.dumps(to_json(value), allow_nan=False))), value)
    with pytest.raises(TypeError):
        to_json(object())
    with pytest.raises(SourceError, match="later version"):
        from_json({"type": "Contact", "charm": 3})
    with pytest.raises(SourceError, match="later version"):
        from_json({"type": "Popen", "args": "true"})


def test_whatever_a_reading_may_hold_can_be_recorded() -> None:
    from manytouch import values
    from manytouch.recording import json_codec

    commands = {kind.__name__ for kind in typing.get_args(values.Command)}
    of_sessions = {"Health", "OutputState", "ParameterInfo", "Setting"}
    others = {"Frame", "Reading", "Truth", "Comparison", "Roi"} | of_sessions
    recorded_names = (
        {name for name in values.__all__ if is_dataclass(getattr(values, name))} - commands - others
    )
    assert recorded_names
    assert recorded_names <= set(json_codec.RECORDED_TYPES)


def test_stored_readings_are_those_of_the_run(recorded: tuple[Path, Seen, Live]) -> None:
    path, seen, _ = recorded
    playback = Playback(path)
    again = Seen()
    run(playback, [again])
    assert len(again.readings) == len(seen.readings) == 40
    for one, other in zip(again.readings, seen.readings, strict=True):
        assert alike(without_time(one), without_time(other))
        assert one.milliseconds == other.milliseconds
        assert one.frame.timestamp_ns == other.frame.timestamp_ns
        assert one.frame.encoded == other.frame.encoded or other.frame.encoded is None
        np.testing.assert_array_equal(one.frame.image, other.frame.image)
    assert any(reading.contacts.touching for reading in again.readings)


def test_reading_the_frames_again_gives_the_same_bits(recorded: tuple[Path, Seen, Live]) -> None:
    path, seen, _ = recorded
    again = Seen()
    run(prepare(str(path)), [again])
    assert len(again.readings) == 40
    for one, other in zip(again.readings, seen.readings, strict=True):
        assert same(without_time(one), without_time(other))


def test_a_rate_can_be_given_instead_of_the_recorded_times(recorded: tuple[Path, Seen, Live]) -> None:
    source = open_source(recorded[0], fps=50.0)
    assert [frame.timestamp_ns for frame in source][:3] == [0, 20_000_000, 40_000_000]
    assert open_source(recorded[0]).fps == pytest.approx(200.0)


@PNG_UNLESS_SLOW
def test_another_method_reads_the_same_frames(recorded: tuple[Path, Seen, Live], tmp_path: Path) -> None:
    path, _, _ = recorded
    playback = Playback(path, method="paper")
    again = Seen()
    run(playback, [again])
    assert playback.health().method == "paper"
    assert [reading.frame.index for reading in again.readings] == list(range(40))
    folder = process(path, out=tmp_path, method="paper")
    assert (folder / "summary.json").is_file()
    assert folder.name == "press"


def test_recorded_readings_are_compared_with_new_ones(recorded: tuple[Path, Seen, Live]) -> None:
    path, seen, _ = recorded
    touched = next(reading for reading in seen.readings if reading.contacts.touching)
    assert Playback(path).comparison(touched.frame.index) is None
    comparison = Playback(path, method="paper").comparison(touched.frame.index)
    assert comparison is not None
    assert comparison.name == "recorded"
    assert alike(comparison.contacts, touched.contacts)
    assert alike(comparison.surface, touched.surface)
    assert Playback(path, method="paper").comparison(4000) is None


@PNG_UNLESS_SLOW
def test_another_method_can_be_chosen_while_it_is_shown(recorded: tuple[Path, Seen, Live]) -> None:
    path, seen, _ = recorded
    playback = Playback(path)
    again = Seen(playback, at_20=UseMethod(method="paper"), waits_at=22)
    run(playback, [again])
    indices = [reading.frame.index for reading in again.readings]
    assert indices == [*range(22), *range(40)], "contacts follow from the frames before the one that is shown"
    assert playback.health().method == "paper"
    assert playback.comparison(30) is not None
    assert alike(without_time(again.readings[10]), without_time(seen.readings[10]))
    assert not same(again.readings[-1].surface, seen.readings[-1].surface)


def seen_from_the_camera(pose: Any, place: tuple[float, float, float]) -> np.ndarray:
    turn = Rotation.from_quat([pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w])
    return turn.apply(place) + np.array([pose.translation.x, pose.translation.y, pose.translation.z])


def test_other_programs_read_it_in_well_known_schemas(recorded: tuple[Path, Seen, Live]) -> None:
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    path, seen, _ = recorded
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        counts = {
            summary.channels[number].topic: count
            for number, count in summary.statistics.channel_message_counts.items()
        }
        about_once = {"/session": 2, "/calibration": 1, "/transform": 1}
        assert counts == {"/camera": 40, "/reading": 40, "/surface": 40, **about_once}
        names = {schema.name for schema in summary.schemas.values()}
        assert {"foxglove.CompressedImage", "foxglove.PointCloud", "manytouch.Reading"} <= names
        images = list(reader.iter_decoded_messages(topics=["/camera"]))
        assert {image.decoded_message.format for image in images} <= {"jpeg", "png"}
        cloud = next(reader.iter_decoded_messages(topics=["/surface"])).decoded_message
        assert len(cloud.data) == 16 * len(seen.readings[0].surface.position_mm)
        lens, pose = (
            next(reader.iter_decoded_messages(topics=[topic])).decoded_message
            for topic in ("/calibration", "/transform")
        )
        sensor = Recording(path).sensor
        assert lens.frame_id == images[0].decoded_message.frame_id == pose.parent_frame_id
        assert pose.child_frame_id == cloud.frame_id
        shown_px = np.reshape(lens.P, (3, 4)) @ [*seen_from_the_camera(pose, (3.0, -2.0, 0.5)), 1.0]
        true_px = project(sensor.camera, np.array([[3.0, -2.0, 0.5]]))[0]
        np.testing.assert_allclose(shown_px[:2] / shown_px[2], true_px, rtol=1e-9)
        session = json.loads(next(reader.iter_messages(topics=["/session"]))[2].data)
        assert session["method"] == "mechanics"
        assert session["versions"]["manytouch"]
        assert session["parameters"]["detect"]["type"] == "DotSearch"
        deepest = max(
            (json.loads(message.data) for _, _, message in reader.iter_messages(topics=["/reading"])),
            key=lambda reading: len(reading["contacts"]),
        )
        assert deepest["contacts"][0]["depth_mm"] > 0


@PNG_UNLESS_SLOW
def test_a_file_that_was_cut_off_is_good_up_to_there(
    recorded: tuple[Path, Seen, Live], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, seen, _ = recorded
    whole = path.read_bytes()
    last = 0
    for share in (0.3, 0.55, 0.8, 0.999):
        cut = tmp_path / f"cut{share}.mcap"
        cut.write_bytes(whole[: int(share * len(whole))])
        recording = Recording(cut)
        assert len(recording) >= last
        last = len(recording)
        assert recording.is_complete == (share == 0.999), "of the last only the index is cut"
        again = Seen()
        playback = Playback(cut)
        run(playback, [again])
        assert len(again.readings) >= max(last - 4, 1), "readings follow their frames"
        for one, other in zip(again.readings, seen.readings, strict=False):
            assert alike(without_time(one), without_time(other))
        if share < 0.999:
            assert any("was cut off" in note for note in playback.health().notes)
    assert last == 40


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "empty"), (b"not an mcap at all", "not an MCAP file"), (b"\x89MCAP0\r\n", "truncated")],
)
def test_what_is_no_recording_is_one_sentence(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(SourceError, match=words):
        open_source(str(path))


@pytest.mark.parametrize("seed", [3, pytest.param(11, marks=pytest.mark.slow)])
def test_a_killed_recording_loses_less_than_200_ms(tmp_path: Path, seed: int) -> None:
    recording = kill_recording(tmp_path, seed)
    assert recording is not None
    again = Seen()
    run(Playback(recording.path), [again])
    assert len(again.readings) >= len(recording) - 1
    assert repair(recording.path, tmp_path / "repaired.mcap") > 2 * len(recording)
    assert Recording(tmp_path / "repaired.mcap").is_complete


class FullDisk(UnbufferedFile):
    """A disk with room for so many bytes."""

    def __init__(self, path: Path, room: int) -> None:
        super().__init__(path)
        self._room = room

    def write(self, data: bytes) -> int:
        if self.tell() + len(data) > self._room:
            part = max(self._room - self.tell(), 0)
            super().write(bytes(data)[:part])
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)


def test_a_disk_that_fills_up_ends_the_recording_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "UnbufferedFile", lambda path: FullDisk(path, 700_000))
    path = tmp_path / "full.mcap"
    live = Live(prepare(Pictures(frames=60)), record=path)
    seen = Seen()
    run(live, [seen])
    assert len(seen.readings) == 60, "sensing goes on"
    assert live.health().recording is None
    (note,) = [note for note in live.health().notes if "disk is full" in note]
    kept = int(note.split(";")[1].split()[0])
    assert 3 < kept < 60
    recording = Recording(path)
    assert len(recording) == kept
    assert path.stat().st_size <= 700_000
    assert "MB were written" in note
    assert re.search(r" when 0\.\d{3} MB were written and \d[\d.]* MB were free", note), note
    assert "e+" not in note
    again = Seen()
    run(Playback(path), [again])
    assert len(again.readings) >= kept - 5, "readings follow their frames"


def recorded_with(path: Path, change: Callable[[Frame], Frame]) -> tuple[Recorder, Recording]:
    """Frames, all of them changed, in a recording."""
    job = prepare(Pictures(frames=20, is_jpeg=False))
    recorder = Recorder(path, source=job.input_info)
    recorder.describe(job.sensor, job.pipeline, job.method)
    for frame in job.frames:
        recorder.take(change(frame))
    recorder.close()
    return recorder, Recording(path)


def test_a_frame_whose_image_has_no_pixels_does_not_end_the_recording(tmp_path: Path) -> None:
    def without_pixels(frame: Frame) -> Frame:
        return replace(frame, image=np.empty((0, 320), np.uint8)) if frame.index == 9 else frame

    recorder, recording = recorded_with(tmp_path / "x.mcap", without_pixels)
    assert recorder.ended == "recorded x.mcap; 20 frames were recorded"
    assert [recording.frame(place).encoded is None for place in range(20)] == [k == 9 for k in range(20)]


def test_a_camera_whose_name_is_no_unicode_is_recorded(tmp_path: Path) -> None:
    _, recording = recorded_with(tmp_path / "x.mcap", lambda frame: replace(frame, camera="a\udcff"))
    assert [recording.frame(place).camera for place in range(20)] == ["a?"] * 20


def test_numbers_that_do_not_increase_are_stated(tmp_path: Path) -> None:
    recorder, recording = recorded_with(
        tmp_path / "x.mcap", lambda frame: replace(frame, index=frame.index % 15)
    )
    assert len(recording) == 15
    assert recorder.ended is not None
    assert "20 frames were recorded, 5 of them with numbers that are not larger" in recorder.ended


def test_what_cannot_be_packed_ends_the_recording_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_value(reading: Reading) -> bytes:
        if reading.frame.index == 20:
            raise TypeError("Ghost is no value")
        return b"{}"

    monkeypatch.setattr("manytouch.recording.writer.encode_reading", no_value)
    live = Live(prepare(Pictures(frames=40)), record=tmp_path / "x.mcap")
    seen = Seen()
    run(live, [seen])
    assert len(seen.readings) == 40
    assert any("Ghost is no value: x.mcap ended" in note for note in live.health().notes)
    recording = Recording(tmp_path / "x.mcap")
    assert recording.is_complete
    assert len(recording) >= 20


def test_room_is_kept_for_the_end_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    queries: list[Path] = []

    def free(folder: Path) -> int:
        queries.append(folder)
        return 0 if len(queries) > 1 else 2**40

    monkeypatch.setattr(recorder_module, "free_bytes", free)
    path = tmp_path / "nearly.mcap"
    live = Live(prepare(Pictures(frames=60)), record=path)
    seen = Seen()
    run(live, [seen])
    assert len(seen.readings) == 60
    assert any("disk is full" in note for note in live.health().notes)
    recording = Recording(path)
    assert recording.is_complete, "with its index"
    assert 3 < len(recording) < 60


@pytest.mark.parametrize("later_ns", [-(10**9), 10**10, 2**62])
def test_a_recording_of_times_that_do_not_count_from_the_start_ends_with_a_sentence(
    tmp_path: Path, later_ns: int
) -> None:
    job = prepare(Pictures(frames=20))
    recorder = Recorder(tmp_path / "x.mcap", source=job.input_info)
    recorder.describe(job.sensor, job.pipeline, job.method)
    begin_ns = time.time_ns() + later_ns
    for frame in job.frames:
        recorder.take(replace(frame, timestamp_ns=begin_ns + frame.timestamp_ns))
    recorder.close()
    assert recorder.ended is not None
    assert re.match(
        r"frame 0 has the time \d+ s, .* less than 10 years: x.mcap ended; 0 frames", recorder.ended
    )


def test_an_error_at_the_end_of_a_recording_is_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object) -> None:
        raise ValueError("no index")

    monkeypatch.setattr("manytouch.recording.writer.RecordingWriter.finish", fail)
    live = Live(prepare(Pictures(frames=20)), record=tmp_path / "x.mcap")
    run(live, [])
    assert any("no index: x.mcap ended" in note for note in live.health().notes)
    assert len(Recording(tmp_path / "x.mcap")) == 20


@pytest.mark.skipif(sys.platform == "win32", reason="locks of Windows would keep readers out")
def test_two_sessions_do_not_record_into_one_file(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    first = Recorder(path, source={})
    with pytest.raises(OutputError, match="is being recorded by another session"):
        Recorder(path, source={})
    first.close()
    Recorder(path, source={}).close()


def test_a_recording_that_cannot_begin_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    live = Live(prepare(Pictures(frames=20)), record=tmp_path / "file" / "x.mcap")
    with pytest.raises(OutputError, match="cannot be written"):
        run(live, [Seen()])


def test_a_button_begins_and_ends_a_recording(tmp_path: Path) -> None:
    live = Live(prepare(Pictures(frames=60)), recordings=tmp_path)
    seen = Seen(live, at_10=Record(), at_20=Record(), at_30=UseMethod(method="paper"), at_45=StopRecording())
    run(live, [seen])
    (path,) = tmp_path.glob("recording-*.mcap")
    assert any("stop it first" in note for note in live.health().notes)
    recording = Recording(path)
    assert recording.is_complete
    assert 30 <= len(recording) <= 45
    assert recording.frames[0].sequence >= 10
    assert recording.has_reading(0)


def test_a_number_of_a_frame_that_is_too_large_is_one_sentence(tmp_path: Path) -> None:
    job = prepare(Pictures(frames=20))
    path = tmp_path / "late.mcap"
    recorder = Recorder(path, source=job.input_info)
    recorder.describe(job.sensor, job.pipeline, job.method)
    for frame in job.frames:
        object.__setattr__(frame, "index", frame.index + 2**31 - 5)  # as of another program
        recorder.take(frame)
    recorder.close()
    with pytest.raises(SourceError, match=r"late\.mcap' has a frame with the number 2147483648, larger than"):
        open_source(path)


def test_frames_that_nobody_reads_are_recorded_and_noted(tmp_path: Path) -> None:
    job = prepare(Pictures(frames=20))
    readings = list(job.readings())
    path = tmp_path / "some.mcap"
    recorder = Recorder(path, source=job.input_info)
    recorder.describe(job.sensor, job.pipeline, job.method)
    recorder.write(readings[0])  # its frame came before the recording began
    for reading in readings[2:]:
        recorder.take(reading.frame)
        if reading.frame.index % 2:
            recorder.write(reading)
    recorder.close()
    recording = Recording(path)
    assert [place.sequence for place in recording.frames] == list(range(2, 20))
    assert [recording.has_reading(place) for place in range(18)] == [
        bool(index % 2) for index in range(2, 20)
    ]


def test_what_the_disk_is_too_slow_for_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate = threading.Event()

    class Stuck(UnbufferedFile):
        def write(self, data: bytes) -> int:
            gate.wait(10)
            return super().write(data)

    monkeypatch.setattr(recorder_module, "UnbufferedFile", Stuck)
    monkeypatch.setattr(recorder_module, "MAX_QUEUED_BYTES", 100_000)
    job = prepare(Pictures(frames=15))
    recorder = Recorder(tmp_path / "slow.mcap", source={})
    recorder.describe(job.sensor, job.pipeline, job.method)
    for index in range(20):
        recorder.take(Frame(index=index, timestamp_ns=index, camera="x", image=None, encoded=bytes(30_000)))
    gate.set()
    recorder.close()
    assert recorder.lost == 17
    assert recorder.frames == 3
    assert "17 were lost because encoding or the disk was too slow" in (recorder.ended or "")


def test_a_timeline_is_scrubbed(recorded: tuple[Path, Seen, Live]) -> None:
    path, seen, _ = recorded
    playback = Playback(path, stays=True)
    again = Seen(playback, at_5=Pause(), at_6=Seek(frame=33))
    is_over = threading.Event()
    runner = threading.Thread(target=lambda: run(playback, [again], stop=is_over.is_set))
    runner.start()

    def wait(until: Any) -> None:
        deadline = time.monotonic() + 20
        while not until() and time.monotonic() < deadline:
            time.sleep(0.01)
        assert until()

    wait(lambda: not playback.health().is_running)
    playback.send(Seek(frame=33))
    wait(lambda: again.readings[-1].frame.index == 33)
    playback.send(Seek(frame=12))
    wait(lambda: again.readings[-1].frame.index == 12)
    assert playback.health().frame == 12
    assert playback.health().frame_count == 40
    assert alike(without_time(again.readings[-1]), without_time(seen.readings[12]))
    playback.send(Seek(frame=4000))
    wait(lambda: any("0 to 39" in note for note in playback.health().notes))
    playback.send(Play(speed=10.0))
    playback.send(Resume())
    wait(lambda: again.readings[-1].frame.index == 39)
    playback.send(Seek(frame=38))
    wait(lambda: again.readings[-2].frame.index == 38)
    is_over.set()
    runner.join(timeout=10)
    assert not runner.is_alive()


def test_phases_are_their_own_type_again(recorded: tuple[Path, Seen, Live]) -> None:
    contacts = [c for reading in recorded[1].readings for c in reading.contacts.contacts]
    back = from_json(to_json(contacts[0]))
    assert isinstance(back, Contact)
    assert back.phase is Phase(contacts[0].phase)
