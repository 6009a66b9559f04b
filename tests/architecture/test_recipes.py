"""Names of code and files in docs/architecture.md are those that exist."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "architecture.md"
if not PAGE.exists():
    pytest.skip("the documentation is not there (tests of the wheel)", allow_module_level=True)
PLACES = ("src", "tests", "benchmarks", "docs")
CODE = {".py", ".pyi", ".js", ".toml"}
WRITTEN = {"frames.csv", "summary.json"}  # by manytouch
PATH = re.compile(r"[\w.]+(/[\w.]*)+|[\w.]+\.(py|js|toml|lock|csv|json)")
PLACED = re.compile(r"`([\w.]+)`\s+(?:in\s+|\()`([\w/]+\.(?:py|js))`")


@cache
def paths() -> dict[str, Path]:
    found = [*ROOT.iterdir(), *(path for place in PLACES for path in (ROOT / place).rglob("*"))]
    return {f"/{path.relative_to(ROOT).as_posix()}": path for path in found}


def paths_of(end: str) -> list[Path]:
    return [path for name, path in paths().items() if name.endswith("/" + end.rstrip("/"))]


@cache
def words_of(path: Path) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", path.read_text(encoding="utf-8")))


@cache
def all_words() -> frozenset[str]:
    known = [path for path in paths().values() if path.suffix in CODE and path != Path(__file__)]
    return frozenset().union(*map(words_of, known))


def unknown(text: str) -> list[str]:
    """Paths and names between backticks that do not exist; `NAME` is any name."""
    wrong = []
    for code in re.findall(r"`([^`\n]+)`", text):
        if PATH.fullmatch(code):
            exists = code in WRITTEN or bool(paths_of(code))
        else:
            words = {word for word in re.findall(r"\w+", code) if "NAME" not in word}
            exists = words <= all_words()
        if not exists:
            wrong.append(code)
    for name, end in PLACED.findall(text):  # `NAME` in `FILE`, `NAME` (`FILE`)
        if not any(name.rpartition(".")[2] in words_of(path) for path in paths_of(end)):
            wrong.append(f"{name} in {end}")
    return wrong


def test_names_in_the_architecture_exist() -> None:
    assert not unknown(PAGE.read_text(encoding="utf-8"))


def test_unknown_names_and_names_of_another_file_are_found() -> None:
    text = "`nearest_pair` in `pad/patches.py`, `nearest_pair` (`pad/estimator.py`), `estimate.pad.NAME`"
    assert not unknown(text)
    absent = "nearest" + "_triple"
    assert unknown(f"`{absent}`, `pad/{absent}.py`") == [absent, f"pad/{absent}.py"]
    assert unknown("`nearest_pair` in `session/run.py`") == ["nearest_pair in session/run.py"]
