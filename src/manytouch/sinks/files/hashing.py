"""SHA-256, in hexadecimal, of files, texts and values; see `session.result_hashes` for what is hashed."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

BLOCK = 2**20


def files_hash(paths: Sequence[Path]) -> str:
    """SHA-256 of the bytes of an input, read in blocks.

    For one file as `sha256sum` prints it, whatever its name; for several that of the lines that `sha256sum`
    prints for them in the order given, with their names without folders; for none that of an empty text.

    Raises:
        OSError: a file cannot be read.
    """
    hashes = [_file_hash(path) for path in paths]
    if len(hashes) == 1:
        return hashes[0]
    lines = (f"{found}  {path.name}\n" for found, path in zip(hashes, paths, strict=True))
    return text_hash("".join(lines))


def values_hash(values: Any) -> str:
    """SHA-256 of values, independent of the order of keys.

    Raises:
        TypeError: JSON cannot represent a value.
    """
    return text_hash(json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=False))


def text_hash(text: str) -> str:
    """SHA-256 of a text in UTF-8."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def result_hash(parts: Mapping[str, str | None]) -> str | None:
    """The hash of a result from those of what it was computed from; None where one is not known."""
    return None if None in parts.values() else values_hash(dict(parts))


def _file_hash(path: Path) -> str:
    found = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(BLOCK):
            found.update(block)
    return found.hexdigest()
