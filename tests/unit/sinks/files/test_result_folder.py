"""A result folder is all or nothing, whatever interrupts it and whoever else writes."""

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from manytouch.errors import OutputError
from manytouch.sinks.files.result_folder import ResultFolder

RESULTS = ("*.csv", "store")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write(folder: Path, text: str, *, is_committed: bool = True) -> None:
    with ResultFolder(folder, RESULTS) as results:
        (results.partial_path / "table.csv").write_text(text)
        (results.partial_path / "store").mkdir()
        (results.partial_path / "store" / text).write_text(text)
        if is_committed:
            results.commit()


def test_a_folder_appears_when_it_is_committed_and_replaces_the_one_before(tmp_path: Path) -> None:
    final = tmp_path / "deep" / "press"
    write(final, "new")
    assert names(final) == ["store", "table.csv"]
    with ResultFolder(final, RESULTS) as results:
        (results.partial_path / "table.csv").write_text("newer")
        assert (final / "table.csv").read_text() == "new"
        results.commit()
    assert names(final) == ["table.csv"], "all files belong to one run"
    assert (final / "table.csv").read_text() == "newer"
    assert names(final.parent) == ["press"]


def test_without_commit_nothing_has_changed(tmp_path: Path) -> None:
    write(tmp_path / "deep" / "press", "new", is_committed=False)
    assert names(tmp_path) == []
    write(tmp_path / "press", "old")
    with pytest.raises(ZeroDivisionError), ResultFolder(tmp_path / "press", RESULTS):
        raise ZeroDivisionError
    assert names(tmp_path) == ["press"]
    assert (tmp_path / "press" / "table.csv").read_text() == "old"


def test_all_files_are_on_the_disk_before_the_folder_gets_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    final, flushed = tmp_path / "press", []

    def flush(path: Path) -> None:
        flushed.append((path.name, final.exists()))

    monkeypatch.setattr("manytouch.sinks.files.result_folder.flush", flush)
    write(final, "new")
    *before, last = flushed
    assert {name for name, _ in before} >= {"table.csv", "store", "new"}
    assert not any(is_named for _, is_named in before)
    assert last == (tmp_path.name, True), "the entry of the folder itself, after it was renamed"


def test_other_entries_of_the_folder_are_kept(tmp_path: Path) -> None:
    final = tmp_path / "press"
    write(final, "old")
    (final / "notes.txt").write_text("mine")
    (final / "album").mkdir()
    (final / "album" / "1.png").write_text("picture")
    write(final, "new")
    assert names(final) == ["album", "notes.txt", "store", "table.csv"]
    assert names(final / "store") == ["new"]
    assert (final / "album" / "1.png").read_text() == "picture"


def interrupted(monkeypatch: pytest.MonkeyPatch, folder: Path, after: int) -> None:
    """A swap that ends after a number of changes of the file system, as if the process were killed there."""
    done = 0

    class Killed(BaseException):
        pass

    def counted(function):
        def change(*arguments, **named):
            nonlocal done
            if done == after:
                raise Killed
            done += 1
            return function(*arguments, **named)

        return change

    results = ResultFolder(folder, RESULTS)
    (results.partial_path / "table.csv").write_text("new")
    (results.partial_path / "second.csv").write_text("new")
    with monkeypatch.context() as patch:
        for name in ("rename", "rmdir", "unlink"):
            patch.setattr(Path, name, counted(getattr(Path, name)))
        patch.setattr("shutil.rmtree", counted(__import__("shutil").rmtree))
        with contextlib.suppress(Killed):
            results.commit()
    results.lock.release()  # as the operating system does for a dead process


@pytest.mark.parametrize("after", range(8))
def test_an_interrupted_swap_is_completed_by_the_next_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    final = tmp_path / "press"
    write(final, "old")
    (final / "notes.txt").write_text("mine")
    interrupted(monkeypatch, final, after)
    with ResultFolder(final, RESULTS):
        found = names(final)
        if (final / "table.csv").read_text() == "old":
            assert found == ["notes.txt", "store", "table.csv"]
            assert after == 0
        else:
            assert found == ["notes.txt", "second.csv", "table.csv"]
        assert (final / "notes.txt").read_text() == "mine"
    assert names(tmp_path) == ["press"]


HOLDER = """
import sys
from pathlib import Path
from manytouch.sinks.files.result_folder import ResultFolder
folder = ResultFolder(Path(sys.argv[1]), ("*.csv",))
(folder.partial_path / "table.csv").write_text("other")
print("holds", flush=True)
sys.stdin.read()
"""


def test_a_second_process_is_refused_with_who_writes_and_a_dead_one_holds_nothing(tmp_path: Path) -> None:
    final = tmp_path / "press"
    write(final, "old")
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(final)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "holds\n"
    lock = json.loads((tmp_path / ".press.lock").read_text())
    assert lock["pid"] == holder.pid
    with pytest.raises(OutputError, match=rf"is being written by process {holder.pid} on .* since \d{{4}}-"):
        ResultFolder(final, RESULTS)
    assert (final / "table.csv").read_text() == "old"
    holder.kill()
    holder.communicate()
    assert len(names(tmp_path)) == 3, "folder, lock and partial folder of the killed process"
    write(final, "new")
    assert (final / "table.csv").read_text() == "new"
    assert names(tmp_path) == ["press"]


def test_folders_in_use_are_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "work" / "deep").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "work" / "deep")
    for given in (Path(), tmp_path / "work", Path("/"), Path("~").expanduser()):
        with pytest.raises(OutputError, match="choose a folder in it"):
            ResultFolder(given, RESULTS)
    (tmp_path / "file").write_text("text")
    with pytest.raises(OutputError, match="a file has this name"):
        ResultFolder(tmp_path / "file", RESULTS)


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    write(tmp_path / "there", "old")
    (tmp_path / "link").symlink_to(tmp_path / "there")
    write(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "there" / "table.csv").read_text() == "new"


def test_long_names_have_room_for_the_hidden_ones(tmp_path: Path) -> None:
    write(tmp_path / ("n" * 255), "new")
    assert names(tmp_path) == ["n" * 255]


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="rights as POSIX has them, not of root")
def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="cannot write"):
        ResultFolder(tmp_path / "press", RESULTS)
    tmp_path.chmod(0o700)
