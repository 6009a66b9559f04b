"""`manytouch batch` on a full disk, with inputs that vanish, and two of them on one folder."""

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from batch_programs import check_all, recordings_in, start
from results import rows_of
from small_disk import fill, small_disk_at


def complete_in(out: Path) -> set[str]:
    """Names of the folders of results, all of which must be complete."""
    folders = [path for path in out.iterdir() if path.is_dir() and not path.name.startswith(".")]
    for path in folders:
        assert json.loads((path / "summary.json").read_text())["complete"]
    return {path.name for path in folders}


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, 100])
def test_a_full_disk_costs_time_and_no_result(tmp_path: Path, count: int) -> None:
    """The disk has room for some results; in the second run for all."""
    paths = recordings_in(tmp_path / "in", count)
    with small_disk_at(tmp_path / "disk", megabytes=100) as disk:
        out = disk / "out"
        assert start(paths[0], out).wait() == 0
        used = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
        filling = fill(disk, left_bytes=int(0.4 * count * used))
        words = [sys.executable, "-m", "manytouch", "batch", str(tmp_path / "in"), "--out", str(out)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 1
        failed = re.findall(r"^(r\d+): failed: .*the disk is full", done.stdout, re.MULTILINE)
        found = complete_in(out)
        assert 0 < len(found) < count
        assert sorted([*found, *failed]) == [path.stem for path in paths]
        filling.unlink()
        assert start(tmp_path / "in", out).wait() == 0
        check_all(paths, out, tmp_path / "expected")


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, 100])
def test_inputs_that_vanish_cost_time_and_no_result(tmp_path: Path, count: int) -> None:
    """Inputs disappear one after the other while the batch runs, and are there again in the next run."""
    paths, out = recordings_in(tmp_path / "in", count), tmp_path / "out"
    random, gone = np.random.default_rng(count), tmp_path / "gone"
    gone.mkdir()
    program = start(tmp_path / "in", out)
    while not list(out.glob("*/summary.json")):
        assert program.poll() is None
        time.sleep(0.02)
    for path in random.permutation(paths)[: count // 2]:
        shutil.move(path, gone / path.name)
        time.sleep(random.uniform(0.0, 5.0 / count))
    assert program.wait() == 1
    failures = rows_of(out / "failures.csv")
    assert {Path(row["input"]).name for row in failures} <= {path.name for path in gone.iterdir()}
    assert failures
    for row in failures:
        words = ("There is no", "there is no", "changed or vanished", "cannot be")
        assert any(each in row["sentence"] for each in words), row["sentence"]
    assert complete_in(out) == {path.stem for path in paths} - {Path(row["input"]).stem for row in failures}
    for path in gone.iterdir():
        shutil.move(path, tmp_path / "in" / path.name)
    assert start(tmp_path / "in", out).wait() == 0
    check_all(paths, out, tmp_path / "expected")


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 100])
def test_two_batches_on_one_folder_make_every_result_once(tmp_path: Path, count: int) -> None:
    paths, out = recordings_in(tmp_path / "in", count), tmp_path / "out"
    programs = [start(tmp_path / "in", out, ("--workers", "1")) for _ in range(2)]
    assert [program.wait() for program in programs] == [0, 0]
    check_all(paths, out, tmp_path / "expected")
