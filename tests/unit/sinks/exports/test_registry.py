"""Exports as programs of other authors read them: mcap-ros2-support, rosbags, xarray, h5py, pyarrow."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from command_line import run_command
from manytouch.errors import OutputError, SourceError
from manytouch.recording.merge import merge_recordings
from manytouch.recording.repair import check, repair
from manytouch.session import pipeline_for
from manytouch.sinks.exports.registry import FORMATS, export
from manytouch.sinks.recorder import Recorder

FRAMES = 5


def test_a_bag_opens_in_readers_of_others_with_the_recorded_values(record, tmp_path: Path) -> None:
    (bag,) = export([record(tmp_path / "press.mcap")], "ros2bag", tmp_path / "bags")
    (file,) = bag.glob("*.mcap")
    assert file.name == "press.mcap"
    found: dict[str, list] = {}
    with file.open("rb") as opened:
        reader = make_reader(opened, decoder_factories=[DecoderFactory()])
        for _, channel, _, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(decoded)
    assert {topic: len(each) for topic, each in found.items()} == {
        "/tf_static": 1,
        "/manytouch/image/compressed": FRAMES,
        "/manytouch/camera_info": FRAMES,
        "/manytouch/wrench": FRAMES,
        "/manytouch/contacts": FRAMES,
        "/manytouch/surface": FRAMES,
        "/manytouch/contact_markers": FRAMES,
    }
    forces = [(m.wrench.force.x, m.wrench.force.y, m.wrench.force.z) for m in found["/manytouch/wrench"]]
    assert forces == [(0.125, 0.25, -1.0 - index) for index in range(FRAMES)]
    cloud = found["/manytouch/surface"][2]
    points = np.frombuffer(cloud.data, "<f4").reshape(cloud.width, -1)
    assert points[0] == pytest.approx([-12.4e-3, -6.2e-3, -2.5e-3, 2.5e-3, np.nan], nan_ok=True, rel=1e-3)
    stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in found["/manytouch/wrench"]]
    assert np.diff(stamps).tolist() == [40_000_000] * (FRAMES - 1)
    with AnyReader([bag]) as bag_reader:
        assert bag_reader.message_count == 1 + 6 * FRAMES


def test_the_pose_of_a_bag_is_kept_for_readers_that_start_after_it_was_played(record, tmp_path: Path) -> None:
    (bag,) = export([record(tmp_path / "press.mcap")], "ros2bag", tmp_path / "bags")
    with AnyReader([bag]) as reader:
        profiles = {each.topic: each.ext.offered_qos_profiles for each in reader.connections}
    (pose,) = profiles.pop("/tf_static")  # what listeners of tf2 request; the player offers it only if stated
    assert (pose.durability.name, pose.reliability.name) == ("TRANSIENT_LOCAL", "RELIABLE")
    assert not any(profiles.values())  # the player then offers what every reader of sensor data takes


def test_xarray_opens_the_surface_with_units_and_coordinates(record, tmp_path: Path) -> None:
    (path,) = export([record(tmp_path / "press.mcap")], "hdf5", tmp_path / "out")
    with xarray.open_dataset(path, group="surface", engine="h5netcdf") as surface:
        depth = surface["depth_mm"]
        assert depth.dims == ("time_s", "y_mm", "x_mm")
        assert depth.attrs["units"] == "mm"
        assert depth["time_s"].values.tolist() == pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16])
        std = surface["depth_std_mm"]
        assert (std.dims, std.shape) == (depth.dims, depth.shape)
        assert float(std.max()) > 0.0
        deepest = depth.max(dim=("y_mm", "x_mm")).values
    assert deepest == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5], rel=1e-2)
    with h5py.File(path) as file:
        assert file["contacts/normal_force_N"][:].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
        assert file["contacts/normal_force_N"].attrs["units"] == "N"
        assert file["contacts/phase"].asstr()[0] == "start"
        assert file["markers/depth_mm"].attrs["frame"] == "sheet"
        assert bytes(file["images/encoded"][0][:4]) == b"\x89PNG"
        assert json.loads(file.attrs["manytouch"])["method"] == "perimeter"


def test_every_column_of_an_hdf5_file_that_is_a_quantity_has_the_unit_of_its_name(
    record, tmp_path: Path
) -> None:
    (path,) = export([record(tmp_path / "press.mcap")], "hdf5", tmp_path / "out")
    columns: dict[str, h5py.Dataset] = {}

    def collect(name: str, found: h5py.Dataset | h5py.Group) -> None:
        if isinstance(found, h5py.Dataset):
            columns[name] = found

    ends = ("mm", "mm2", "N", "Nmm", "px", "rad", "s")
    with h5py.File(path) as file:
        file.visititems(collect)
        units = {name: found.attrs.get("units") for name, found in columns.items()}
    expected = {name: name.rpartition("_")[2] for name in units if name.rpartition("_")[2] in ends}
    assert {name: units[name] for name in expected} == expected
    assert units["frames/milliseconds"] == "ms"
    assert len([name for name in expected if name.endswith("/time_s")]) == 5


def test_parquet_tables_have_units_and_every_line(record, tmp_path: Path) -> None:
    (folder,) = export([record(tmp_path / "press.mcap")], "parquet", tmp_path / "out")
    contacts = pq.read_table(folder / "contacts.parquet")
    assert contacts["depth_mm"].to_pylist() == [0.5, 1.5, 2.5, 3.5, 4.5]
    assert contacts["slip"].to_pylist() == [None] * FRAMES
    assert contacts.schema.field("depth_mm").metadata == {b"unit": b"mm", b"frame": b"sheet"}
    assert contacts.schema.field("x_px").metadata == {b"unit": b"px", b"frame": b"image"}
    assert pq.read_table(folder / "markers.parquet").num_rows == 23 * FRAMES
    assert pq.read_table(folder / "regions.parquet").num_rows == FRAMES
    frames = pq.read_table(folder / "frames.parquet")
    assert frames["status"].to_pylist() == ["ok"] * FRAMES
    assert frames.schema.field("milliseconds").metadata == {b"unit": b"ms"}
    assert sorted(path.name for path in folder.iterdir()) == [
        *("contacts.parquet", "frames.parquet", "markers.parquet", "regions.parquet")
    ]


def test_columns_of_parquet_tables_have_types_also_where_every_line_is_empty(record, tmp_path: Path) -> None:
    (folder,) = export([record(tmp_path / "press.mcap")], "parquet", tmp_path / "out")
    contacts, frames = (pq.read_schema(folder / f"{name}.parquet") for name in ("contacts", "frames"))
    assert not any(pa.types.is_null(each.type) for each in (*contacts, *frames))
    assert [contacts.field(name).type for name in ("slip", "shape_probability")] == [pa.int64(), pa.float64()]
    assert [frames.field(name).type for name in ("lost_ids", "new_ids")] == [pa.int64()] * 2


def test_tables_of_a_recording_without_readings_have_the_types_of_any_other(
    record, sensor, reading_of, tmp_path: Path
) -> None:
    recorder = Recorder(tmp_path / "unread.mcap", source={})
    recorder.describe(sensor, pipeline_for("perimeter"), "perimeter")
    recorder.take(reading_of(0).frame)
    recorder.close()
    paths = [record(tmp_path / "press.mcap"), tmp_path / "unread.mcap"]
    usual, empty = export(paths, "parquet", tmp_path / "out")
    for name in ("contacts", "frames", "markers", "regions"):
        assert pq.read_schema(empty / f"{name}.parquet") == pq.read_schema(usual / f"{name}.parquet"), name
        assert pq.read_table(empty / f"{name}.parquet").num_rows == 0
    assert pq.read_schema(usual / "frames.parquet").field("milliseconds").type == pa.float64()


def test_frames_have_the_method_of_the_recording_unless_it_was_changed(
    record, sensor, reading_of, tmp_path: Path
) -> None:
    changed = tmp_path / "changed.mcap"
    recorder = Recorder(changed, source={"name": "bench"})
    for index, method in enumerate(("perimeter", "paper")):
        recorder.describe(sensor, pipeline_for(method), method)
        reading = reading_of(index, (), depth_mm=0.5)
        recorder.take(reading.frame)
        recorder.write(reading)
    recorder.close()
    for path, methods in ((record(tmp_path / "press.mcap"), ["perimeter"] * FRAMES), (changed, [None] * 2)):
        (folder,) = export([path], "parquet", tmp_path / "out")
        assert pq.read_table(folder / "frames.parquet")["method"].to_pylist() == methods


def test_an_existing_result_is_never_replaced_and_a_failed_one_leaves_nothing(record, tmp_path: Path) -> None:
    recording = record(tmp_path / "press.mcap")
    for name in FORMATS:
        folder = tmp_path / name
        (result,) = export([recording], name, folder)
        with pytest.raises(OutputError, match="exists: remove it"):
            export([recording], name, folder)
        assert result.exists()
    with pytest.raises(SourceError):
        export([tmp_path / "missing.mcap"], "parquet", tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()


def test_a_format_that_fails_does_not_keep_the_others_from_being_written(record, tmp_path: Path) -> None:
    recording, made = record(tmp_path / "press.mcap"), tmp_path / "made"
    export([recording], "hdf5", made)
    words = ["--ros2bag", recording, "--hdf5", made, "--parquet", tmp_path / "tables"]
    done = run_command("export", recording, *words)
    assert done.returncode == 1
    of_bag, of_file = done.stderr.splitlines()
    assert of_bag.startswith("manytouch: --ros2bag: cannot write ")
    assert "press.mcap is a file, not a folder" in of_bag
    assert of_file.startswith("manytouch: --hdf5: ")
    assert "press.h5' exists: remove it" in of_file
    assert done.stdout.splitlines() == [str(tmp_path / "tables" / "press")]
    assert (tmp_path / "tables" / "press").is_dir()


def test_a_recording_that_was_cut_off_is_exported_with_one_warning(record, tmp_path: Path) -> None:
    whole, cut = record(tmp_path / "whole.mcap"), tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    words = ["--parquet", tmp_path / "tables", "--hdf5", tmp_path / "hdf5"]
    done = run_command("export", whole, cut, *words)
    assert done.returncode == 0
    assert done.stderr.count("warning") == 1
    assert "warning: cut.mcap was cut off; its " in done.stderr
    assert pq.read_table(tmp_path / "tables" / "cut" / "frames.parquet").num_rows < FRAMES


def test_a_bag_whose_lengths_are_pitches_comes_with_a_warning(sensor, reading_of, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "free.mcap", source={})
    recorder.describe(replace(sensor, scale_is_known=False), pipeline_for("perimeter"), "perimeter")
    reading = reading_of(0)
    recorder.take(reading.frame)
    recorder.write(reading)
    recorder.close()
    warnings: list[str] = []
    for name in ("ros2bag", "parquet"):  # the columns of tables state the unit
        export([tmp_path / "free.mcap"], name, tmp_path / name, warnings.append)
    (warning,) = warnings
    assert warning.startswith("free.mcap: lengths are not in metres: a pitch is published as 0.001")


def test_a_sensor_of_a_rig_is_exported_by_its_name(record, tmp_path: Path) -> None:
    one, rig = record(tmp_path / "one.mcap"), tmp_path / "hand.mcap"
    merge_recordings({"index": [one], "thumb-tip": [one]}, rig)
    assert check(rig).is_whole
    with pytest.raises(SourceError, match=r"sensors index, thumb-tip: give one as in hand\.mcap#index"):
        export([rig], "ros2bag", tmp_path / "bags")
    with pytest.raises(SourceError, match=r"hand\.mcap#index"):
        export([tmp_path / "gone.mcap#index"], "ros2bag", tmp_path / "bags")
    paths = [Path(f"{rig}#{name}") for name in ("index", "thumb-tip")]
    results = export(paths, "ros2bag", tmp_path / "bags")
    assert [path.name for path in results] == ["hand-index", "hand-thumb-tip"]
    for path, name in zip(results, ("index", "thumb_tip"), strict=True):
        with AnyReader([path]) as reader:
            topics = {each.topic for each in reader.connections}
        assert f"/manytouch/{name}/wrench" in topics
    with pytest.raises(SourceError, match="is the recording of one sensor: omit #index"):
        export([Path(f"{one}#index")], "parquet", tmp_path / "out")
    (table,) = export([paths[1]], "parquet", tmp_path / "out")
    assert pq.read_table(table / "contacts.parquet").num_rows == FRAMES
    repaired = tmp_path / "repaired.mcap"
    assert repair(rig, repaired) > 0
    assert check(repaired).messages == check(rig).messages


def test_recordings_with_the_same_name_get_numbers(record, tmp_path: Path) -> None:
    paths = [record(tmp_path / "a" / "press.mcap"), record(tmp_path / "b" / "press.mcap")]
    results = export(paths, "parquet", tmp_path / "out")
    assert [path.name for path in results] == ["press", "press-2"]
