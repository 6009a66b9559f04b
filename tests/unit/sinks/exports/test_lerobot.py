"""A LeRobot data set: the layout of v3.0, its counters, and a video that decodes to the frames."""

import json
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest

from manytouch.errors import OutputError
from manytouch.recording.reader import Recording
from manytouch.session import pipeline_for
from manytouch.sinks.exports import lerobot_schema as schema
from manytouch.sinks.exports.parquet import description
from manytouch.sinks.exports.registry import export
from manytouch.sinks.recorder import Recorder
from manytouch.values.sensor_file.read import load_sensor

FRAMES = 5


@pytest.fixture
def dataset(record, tmp_path: Path) -> Path:
    paths = [record(tmp_path / "first.mcap"), record(tmp_path / "second.mcap")]
    (folder,) = export(paths, "lerobot", tmp_path / "set")
    return folder


def test_the_columns_are_those_of_the_described_features(dataset: Path) -> None:
    info = json.loads((dataset / "meta" / "info.json").read_text())
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 25)
    assert (info["total_episodes"], info["total_frames"], info["splits"]) == (2, 10, {"train": "0:2"})
    table = pq.read_table(dataset / info["data_path"].format(chunk_index=0, file_index=0))
    stored = {name for name, each in info["features"].items() if each["dtype"] != "video"}
    assert set(table.column_names) == stored
    for name in stored:
        shape = tuple(info["features"][name]["shape"])
        values = np.array(table[name].to_pylist())
        assert values.shape == ((10,) if shape == (1,) else (10, *shape)), name
        assert (
            values.dtype.kind == {"float32": "f", "int64": "i", "bool": "b"}[info["features"][name]["dtype"]]
        )
    assert table["episode_index"].to_pylist() == [0] * 5 + [1] * 5
    assert table["index"].to_pylist() == list(range(10))
    assert table["timestamp"].to_pylist()[5:7] == pytest.approx([0.0, 0.04])
    wrench = np.array(table["observation.tactile.wrench"].to_pylist())
    assert wrench[:5, 2].tolist() == [-1.0, -2.0, -3.0, -4.0, -5.0]
    contacts = np.array(table["observation.tactile.contacts"].to_pylist())
    assert contacts[1, 0].tolist() == [1.0, 2.5, -1.25, 1.5, 0.125, 0.25, -2.0, 12.0]
    assert not contacts[:, 1:].any()
    std = np.array(table["observation.tactile.contacts_std"].to_pylist())
    assert std[1, 0] == pytest.approx([0.2, 0.3, 0.5, 0, 0, 0, 0], abs=1e-3)
    is_known = np.array(table["observation.tactile.contacts_std_is_known"].to_pylist())
    assert is_known[1, 0].tolist() == [True] * 3 + [False] * 4
    assert table["observation.tactile.is_valid"].to_pylist() == [True] * 10
    assert table["observation.tactile.wrench_is_known"].to_pylist() == [[True, False]] * 10
    known = np.array(table["observation.tactile.displacement_is_known"].to_pylist())
    assert known.sum(axis=1).tolist() == [23] * 10  # of 24 markers one is absent


def test_what_is_nominal_or_assumed_is_named(dataset: Path) -> None:
    first, second = json.loads((dataset / "meta" / "manytouch.json").read_text())
    assert first["assumptions"] == ["The camera has no distortion."]
    assert first["nominal"] == []
    assert first == {**second, "started_unix_ns": first["started_unix_ns"]}
    mini = description(load_sensor("gelsight-mini"), {})
    assert mini["nominal"] == ["camera", "sheet", "markers"]
    assert mini["sheet_std"]["young_std_MPa"] > 0.0
    assert json.dumps(mini)


def test_deviations_of_the_wrench_follow_from_those_of_the_contacts(sensor, contact_of, reading_of) -> None:
    known = schema.features(sensor, 25, (320, 240))
    rng = np.random.default_rng(3)
    factor = rng.normal(size=(8, 8)) * 0.01
    covariance = factor @ factor.T
    contact = contact_of(
        force_N=np.array([0.3, -0.2, -2.0]), torque_Nmm=4.0, area_mm2=9.0, covariance=covariance
    )
    found = schema.values(reading_of(0, (contact,)), known)
    mean = np.array([*contact.centre_mm, contact.depth_mm, 0.3, -0.2, 2.0, 4.0, 9.0])
    x, y, _, fx, fy, n, torque, _ = rng.multivariate_normal(mean, covariance, 200_000).T
    drawn = np.array([fx, fy, -n, -y * n, x * n, x * fy - y * fx + torque])
    assert found["observation.tactile.wrench"] == pytest.approx(drawn.mean(axis=1), abs=0.01)
    assert found["observation.tactile.wrench_std"] == pytest.approx(drawn.std(axis=1), rel=0.02)
    assert found["observation.tactile.wrench_is_known"].all()


