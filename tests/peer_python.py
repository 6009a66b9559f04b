"""Pythons with packages of other projects, each in a venv of its own."""

import os
import subprocess
import venv
from collections.abc import Sequence
from pathlib import Path

import pytest


def python_with(packages: Sequence[str], variable: str, folder: Path) -> str:
    """A Python with packages: that named by an environment variable, else that of a venv made in a folder.

    The test is skipped where the packages cannot be installed.
    """
    given = os.environ.get(variable)
    if given:
        return given
    venv.create(folder, with_pip=True)
    python = str(folder / "bin" / "python")
    done = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", *packages], capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip(f"{packages[0]} cannot be installed: {done.stderr.strip()[-200:]}")
    return python
