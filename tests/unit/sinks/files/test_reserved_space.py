"""A session whose quota is used up, or whose disk has an error, keeps its results."""

import errno
import json
import os
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from drawn_source import DrawnSource
from manytouch.errors import OutputError
from manytouch.session import Live, ResultFiles, prepare, run
from manytouch.sinks.files.reserved_space import (
    RESERVE_NAME,
    create_text,
    is_released,
    release,
    reserve,
    reserved_bytes,
)
from manytouch.sinks.files.result_folder import END_BYTES

write = os.write


def refuse_beyond(quota_bytes: int, error: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let writes fail where all files of a folder and of those in it have more bytes than a quota."""

    def limited(handle: int, data: bytes) -> int:
        used = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        if used + len(data) > quota_bytes:
            raise OSError(error, os.strerror(error))
        return write(handle, data)

    monkeypatch.setattr(os, "write", limited)


@pytest.mark.parametrize("error", [errno.EDQUOT, errno.EIO, errno.ENOSPC])
def test_a_session_without_room_for_more_keeps_what_was_read(
    error: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "press"
    live = Live(prepare(DrawnSource(frames=3000, fps=2000.0), method="perimeter"))
    refuse_beyond(END_BYTES + 100_000, error, tmp_path, monkeypatch)
    with (
        pytest.raises(OutputError, match=r"a write to .*press failed, as its disk or a quota is full"),
        ResultFiles(folder, live.job, is_repeatable=False) as files,
    ):
        run(live, files.sinks)
    assert not (folder / RESERVE_NAME).exists()
    assert json.loads((folder / "summary.json").read_text())["complete"] is False
    frames = [line.split(",")[0] for line in (folder / "frames.csv").read_text().splitlines()[1:]]
    assert 30 < len(frames) < 3000
    assert frames == [str(index) for index in range(len(frames))], "no line is lost"
    markers = pq.read_table(folder / "markers.parquet")["frame"].to_pylist()
    assert sorted(set(markers)) == list(range(len(frames)))


def test_a_session_leaves_no_reserve(tmp_path: Path) -> None:
    live = Live(prepare(DrawnSource(frames=20, fps=2000.0), method="perimeter"))
    with ResultFiles(tmp_path / "press", live.job, is_repeatable=False) as files:
        assert (files.folder.partial_path / RESERVE_NAME).stat().st_size == END_BYTES
        files.is_complete = run(live, files.sinks)
    assert not (tmp_path / "press" / RESERVE_NAME).exists()


def test_a_session_does_not_begin_without_room_for_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = Live(prepare(DrawnSource(frames=20, fps=2000.0), method="perimeter"))
    with monkeypatch.context() as patched:
        patched.setattr("manytouch.sinks.files.result_folder.reserve", _refused)
        with pytest.raises(OutputError, match=r"cannot write .*press: the disk is full"):
            ResultFiles(tmp_path / "press", live.job, is_repeatable=False)
    assert not any(tmp_path.iterdir())


def _refused(folder: Path, size: int) -> None:
    raise OSError(errno.EDQUOT, "Disk quota exceeded")


def test_a_write_is_repeated_once_the_reserve_is_released(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reserve(tmp_path, 3_000_000)
    reserve(tmp_path, 1000)
    assert reserved_bytes(tmp_path) == 3_000_000
    refuse_beyond(3_000_001, errno.EDQUOT, tmp_path, monkeypatch)
    with create_text(tmp_path / "table.csv") as file:
        file.write("1,2\n")
    assert (tmp_path / "table.csv").read_text() == "1,2\n"
    assert is_released(tmp_path)
    assert not release(tmp_path)
    file = create_text(tmp_path / "other.csv")
    refuse_beyond(0, errno.EDQUOT, tmp_path, monkeypatch)
    file.write("1,2\n")
    with pytest.raises(OSError, match="quota"):
        file.flush()
    monkeypatch.undo()
    file.close()
