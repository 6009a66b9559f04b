"""Which recordings words name."""

from pathlib import Path

import pytest

from manytouch.batch.inputs import absolute, shard_of, tasks_of
from manytouch.errors import SourceError


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("day1/a2.mp4", "day1/a10.mp4", "day2/a2.mp4", "day2/note.md", "shots/1.png", "shots/2.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    for name in ("out/a2/summary.json", "out/a2/annotated.mp4", ".hidden/b.mp4"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def inputs_of(*words: str) -> list[str]:
    return [task.input for task in tasks_of(words)]


def test_a_folder_is_all_recordings_below_it_but_no_results(folder: Path) -> None:
    expected = ["day1/a2.mp4", "day1/a10.mp4", "day2/a2.mp4", "shots"]
    assert [Path(each).relative_to(folder).as_posix() for each in inputs_of(str(folder))] == expected
    assert inputs_of("day1", "shots") == ["day1/a2.mp4", "day1/a10.mp4", "shots"]


def test_names_are_those_of_process(folder: Path) -> None:
    assert [task.name for task in tasks_of(["day1", "day2"])] == ["a2", "a10", "a2-2"]


def test_patterns_are_expanded_in_natural_order_and_an_input_comes_once(folder: Path) -> None:
    assert inputs_of("day*/a2.mp4") == ["day1/a2.mp4", "day2/a2.mp4"]
    assert inputs_of("**/a*.mp4", "day1/a2.mp4", str(folder / "day1/a10.mp4")) == [
        "day1/a2.mp4",
        "day1/a10.mp4",
        "day2/a2.mp4",
    ]


def test_a_list_names_one_input_per_line_from_its_own_folder(folder: Path) -> None:
    lines = f"# these\n\na2.mp4\n{folder}/day2/a2.mp4\nsim:one\n../shots\n"
    (folder / "day1" / "list.txt").write_text(lines)
    assert inputs_of("day1/list.txt") == ["day1/a2.mp4", f"{folder}/day2/a2.mp4", "sim:one", "day1/../shots"]


def test_a_missing_input_is_a_task_that_will_fail(folder: Path) -> None:
    assert inputs_of("day1/gone.mp4") == ["day1/gone.mp4"]


@pytest.mark.parametrize("word", ["nothing*.mp4", "empty", "empty.txt"])
def test_a_word_that_names_no_recording_is_refused(folder: Path, word: str) -> None:
    (folder / "empty").mkdir()
    (folder / "empty.txt").write_text("# nothing\n")
    with pytest.raises(SourceError, match=word.replace("*", r"\*")):
        tasks_of([word])


def test_shards_contain_every_task_once(folder: Path) -> None:
    tasks = tasks_of(["day1", "day2", "shots"])
    parts = [shard_of(tasks, (number, 3)) for number in range(3)]
    assert sorted(task.input for part in parts for task in part) == sorted(task.input for task in tasks)
    assert shard_of(tasks, (3, 3)) == parts[0]  # counted from 1


def test_absolute_inputs_do_not_depend_on_the_present_folder(folder: Path) -> None:
    assert absolute("day1/a2.mp4") == str(folder / "day1/a2.mp4")
    assert absolute("s3://bucket/a.mp4") == "s3://bucket/a.mp4"
    assert absolute("sim:one") == "sim:one"
