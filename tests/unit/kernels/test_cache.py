"""Compiled functions are kept where that is possible, and one process compiles at a time."""

import multiprocessing
import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from manytouch.kernels import cache
from manytouch.kernels.cache import compiling, provide_folder


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's cache folder."""
    monkeypatch.setattr(cache, "user_cache_path", lambda *_, **__: tmp_path / "user")
    return tmp_path / "user"


def test_the_folder_is_the_requested_one_if_it_can_be_written(own: Path, tmp_path: Path) -> None:
    assert provide_folder(str(tmp_path / "new")) == str(tmp_path / "new")
    assert not own.exists()


def test_another_folder_is_used_if_it_cannot(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file"
    file.write_text("where no folder can be made, even by root")
    assert provide_folder(str(file / "cache")) == str(own / "kernels")
    monkeypatch.setattr(cache, "SOURCE", file)
    assert provide_folder("") == str(own / "kernels")
    monkeypatch.setattr(cache, "user_cache_path", lambda _: file)
    temporary = Path(provide_folder(""))
    assert temporary.is_dir()
    assert stat.S_IMODE(temporary.stat().st_mode) == 0o700


def test_the_program_runs_without_a_folder_for_its_cache(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    surroundings = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path / "file" / "cache"),
        "XDG_CACHE_HOME": str(tmp_path / "caches"),
    }
    code = (
        "from manytouch.geometry import neighbours\n"
        "from manytouch.session.methods import kernels\n"
        "import numba; print(numba.config.CACHE_DIR)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=surroundings, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str(tmp_path / "caches" / "manytouch" / "kernels")


def hold(log: "multiprocessing.Queue[tuple[str, float]]") -> None:
    with compiling():
        log.put(("begin", time.monotonic()))
        time.sleep(0.2)
        log.put(("end", time.monotonic()))


def test_one_process_compiles_at_a_time() -> None:
    context = multiprocessing.get_context("spawn")
    log = context.Queue()
    processes = [context.Process(target=hold, args=(log,)) for _ in range(3)]
    for process in processes:
        process.start()
    events = [log.get(timeout=60) for _ in range(6)]
    for process in processes:
        process.join()
    assert [name for name, _ in sorted(events, key=lambda event: event[1])] == ["begin", "end"] * 3


def test_an_error_while_compiling_is_raised() -> None:
    with pytest.raises(OSError, match="disk"), compiling():
        raise OSError("the disk is full")
