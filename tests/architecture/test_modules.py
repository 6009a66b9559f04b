"""Rules for modules that no linter checks."""

import os
import subprocess
import sys
from pathlib import Path

import manytouch

PACKAGE = Path(manytouch.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 400
MAX_FLAT_MODULES = 12


def test_a_module_is_small_and_checks_its_shapes() -> None:
    for module in MODULES:
        text = module.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= MAX_LINES, module
        assert "from __future__ import annotations" not in text, f"{module}: it disables the checks of shapes"


def test_a_package_has_few_modules() -> None:
    for package in {module.parent for module in MODULES}:
        flat = [module.name for module in package.glob("*.py") if module.name != "__init__.py"]
        assert len(flat) <= MAX_FLAT_MODULES, package


def test_no_kernel_is_compiled_for_several_threads() -> None:
    for module in MODULES:
        assert "parallel=True" not in module.read_text(encoding="utf-8"), module


def test_a_recording_without_a_sensor_file_is_processed_without_what_checks_files() -> None:
    """Its import takes 0.1 s and 10 MB, each time."""
    code = "import sys, manytouch.session; print(*({'pydantic', 'tomlkit'} & sys.modules.keys()))"
    surroundings = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=surroundings, capture_output=True, text=True, check=True
    )
    assert not done.stdout.strip()
