"""Damaged, hostile, cut and old recordings: what is whole replays, and nothing wrong is taken for right."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from command_line import run_command
from faults.mcap_fuzzer import FRAMES, KINDS, damaged, run_recording, small_recording
from manytouch.errors import SourceError
from manytouch.recording.json_codec import to_json
from manytouch.recording.merge import merge_recordings
from manytouch.recording.messages import calibration_message, transform_message
from manytouch.recording.reader import Recording
from manytouch.recording.records import scan
from manytouch.recording.repair import check, repair
from manytouch.session import Playback, run
from manytouch.sinks.recorder import encode_frame
from manytouch.sources import open_source
from manytouch.values import Frame, Reading, Sensor, Status

pytest.importorskip("mcap")


class Shown:
    """A sink that keeps its readings."""

    def __init__(self) -> None:
        self.readings: list[Reading] = []

    def write(self, reading: Reading) -> None:
        self.readings.append(reading)

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def made() -> tuple[Path, list[Reading], Sensor]:
    """A small recording, its readings and its sensor."""
    recording = small_recording()
    readings = [recording.reading(recording.frame(place)) for place in range(FRAMES)]
    return recording.path, [reading for reading in readings if reading is not None], recording.sensor


@pytest.mark.parametrize(
    "seeds", [range(124, 144), pytest.param(range(400), marks=pytest.mark.slow)], ids=["some", "many"]
)
def test_damages_of_every_kind_are_refused_or_replayed(tmp_path: Path, seeds: range) -> None:
    whole = small_recording().path.read_bytes()
    assert {damaged(whole, seed)[0] for seed in seeds} == set(KINDS)
    refused = 0
    for seed in seeds:
        try:
            run_recording(seed, tmp_path)
        except SourceError:
            refused += 1
        except Exception as error:
            raise AssertionError(f"seed {seed}") from error
    assert 0 < refused < len(seeds) / 2


def chunk_of(path: Path, topic: str, number: int) -> tuple[int, int]:
    place = scan(path).topic(topic)[number]
    return place.chunk.begin, place.chunk.end


def with_bad_byte(
    path: Path, damaged_path: Path, topic: str, number: int, *, onto: Path | None = None
) -> None:
    content = bytearray((onto or path).read_bytes())
    begin, end = chunk_of(path, topic, number)
    content[(begin + end) // 2] ^= 0x55
    damaged_path.write_bytes(content)


def test_a_bad_byte_in_an_image_costs_this_image(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path
) -> None:
    path = tmp_path / "bad.mcap"
    with_bad_byte(made[0], path, "/camera", 5)
    source = open_source(path)
    frames = list(source)
    assert [frame.index for frame in frames] == list(range(FRAMES))
    assert [frame.index for frame in frames if frame.image is None] == [5]
    assert frames[4].timestamp_ns < frames[5].timestamp_ns < frames[6].timestamp_ns
    assert source.capabilities.seek is not None
    assert "1 of 16 frames are lost" in (source.capabilities.seek.warning or "")
    done = run_command("process", path, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "bad" / "summary.json").read_text())
    assert summary["counts"]["status"] == {"decode_error": 1, "ok": FRAMES - 1}
    assert any("are damaged, and 1 of 16 frames" in sentence for sentence in summary["odd"])


def test_a_bad_byte_in_a_reading_costs_this_reading(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path
) -> None:
    path = tmp_path / "bad.mcap"
    with_bad_byte(made[0], path, "/reading", 7)
    timeline = open_source(path).capabilities.seek
    assert timeline is not None
    found = [timeline.reading(place) for place in range(FRAMES)]
    statuses = [None if reading is None else reading.status for reading in found]
    expected = [reading.status for reading in made[1]]
    assert statuses == [*expected[:7], Status.DECODE_ERROR, *expected[8:]]
    assert "and the readings of 1 frames" in (timeline.warning or "")
    assert "lost: the readings of 1 frames" in list(check(path).lines())
    shown = Shown()
    run(Playback(path), [shown])
    assert [reading.status for reading in shown.readings] == statuses


@pytest.mark.parametrize(("begin", "end"), [(0, 3), (6, 9), (FRAMES - 2, FRAMES)])
def test_readings_that_are_lost_one_after_the_other_are_damaged_frames(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path, begin: int, end: int
) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(made[0].read_bytes())
    for number in range(begin, end):
        for topic in ("/reading", "/surface"):
            with_bad_byte(made[0], path, topic, number, onto=path)
    recording = Recording(path)
    readings = [recording.reading(recording.frame(place)) for place in range(FRAMES)]
    damaged = [place for place, reading in enumerate(readings) if reading and reading.status != "ok"]
    assert damaged == list(range(begin, end))
    assert recording.damaged_readings == end - begin
    assert not any(recording.frame(place).encoded is None for place in damaged)


def test_a_bad_byte_in_the_first_session_is_replaced_by_its_copy(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path
) -> None:
    path = tmp_path / "bad.mcap"
    with_bad_byte(made[0], path, "/session", 0)
    recording = Recording(path)
    assert len(recording) == FRAMES
    np.testing.assert_array_equal(recording.sensor.layout.rest_mm, made[2].layout.rest_mm)


def test_check_and_repair_from_the_command_line(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path
) -> None:
    done = run_command("recording", "check", made[0])
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "whole"
    cut = tmp_path / "cut.mcap"
    with_bad_byte(made[0], cut, "/camera", 3)
    cut.write_bytes(cut.read_bytes()[: chunk_of(made[0], "/camera", 10)[1] + 100])
    done = run_command("recording", "check", cut)
    assert done.returncode == 1
    assert "cut off: it has no end" in done.stdout
    assert "/camera: 10 whole messages" in done.stdout
    assert "lost: 1 frames" in done.stdout
    assert "recording repair" in done.stderr
    done = run_command("recording", "repair", cut)
    assert done.returncode == 0, done.stderr
    repaired = tmp_path / "cut-repaired.mcap"
    assert check(repaired).is_whole
    assert len(Recording(repaired)) == 10
    assert run_command("recording", "repair", cut).returncode == 1, "nothing is overwritten"
    done = run_command("recording", "check", tmp_path / "absent.mcap")
    assert done.returncode == 1
    assert "There is no" in done.stderr
    from mcap.reader import make_reader

    with repaired.open("rb") as file:
        assert make_reader(file, validate_crcs=True).get_summary() is not None


def test_a_damaged_index_is_reported_and_everything_replays(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path
) -> None:
    content = bytearray(made[0].read_bytes())
    content[-200] ^= 0x10
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    assert len(Recording(path)) == FRAMES
    report = check(path)
    assert not report.is_whole
    assert any("index is damaged" in line for line in report.lines())
    repair(path, tmp_path / "good.mcap")
    assert check(tmp_path / "good.mcap").is_whole


def test_repair_refuses_a_file_of_which_nothing_is_whole(tmp_path: Path) -> None:
    (tmp_path / "x.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(1000))
    done = run_command("recording", "repair", tmp_path / "x.mcap", "--out", tmp_path / "y.mcap")
    assert done.returncode == 1
    assert "nothing of" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["x.mcap"]


@pytest.mark.parametrize(
    "words",
    [
        ("recording", "check", "{file}"),
        ("recording", "repair", "{file}", "--out", "{folder}/y.mcap"),
        ("view", "{file}"),
        ("run", "{file}", "--no-view"),
        ("export", "{file}", "--parquet", "{folder}/tables"),
    ],
)
def test_a_recording_that_may_not_be_read_is_refused_in_one_sentence(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path, monkeypatch, words: tuple[str, ...]
) -> None:
    as_it_is = Path.open

    def refuse(self: Path, *args, **named):
        if self == made[0]:
            raise PermissionError(13, "Permission denied", str(self))
        return as_it_is(self, *args, **named)

    monkeypatch.setattr(Path, "open", refuse)
    done = run_command(*(word.format(file=made[0], folder=tmp_path) for word in words))
    assert done.returncode == 1
    sentence = f"{str(made[0])!r} cannot be read: Permission denied; give a file that can be read"
    assert done.stderr == f"manytouch: {sentence}\n"


def old_recording(path: Path, readings: list[Reading], sensor: Sensor) -> None:
    """A recording as version 0.1 wrote it: JSON with arrays in base64, no compression, chunks of 16 kB."""
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
    from mcap.writer import CompressionType, Writer
    from mcap_protobuf.schema import register_schema

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2**14, compression=CompressionType.NONE)
        writer.start(profile="manytouch", library="manytouch")
        image_schema = register_schema(writer, CompressedImage)
        camera = writer.register_channel("/camera", "protobuf", image_schema)
        schemas = [writer.register_schema(name, "jsonschema", b"{}") for name in ("Reading", "Session")]
        reading_channel = writer.register_channel("/reading", "json", schemas[0])
        session_channel = writer.register_channel("/session", "json", schemas[1])
        about = {
            "schema": 1,
            "started_unix_ns": 10**18,
            "source": {},
            "method": "perimeter",
            "parameters": {},
            "versions": {},
        }
        session = json.dumps({**about, "sensor": to_json(sensor)}).encode()
        writer.add_message(session_channel, 10**18, session, 10**18, 0)
        for reading in readings:
            number, log_ns = reading.frame.index, 10**18 + reading.frame.timestamp_ns
            encoded, suffix = encode_frame(reading.frame)
            assert encoded
            image = CompressedImage(frame_id="drawn", data=encoded, format=suffix).SerializeToString()
            writer.add_message(camera, log_ns, image, log_ns, number)
            values = {
                name: to_json(getattr(reading, name))
                for name in ("detections", "grid", "surface", "contacts")
            }
            values["surface"]["layout"] = None
            message = {"frame": number, "milliseconds": reading.milliseconds, "values": values}
            writer.add_message(reading_channel, log_ns, json.dumps(message).encode(), log_ns, number)
        writer.finish()


def test_recordings_of_version_0_1_replay_to_the_last_bit(
    made: tuple[Path, list[Reading], Sensor], tmp_path: Path
) -> None:
    path, readings = tmp_path / "old.mcap", made[1]
    old_recording(path, readings, made[2])
    timeline = open_source(path).capabilities.seek
    assert timeline is not None
    assert len(timeline) == FRAMES
    for place, reading in enumerate(readings):
        again = timeline.reading(place)
        assert again is not None
        np.testing.assert_array_equal(again.surface.covariance_mm2, reading.surface.covariance_mm2)
        np.testing.assert_array_equal(again.grid.position_px, reading.grid.position_px)
        assert again.status is Status.OK
    assert check(path).is_whole
    assert 2 * made[0].stat().st_size < path.stat().st_size + sum(
        len(encode_frame(reading.frame)[0]) for reading in readings
    )


@pytest.mark.parametrize("describe", [calibration_message, transform_message])
def test_messages_for_other_programs_can_be_made_of_a_recorded_sensor(
    made: tuple[Path, list[Reading], Sensor], describe: Callable[..., object]
) -> None:
    assert describe(Recording(made[0]).sensor.camera, "camera", 0)


def test_a_frame_of_another_number_is_not_in_the_recording(
    made: tuple[Path, list[Reading], Sensor],
) -> None:
    bare = Frame(index=FRAMES + 1, timestamp_ns=0, camera="", image=None)
    assert Recording(made[0]).reading(bare) is None


@pytest.fixture(scope="module")
def rig(made: tuple[Path, list[Reading], Sensor]) -> Path:
    """A recording of a rig: the small recording as two sensors."""
    path = made[0].with_name("hand.mcap")
    merge_recordings({"index": [made[0]], "thumb": [made[0]]}, path)
    return path


def test_a_whole_recording_of_a_rig_is_whole(rig: Path) -> None:
    found = check(rig)
    assert found.is_whole, found
    assert found.sensors == ("index", "thumb")
    assert any("sensors index, thumb" in line for line in found.lines())
    done = run_command("recording", "check", rig)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "whole")


def test_a_damaged_recording_of_a_rig_is_repaired(rig: Path, tmp_path: Path) -> None:
    damaged, repaired = tmp_path / "damaged.mcap", tmp_path / "repaired.mcap"
    with_bad_byte(rig, damaged, "/thumb/camera", 5)
    found = check(damaged)
    assert not found.is_whole
    assert found.lost_frames == 1
    before = sum(len(places) for places in scan(damaged).messages.values())
    assert repair(damaged, repaired) == before
    assert [len(Recording(repaired, name)) for name in ("index", "thumb")] == [FRAMES, FRAMES - 1]
    assert check(repaired).is_whole
