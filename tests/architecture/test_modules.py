"""Rules for modules that no linter checks."""

import ast
from pathlib import Path

import pytest

import manytouch

PACKAGE = Path(manytouch.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 400
MAX_FLAT_MODULES = 12


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_is_small_and_has_a_docstring(module: Path) -> None:
    text = module.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MAX_LINES
    assert ast.get_docstring(ast.parse(text))
    assert "from __future__ import annotations" not in text  # it disables the run-time checks of shapes


def test_a_package_has_few_modules() -> None:
    for package in {module.parent for module in MODULES}:
        flat = [module.name for module in package.glob("*.py") if module.name != "__init__.py"]
        assert len(flat) <= MAX_FLAT_MODULES, package


def test_no_kernel_is_compiled_for_several_threads() -> None:
    for module in MODULES:
        assert "parallel=True" not in module.read_text(encoding="utf-8"), module
