"""What a batch computes, what it leaves alone, and its tables."""

import json
import os
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from clips import picture, pressed_video, write_video
from manytouch.batch import run_batch
from manytouch.batch.run_batch import merge
from manytouch.batch.tasks import TaskState
from manytouch.errors import OutputError
from manytouch.session import process
from manytouch.sinks.files.folder_lock import FolderLock
from results import rows_of
from same_results import differences

Batch = Callable[..., tuple]


@pytest.mark.slow
def test_results_are_those_of_process(recordings: Path, tmp_path: Path, batch: Batch) -> None:
    pressed_video(recordings / "press1.mp4", 45)
    report, _ = batch(recordings)
    assert report.computed == report.complete == 3
    for path in sorted(recordings.iterdir()):
        expected = process(path, out=tmp_path / "expected")
        assert differences(tmp_path / "out" / path.stem, expected) == []


def test_only_what_is_missing_or_changed_is_computed_with_the_reason(
    recordings: Path, tmp_path: Path, batch: Batch
) -> None:
    out = tmp_path / "out"
    assert set(batch(recordings)[1].reasons().values()) == {"no result yet"}
    report, notes = batch(recordings)
    assert (report.computed, report.current, notes.reasons()) == (0, 3, {})

    os.utime(recordings / "press0.mp4", (1, 1))  # the same bytes
    (out / "press1" / "frames.csv").unlink()
    write_video(recordings / "press2.mp4", (picture(seed=each) for each in range(25)))
    assert batch(recordings)[1].reasons() == {
        "press1": "frames.csv is missing",
        "press2": "the input has changed",
    }
    assert set(batch(recordings, fps=50.0)[1].reasons().values()) == {"a parameter has changed"}
    found = json.loads((out / "press0" / "summary.json").read_text())
    (out / "press0" / "summary.json").write_text(json.dumps({**found, "complete": False}))
    (out / "press1" / "summary.json").write_text("{")
    assert batch(recordings, fps=50.0)[1].reasons() == {
        "press0": "the result is incomplete",
        "press1": "no result yet",
    }


def test_an_input_with_the_size_and_time_of_before_is_found_out_by_its_bytes_on_request(
    recordings: Path, batch: Batch
) -> None:
    path = recordings / "press0.mp4"
    batch(path)
    found, content = path.stat(), bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(found.st_atime_ns, found.st_mtime_ns))
    assert batch(path)[0].computed == 0
    assert batch(path, is_verifying=True)[1].reasons() == {"press0": "the input has changed"}


def test_failures_are_listed_and_do_not_stop_the_others(
    recordings: Path, tmp_path: Path, batch: Batch
) -> None:
    (recordings / "press1.mp4").write_bytes(b"nothing" * 100)
    report, _ = batch(recordings, recordings / "gone.mp4", "rtsp://127.0.0.1/camera")
    assert report.computed == 2
    assert set(report.failed) == {"press1", "gone", "stream-127.0.0.1-camera"}
    rows = rows_of(tmp_path / "out" / "failures.csv")
    assert [Path(row["input"]).name for row in rows] == ["gone.mp4", "press1.mp4", "camera"]
    assert "There is no" in rows[0]["sentence"]
    assert "Traceback" in (tmp_path / "out" / rows[0]["traceback"]).read_text()
    lines = pq.read_table(tmp_path / "out" / "results.parquet").to_pylist()
    assert [line["state"] for line in lines] == ["absent", "complete", "absent", "complete", "absent"]
    shutil.copy(recordings / "press0.mp4", recordings / "press1.mp4")
    assert not batch(recordings)[0].failed
    assert rows_of(tmp_path / "out" / "failures.csv") == []


def test_tables_have_a_line_per_input_and_per_contact(recordings: Path, tmp_path: Path, batch: Batch) -> None:
    pressed_video(recordings / "press1.mp4", 45)
    batch(recordings)
    batch(recordings / "press2.mp4", pitch_mm=4.0, method="perimeter")
    out = tmp_path / "out"
    lines = {line["name"]: line for line in pq.read_table(out / "results.parquet").to_pylist()}
    assert [lines[f"press{number}"]["frames"] for number in range(3)] == [18, 45, 20]
    assert [lines[f"press{number}"]["unit"] for number in range(3)] == ["pitch", "pitch", "mm"]
    assert lines["press0"]["input"] == str(recordings / "press0.mp4")
    rows = rows_of(out / "press1" / "contacts.csv")
    contacts = pq.read_table(out / "contacts.parquet").to_pylist()
    assert len(contacts) == len(rows) > 0
    for row, contact in zip(rows, contacts, strict=True):
        assert contact["name"] == "press1"
        assert contact["x_mm"] is None
        for name, text in row.items():
            value = contact[name]
            assert (value is None) == (text == ""), name
            if value is not None:
                assert value == (text if isinstance(value, str) else float(text)), name


