"""`manytouch batch` as a program, recordings for it, and what its folder must contain in the end."""

import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq

from clips import picture, press_of, write_video
from manytouch.session import process
from same_results import differences


def start(folder: Path, out: Path, engine: tuple[str, str] = ("--workers", "2")) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "manytouch", "batch", str(folder), "--out", str(out), *engine],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def recordings_in(folder: Path, count: int) -> list[Path]:
    """Recordings with different contents, some of which are equal copies."""
    folder.mkdir()
    paths = []
    for number in range(count):
        path = folder / f"r{number:03d}.mp4"
        if number < 5:
            write_video(path, (picture(press_of(each + 5), seed=each) for each in range(20 + 5 * number)))
        else:
            shutil.copy(paths[number % 5], path)
        paths.append(path)
    return paths


def check_all(paths: list[Path], out: Path, expected: Path) -> None:
    """Every result is there once, in the folder and in the tables, as `process` makes it."""
    names = [path.stem for path in paths]
    folders = [path.name for path in out.iterdir() if path.is_dir() and not path.name.startswith(".")]
    assert sorted(folders) == names
    assert [line for line in out.iterdir() if line.name.endswith((".partial", ".old"))] == []
    table = pq.read_table(out / "results.parquet").to_pydict()
    assert table["name"] == names
    assert set(table["state"]) == {"complete"}
    for path in paths:
        assert differences(out / path.stem, process(path, out=expected)) == []
