"""Comparison of result folders, but for what was measured with a clock."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from results import rows_of

TIMES = ("milliseconds",)


def differences(found: Path, expected: Path) -> list[str]:
    """Names of the files whose content differs."""
    names = sorted({path.name for folder in (found, expected) for path in folder.iterdir()})
    return [name for name in names if content_of(found / name) != content_of(expected / name)]


def content_of(path: Path) -> Any:
    """Content of a result without times; None if it does not exist."""
    if not path.exists():
        return None
    if path.name == "frames.csv":
        return [{name: text for name, text in row.items() if name not in TIMES} for row in rows_of(path)]
    if path.name == "summary.json":
        found = json.loads(path.read_text())
        return {name: value for name, value in found.items() if name not in TIMES}
    return pq.read_table(path) if path.suffix == ".parquet" else path.read_bytes()
