"""`manytouch batch` from the command line."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from batch_work import Serial
from clips import picture, write_video
from command_line import run_command
from manytouch.batch.engines import local_processes


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        write_video(tmp_path / f"{name}.mp4", (picture(seed=each) for each in range(18)))
    (tmp_path / "c.mp4").write_bytes(b"no video" * 50)
    return tmp_path


def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recordings are processed one after the other, without a process for them."""
    monkeypatch.setattr(local_processes, "LocalProcesses", lambda **_: Serial())


def test_a_batch_prints_what_it_does_and_why(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = run_command("batch", "*.mp4", "--out", "out", "--workers", "1", folder=folder)
    assert done.returncode == 1
    assert "a: 18 frames in " in done.stdout
    assert "no result yet" not in done.stdout
    assert "c: failed: " in done.stdout
    assert "2 recordings processed, 0 unchanged, 1 failed (failures.csv)" in done.stdout
    line = done.stderr.splitlines()[-1]  # before it, that functions are compiled
    assert line.startswith("manytouch: 1 of 3 recordings failed, c: 'c.mp4' cannot be decoded")
    assert "out/failures.csv" in line
    (folder / "c.mp4").unlink()
    in_this_process(monkeypatch)
    words = ("batch", "a.mp4", "b.mp4", "--out", "out", "--workers", "1")
    again = run_command(*words, folder=folder)
    assert (again.returncode, again.stderr) == (0, "")
    assert "0 recordings processed, 2 unchanged" in again.stdout
    (folder / "out" / "a" / "frames.csv").unlink()
    third = run_command(*words, folder=folder)
    assert "(again: frames.csv is missing)" in third.stdout
    plan = run_command("batch", "*.mp4", "--out", "out", "--fps", "50", "--dry-run", folder=folder)
    assert "2 of 2 recordings would be processed" in plan.stdout


def test_a_shard_that_fails_names_the_first_reason_and_its_own_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_this_process(monkeypatch)
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.mp4").write_bytes(b"no video" * 50)
    done = run_command("batch", ".", "--out", "out/", "--workers", "1", "--shard", "0/2", folder=tmp_path)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "2 of 2 recordings failed, the first is a: " in line
    assert "out/failures-0-of-2.csv" in line
    assert (tmp_path / "out" / "failures-0-of-2.csv").exists()


@pytest.mark.slow
def test_shards_are_merged(folder: Path) -> None:
    (folder / "c.mp4").unlink()
    for shard in ("1/2", "2/2"):
        run = run_command("batch", ".", "--out", "out", "--workers", "1", "--shard", shard, folder=folder)
        assert run.returncode == 0, run.stderr
    merged = run_command("batch", "--merge", "--out", "out", folder=folder)
    assert (merged.returncode, merged.stdout) == (0, "tables of 2 shards joined in out\n")
    assert pq.read_table(folder / "out" / "results.parquet")["name"].to_pylist() == ["a", "b"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--out", "out"], "give inputs, or --merge"),
        (["a.mp4", "--out", "out", "--shard", "3/2"], "expected I/N"),
        (["a.mp4", "--out", "out", "--scheduler", "tcp://h:1", "--slurm", "s.toml"], "exclude each other"),
        (["a.mp4", "--out", "out", "--shard", "0/2", "--slurm", "s.toml"], "exclude each other"),
        (["a.mp4", "--out", "out", "--wait-h", "2"], "needs --scheduler or --slurm"),
    ],
)
def test_a_wrong_command_line_is_refused(folder: Path, words: list[str], reason: str) -> None:
    done = run_command("batch", *words, folder=folder)
    assert done.returncode == 2
    assert reason in done.stderr
