"""Words that the project does not use (docs/word-list.toml), in code, messages, help and documentation."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLACES = (
    "src",
    "docs",
    "benchmarks",
    "examples",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "CODE_OF_CONDUCT.md",
)
SUFFIXES = {".py", ".md", ".js", ".html", ".css"}
LIST = ROOT / "docs" / "word-list.toml"


def whole_words(pattern: str) -> str:
    """A pattern of whole words; parts of identifiers count."""
    return rf"(?<![a-z])(?:{pattern})(?![a-z])"


LISTED = tomllib.loads(LIST.read_text(encoding="utf-8"))["word"]
ENTRIES = [
    (
        re.compile(whole_words(each["pattern"]), re.IGNORECASE),
        [re.compile(skip, re.IGNORECASE) for skip in each.get("except", ())],
        each["instead"],
    )
    for each in LISTED
]
"""Pattern, standard uses to skip, and the replacement."""
ANY = re.compile(whole_words("|".join(each["pattern"] for each in LISTED)))
"""Lines without it in lower case, nearly all of them, need no further search."""


def offences(text: str) -> list[str]:
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        if not ANY.search(line.lower()):
            continue
        for pattern, skips, instead in ENTRIES:
            rest = line
            for skip in skips:
                rest = skip.sub("", rest)
            if match := pattern.search(rest):
                found.append(f"line {number}: {match.group()!r}, use: {instead}: {line.strip()[:80]}")
    return found


def files() -> list[Path]:
    roots = [ROOT / place for place in PLACES if (ROOT / place).exists()]
    found = [path for root in roots for path in ([root] if root.is_file() else sorted(root.rglob("*")))]
    built = {ROOT / "docs" / "_build", ROOT / "docs" / "generated"}
    return [path for path in found if path.suffix in SUFFIXES and not built & set(path.parents)]


@pytest.mark.skipif(not LIST.exists(), reason="the documentation is not there (tests of the wheel)")
def test_files_use_the_terms_of_the_glossary() -> None:
    wrong = {
        str(path.relative_to(ROOT)): found
        for path in files()
        if (found := offences(path.read_text(encoding="utf-8")))
    }
    assert not wrong, "\n".join(f"{name}: {each}" for name, found in wrong.items() for each in found)


def test_offences_are_found_in_prose_and_in_identifiers_and_exceptions_are_not() -> None:
    assert offences("def told_sensor(): ...")
    assert offences("It says nothing.")
    assert not offences("the second moment of the area, played back with a gripper")
