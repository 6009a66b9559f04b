"""Packages of npm, in a folder of their own."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest


def node_packages(packages: Sequence[str], folder: Path) -> Path:
    """A folder with packages of npm.

    The test is skipped where npm is not installed, or the packages cannot be installed.
    """
    if shutil.which("npm") is None:
        pytest.skip("npm is not installed")
    (folder / "package.json").write_text("{}")
    command = ["npm", "install", "--no-audit", "--omit=optional", "--ignore-scripts", *packages]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"the npm packages cannot be installed: {done.stderr.strip()[-200:]}")
    return folder