def test_every_episode_has_its_rows_and_its_video(dataset: Path) -> None:
    info = json.loads((dataset / "meta" / "info.json").read_text())
    episodes = pq.read_table(dataset / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in episodes] == [(0, 5), (5, 10)]
    key = "observation.images.tactile"
    for row in episodes:
        path = dataset / info["video_path"].format(
            video_key=key,
            chunk_index=row[f"videos/{key}/chunk_index"],
            file_index=row[f"videos/{key}/file_index"],
        )
        with av.open(str(path)) as video:
            frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
        assert len(frames) == row["length"] == FRAMES
        assert list(frames[0].shape) == info["features"][key]["shape"]
        assert abs(float(frames[0].mean()) - 180.0) < 3.0


def test_statistics_are_those_of_all_frames(dataset: Path) -> None:
    stats = json.loads((dataset / "meta" / "stats.json").read_text())
    wrench = stats["observation.tactile.wrench"]
    assert wrench["min"][2] == -5.0
    assert wrench["mean"][2] == pytest.approx(-3.0)
    assert wrench["std"][2] == pytest.approx(np.sqrt(2.0))
    assert wrench["count"] == [10]
    assert stats["index"]["std"][0] == pytest.approx(np.arange(10).std())
    assert np.shape(stats["observation.images.tactile"]["mean"]) == (3, 1, 1)
    assert np.ravel(stats["observation.images.tactile"]["mean"]) == pytest.approx(180 / 255, abs=1e-6)


def test_frames_that_a_camera_recorded_but_a_slow_session_did_not_process_do_not_shorten_the_time(
    sensor, reading_of, tmp_path: Path
) -> None:
    recorder = Recorder(tmp_path / "slow.mcap", source={})
    recorder.describe(sensor, pipeline_for("perimeter"), "perimeter")
    for index in range(13):  # 25 frames per second, of which every fifth is processed
        reading = reading_of(index)
        recorder.take(reading.frame)
        if index % 5 == 0:
            recorder.write(reading)
    recorder.close()
    recording = Recording(tmp_path / "slow.mcap")
    (folder,) = export([tmp_path / "slow.mcap"], "lerobot", tmp_path / "set")
    info = json.loads((folder / "meta" / "info.json").read_text())
    assert (info["fps"], info["total_frames"]) == (5, 3)
    table = pq.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    times_s = [1e-9 * recording.timestamp_ns(place) for place in (0, 5, 10)]
    assert table["timestamp"].to_pylist() == pytest.approx(times_s)


def test_recordings_of_different_rates_are_refused(record, sensor, reading_of, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "half.mcap", source={})
    recorder.describe(sensor, pipeline_for("perimeter"), "perimeter")
    for index in range(0, 8, 2):
        reading = reading_of(index)
        recorder.take(reading.frame)
        recorder.write(reading)
    recorder.close()
    first = record(tmp_path / "first.mcap")
    with pytest.raises(OutputError, match=r"half.mcap has 12 frames per second, the first recording 25"):
        export([first, tmp_path / "half.mcap"], "lerobot", tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_recordings_of_different_sensors_are_refused(record, sensor, tmp_path: Path) -> None:
    first = record(tmp_path / "first.mcap")
    other = tmp_path / "other.mcap"
    recorder = Recorder(other, source={})
    recorder.describe(sensor, pipeline_for("perimeter"), "perimeter")
    recording = Recording(first)
    frame = recording.frame(0)
    reading = recording.reading(frame)
    wide = replace(frame, image=np.full((240, 300), 90, np.uint8), encoded=None)
    recorder.take(wide)
    recorder.write(replace(reading, frame=wide))
    recorder.close()
    with pytest.raises(OutputError, match="another image size or number of markers"):
        export([first, other], "lerobot", tmp_path / "set")
    assert not (tmp_path / "set").exists()
