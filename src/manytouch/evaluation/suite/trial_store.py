"""Trials in files, from which an interrupted run of the suite is resumed.

One `.npz` per trial: its arrays, and the tree of its other values as JSON. Nothing in a file is executed, and
only the types below are made from it, since the folder belongs to the user's results and may come from
anywhere.
"""

import json
import os
import zipfile
import zlib
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from manytouch.evaluation.metrics.comparison import MethodErrors
from manytouch.evaluation.metrics.contacts import ContactSamples
from manytouch.evaluation.metrics.depth import DepthSamples
from manytouch.evaluation.metrics.markers import DotSamples
from manytouch.evaluation.metrics.separation import SeparationSamples
from manytouch.evaluation.metrics.worst_frame import WorstFrame
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.values.arrays import read_only

SUFFIX = ".npz"
TREE = "tree"
TYPES = {
    each.__name__: each
    for each in (MethodErrors, DotSamples, DepthSamples, ContactSamples, SeparationSamples, WorstFrame)
}


def write_comparisons(path: Path, comparisons: tuple[MethodErrors, ...]) -> None:
    """Write the errors of all methods on one recording.

    Raises:
        OutputError: the file cannot be written.
    """
    arrays: dict[str, np.ndarray] = {}
    tree = json.dumps(_flatten(comparisons, arrays))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with output_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **{TREE: np.array(tree)}, **arrays)
        part.replace(path)


def read_comparisons(path: Path) -> tuple[MethodErrors, ...] | None:
    """What `write_comparisons` has written; None where the file is missing or damaged."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: read_only(file[name]) for name in file.files}
        comparisons = _restore(json.loads(str(arrays[TREE])), arrays)
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, KeyError, TypeError, ValueError):
        return None
    is_whole = isinstance(comparisons, tuple) and all(isinstance(one, MethodErrors) for one in comparisons)
    return comparisons if is_whole else None


def _flatten(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """A value as JSON; its arrays are put into `arrays` and referred to by name."""
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if is_dataclass(value):
        members = {each.name: _flatten(getattr(value, each.name), arrays) for each in fields(value)}
        return {"type": type(value).__name__, "fields": members}
    if isinstance(value, tuple):
        return [_flatten(each, arrays) for each in value]
    return value.item() if isinstance(value, np.generic) else value


def _restore(tree: Any, arrays: dict[str, np.ndarray]) -> Any:
    """The value of `_flatten`; KeyError or TypeError where it is not one."""
    if isinstance(tree, list):
        return tuple(_restore(each, arrays) for each in tree)
    if isinstance(tree, dict):
        if "array" in tree:
            return arrays[tree["array"]]
        members = {name: _restore(each, arrays) for name, each in tree["fields"].items()}
        return TYPES[tree["type"]](**members)
    return tree
