"""The rules of the house that no linter holds."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import manytouch

PACKAGE = Path(manytouch.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))


def loaded_by(statement: str) -> set[str]:
    """Top-level packages in memory after a statement, in a fresh interpreter."""
    code = f"{statement}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_package_loads_nothing_heavy() -> None:
    assert not {"numpy", "cv2", "numba", "scipy", "pydantic", "pyarrow", "rich"} & loaded_by(
        "import manytouch"
    )


def test_the_command_line_starts_without_the_mathematics() -> None:
    assert not {"cv2", "numba", "scipy", "pyarrow"} & loaded_by("import manytouch.cli")


def test_every_public_name_can_be_had() -> None:
    for name in manytouch.__all__:
        assert getattr(manytouch, name) is not None


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = manytouch.nonsense


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_modules_are_small_and_say_what_they_are_for(module: Path) -> None:
    text = module.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 400
    assert ast.get_docstring(ast.parse(text)), "a module's docstring says what it is for"
    assert "from __future__ import annotations" not in text  # it blinds the run-time shape checks


def test_nobody_compiles_for_several_threads() -> None:
    for module in MODULES:
        assert "parallel=True" not in module.read_text(encoding="utf-8"), module