def test_shards_have_tables_of_their_own_until_they_are_merged(
    recordings: Path, tmp_path: Path, batch: Batch
) -> None:
    (recordings / "press1.mp4").write_bytes(b"nothing")
    whole, out = tmp_path / "whole", tmp_path / "out"
    batch(recordings, out=whole)
    for number in range(2):
        batch(recordings, shard=(number, 2))
    assert {path.name for path in out.glob("*.parquet")} == {
        f"{stem}-{number}-of-2.parquet" for stem in ("results", "contacts") for number in range(2)
    }
    assert merge(str(out)) == 2
    assert not list(out.glob("*-of-*"))
    for table in ("results.parquet", "contacts.parquet"):
        found, expected = (pq.read_table(each / table).to_pylist() for each in (out, whole))
        for line in (*found, *expected):
            line.pop("milliseconds_p50", None)
            line.pop("milliseconds_p99", None)
        assert sorted(found, key=lambda line: line["name"]) == expected
    assert rows_of(out / "failures.csv") == rows_of(whole / "failures.csv")
    with pytest.raises(OutputError, match="run the shards first"):
        merge(str(out))


def test_a_recording_in_work_elsewhere_is_waited_for(
    recordings: Path, tmp_path: Path, batch: Batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, out = recordings / "press0.mp4", tmp_path / "out"
    process(path, out=out)
    shutil.move(out / "press0", tmp_path / "done")
    lock = FolderLock(out / ".press0.lock", out / "press0")
    other = threading.Timer(0.5, lambda: (shutil.move(tmp_path / "done", out / "press0"), lock.release()))
    wait_until_free = run_batch.wait_until_free

    def begin_other(busy: list, *rest: object) -> object:
        if busy:
            other.start()
        return wait_until_free(busy, *rest)

    monkeypatch.setattr(run_batch, "wait_until_free", begin_other)
    monkeypatch.setattr(run_batch, "BUSY_POLL_S", 0.1)
    report, notes = batch(path)
    other.join()
    assert (report.computed, report.current, report.complete) == (0, 1, 1)
    assert any("another batch" in message for message in notes.messages)


def test_an_input_that_changes_while_it_is_processed_has_no_result(
    recordings: Path, tmp_path: Path, batch: Batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    from manytouch.batch import one_recording

    run, path = one_recording.run, recordings / "press0.mp4"

    def run_and_remove(*words, **options) -> bool:
        done = run(*words, **options)
        path.unlink()
        return done

    monkeypatch.setattr(one_recording, "run", run_and_remove)
    report, notes = batch(path)
    assert notes.outcomes[0].state is TaskState.FAILED
    assert "vanished" in report.failed["press0"].reason
    assert not (tmp_path / "out" / "press0").exists()

    monkeypatch.undo()
    assert set(batch(recordings, path)[0].failed) == {"press0"}
    shutil.copy(recordings / "press1.mp4", path)
    report, _ = batch(recordings)
    assert (report.computed, report.current, report.complete) == (1, 2, 3)
    assert differences(tmp_path / "out" / "press0", process(path, out=tmp_path / "expected")) == []


def test_a_full_disk_leaves_earlier_results_and_no_parts(
    recordings: Path, tmp_path: Path, batch: Batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    import errno

    from manytouch.sinks.files import tables

    batch(recordings / "press0.mp4")
    before = (tmp_path / "out" / "press0" / "summary.json").read_text()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(tables.FrameTable, "write", full)
        report, _ = batch(recordings, fps=50.0)
    assert set(report.failed) == {"press0", "press1", "press2"}
    assert "the disk is full" in report.failed["press0"].reason
    out = tmp_path / "out"
    assert (out / "press0" / "summary.json").read_text() == before
    assert not list(out.glob(".*.partial"))
    assert batch(recordings)[0].complete == 3
    for path in sorted(recordings.iterdir()):
        assert differences(out / path.stem, process(path, out=tmp_path / "expected")) == []
