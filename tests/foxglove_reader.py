"""The npm packages with which Foxglove and Lichtblick read files and live connections."""

import base64
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from peer_node import node_packages

SCRIPT = Path(__file__).parent / "peers" / "foxglove_reader.mjs"
PACKAGES = (
    "@mcap/core@2.2.2",
    "@mcap/support@1.1.0",
    "@foxglove/rosmsg@5.0.5",
    "@foxglove/rosmsg2-serialization@3.1.0",
    "@foxglove/ws-protocol@0.8.0",
    "ws@8.23.0",
)


def foxglove_packages(folder: Path) -> Path:
    """A folder with the packages; the test is skipped where they cannot be installed."""
    return node_packages(PACKAGES, folder)


def started_reader(packages: Path, *words: str) -> "subprocess.Popen[str]":
    """The reader, which prints a line of JSON per message."""
    command = ["node", str(SCRIPT), str(packages), *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def bytes_of(value: dict[str, Any]) -> bytes:
    """The bytes of a field."""
    return base64.b64decode(value["base64"])


def points_of(value: dict[str, Any], columns: int) -> np.ndarray:
    """The points of a cloud of numbers of single precision."""
    return np.frombuffer(bytes_of(value), "<f4").reshape(-1, columns)
