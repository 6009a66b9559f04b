"""Commands and Python of the README and the pages: all are parsed, those in blocks are run on simulated data.

A block that cannot be run here is listed with the reason; a new block is run, or has to be listed. The pages
"From nothing to newtons" and the notebook have tests of their own.
"""

import contextlib
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from cyclopts import MissingArgumentError

import manytouch
from clips import pressed_video
from command_line import run_command
from manytouch.cli import COMMANDS
from manytouch.cli.application import application

ROOT = Path(__file__).parents[2]
if not (ROOT / "docs" / "index.md").exists():
    pytest.skip("the pages come with the repository, not with the wheel", allow_module_level=True)
OWN_TEST = {"from-nothing-to-newtons.md"}
ALL_PAGES = {path.name: path for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]}
PAGES = {name: path for name, path in ALL_PAGES.items() if name not in OWN_TEST}
NOT_MANYTOUCH = r"make |pip install|uvx |pipx |git clone|cd |dask |python3 -m venv|ros/bin/|#"
"""Other programs: they install something, or their effect is tested elsewhere."""

INSTEAD = {
    # there is no camera
    "run 0 --size 2560x1440 --fps 30 --sensor my-sensor.toml --record press.mcap": (
        "run press.mp4 --no-view --sensor my-sensor.toml --record press.mcap"
    ),
    "run 0 --sensor my-sensor.toml --to foxglove://127.0.0.1:8765": (
        "run press.mp4 --no-view --sensor my-sensor.toml --to foxglove://127.0.0.1:8765"
    ),
    "run 0 --sensor my-sensor.toml --to ros2://skin": (
        "run press.mp4 --no-view --sensor my-sensor.toml --to ros2://skin"
    ),
    "run 0 --sensor my-sensor.toml --to tuio://127.0.0.1:3333 --to osc://127.0.0.1:9000": (
        "run press.mp4 --no-view --sensor my-sensor.toml --to tuio://127.0.0.1:3333 --to osc://127.0.0.1:9000"
    ),
    # quicker with a recording that is there
    "run sim: --no-view --record press.mcap": "run press.mp4 --no-view --pitch-mm 4 --record press.mcap",
    # end when the user ends them; tests/system/test_viewer.py runs them
    "view press.mcap": None,
    "demo": None,
    "run 0 --sensor my-sensor.toml --to 'ros2://skin?parent=tool0&pose=40,0,0,0,0,1.57'": (
        "run press.mp4 --no-view --sensor my-sensor.toml --to 'ros2://skin?parent=tool0&pose=40,0,0,0,0,1.57'"
    ),
    # need recordings of one sheet by two cameras; tests/system/test_views.py and unit/calibration make them
    "process views:left.mp4,right.mp4 --sensor skin.toml --out results": None,
    "run views:/dev/v4l/by-id/LEFT,/dev/v4l/by-id/RIGHT --sensor skin.toml --record skin.mcap": None,
    "calibrate rest views:left.mp4,right.mp4 --sensor skin.toml --out skin-at-rest.toml": None,
    # need a cluster or a store; tests/unit/batch runs them
    "batch list.txt --out /scratch/results --workers 1 --shard $SLURM_ARRAY_TASK_ID/100": None,
    "batch list.txt --out /shared/results --scheduler tcp://host:8786": None,
    "batch s3://bucket/day1/ --out s3://bucket/results": None,
}
BEFORE = {  # makes the files that a page takes from another one
    "how-to.md": "process press.mp4 --out results",
    "touch-and-music.md": "run press.mp4 --no-view --pitch-mm 4 --record press.mcap",
}
PUBLISHED = {  # snippets that receive from a running session
    "foxglove.md": "foxglove://127.0.0.1:8765",
    "touch-and-music.md": "tuio://127.0.0.1:3333 osc://127.0.0.1:9000",
}


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and text of each fenced block."""
    found = re.findall(
        r"^( *)```(\w*)\n(.*?)^ *```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    return [
        (language, re.sub(rf"^{indent}", "", text, flags=re.MULTILINE)) for indent, language, text in found
    ]


def commands(page: Path) -> list[str]:
    """Words after `manytouch` of each line in the blocks without a language."""
    lines = [line for language, text in blocks(page) if not language for line in text.splitlines()]
    words = (line.strip().removeprefix(".venv/bin/").partition("  #")[0].strip() for line in lines)
    return [line.removeprefix("manytouch").strip() for line in words if re.match(r"manytouch( |$)", line)]


def inline(page: Path) -> list[str]:
    return re.findall(r"`(?:\.venv/bin/)?manytouch ([^`]+)`", page.read_text(encoding="utf-8"))


def parse(line: str) -> None:
    line = line.replace("$SLURM_ARRAY_TASK_ID", "3").replace("VERB", "process")
    application(tuple(COMMANDS)).parse_args(shlex.split(line), exit_on_error=False, print_error=False)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the pages name, as the present one."""
    pressed_video(tmp_path / "press.mp4")
    job = manytouch.prepare(str(tmp_path / "press.mp4"), pitch_mm=4.0)
    manytouch.save_sensor(job.sensor, tmp_path / "my-sensor.toml")
    picture = cv2.imencode(".png", np.zeros((4, 4), dtype=np.uint8))[1].tobytes()
    images = pyarrow.table({"image": [{"bytes": picture, "path": "a.png"}] * 2})
    pyarrow.parquet.write_table(images, tmp_path / "data.parquet")
    (tmp_path / "day1").mkdir()
    (tmp_path / "day1" / "press.mp4").write_bytes((tmp_path / "press.mp4").read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


@contextlib.contextmanager
def session(urls: str) -> Iterator[None]:
    """A session of the simulated sensor that sends its readings, while the block runs."""
    words = [word for url in urls.split() for word in ("--to", url)]
    program = [sys.executable, "-m", "manytouch", "run", "sim:", "--no-view", *words]
    process = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert process.stdout is not None
        for line in process.stdout:
            if "contact" in line:
                break
        yield
    finally:
        process.terminate()
        process.communicate(timeout=60)


@pytest.mark.parametrize("page", ALL_PAGES.values(), ids=lambda page: page.name)
def test_every_command_that_a_page_names_is_one_that_the_parser_knows(page: Path) -> None:
    for line in commands(page):
        if line:
            parse(line)
    for line in inline(page):
        with contextlib.suppress(MissingArgumentError):  # a sentence may name a command without its arguments
            parse(line)


def test_a_command_that_the_parser_does_not_know_is_found() -> None:
    with pytest.raises(Exception, match="--no-such"):
        parse("process press.mp4 --out results --no-such")


@pytest.mark.parametrize("page", PAGES.values(), ids=lambda page: page.name)
def test_every_line_of_a_block_without_a_language_is_a_command_or_a_drawing(page: Path) -> None:
    for language, text in blocks(page):
        if language or not re.search(r"^(\.venv/bin/)?manytouch( |$)", text, re.MULTILINE):
            continue
        for line in text.splitlines():
            assert re.match(rf"(\.venv/bin/)?manytouch|{NOT_MANYTOUCH}|$", line.strip()), line


RUN = [
    pytest.param(page, id=page.name)
    for page in PAGES.values()
    if any(INSTEAD.get(line, line) for line in commands(page))
    or any(kind == "python" for kind, _ in blocks(page))
]


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_commands_and_python_of_a_page_run(page: Path, folder: Path) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    for line in [BEFORE.get(page.name, ""), *commands(page)]:
        words = INSTEAD.get(line, line)
        if words is not None and words.startswith("design"):
            pytest.importorskip("build123d")
        if words:
            done = run_command(*shlex.split(words), folder=folder)
            assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    snippets = [text for language, text in blocks(page) if language == "python"]
    with session(PUBLISHED[page.name]) if page.name in PUBLISHED else contextlib.nullcontext():
        for text in snippets:
            exec(compile(text, page.name, "exec"), {"__name__": "__main__"})
    pyplot.close("all")
