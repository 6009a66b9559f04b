"""Reads TOML files that others may have written: size, nesting and number of keys are limited."""

import codecs
import re
import string
import tomllib
from collections.abc import Mapping
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from manytouch.errors import ManytouchError
from manytouch.limits import (
    MAX_TOML_BYTES,
    MAX_TOML_DEPTH,
    MAX_TOML_KEYS,
    MAX_TOML_LISTS,
    MAX_TOML_VALUES,
)

# Comments and strings (TOML 1.0); what follows a string without end is no more parsed by tomllib either. No
# possessive quantifiers: those of groups match wrongly before Python 3.11.5 (its issue gh-106052).
_NO_SYNTAX = re.compile(
    r"#[^\n]*"
    r'|"""[^"\\]*(?:(?:\\[\s\S]|"(?!""))[^"\\]*)*"{3,5}'
    r"|'''[^']*(?:'(?!'')[^']*)*'{3,5}"
    r'|"(?!"")[^"\\\n]*(?:\\.[^"\\\n]*)*"'
    r"|'(?!'')[^'\n]*'"
    r"|[\"'][\s\S]*"
)
_KEYS = {
    "a rig file": {"sensors"},
    "a scene file": {"bodies", "seconds", "board"},
    "a sensor file": {"camera", "views", "sheet", "markers"},
}
"""Keys by which files of one kind are known where another kind is expected."""
_USES = {
    "a rig file": "manytouch run {path}",
    "a scene file": "manytouch simulate {path} --out DIR, or manytouch run sim:{path}",
    "a sensor file": "manytouch run SOURCE --sensor {path}",
}
_NAME = np.zeros(256, dtype=np.bool_)
_NAME[[ord(letter) for letter in string.ascii_letters + string.digits + "-_. \t"]] = True


def read_toml(path: Path | Traversable, kind: str, error: type[ManytouchError]) -> dict[str, Any]:
    """Read a TOML file.

    Args:
        path: of the file.
        kind: what it is, for messages, such as "a sensor file".
        error: to raise.

    Raises:
        FileNotFoundError: it does not exist.
        ManytouchError: of the class `error`: it cannot be read, is not TOML, exceeds a limit, or is a file of
            another kind.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_TOML_BYTES + 1)
        if len(content) > MAX_TOML_BYTES:
            raise error(f"{path} is too large for {kind}: at most {MAX_TOML_BYTES // 10**6} MB are read")
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError:
        raise
    except IsADirectoryError:
        raise error(f"{path} is a folder: give the path of {kind} (.toml)") from None
    except UnicodeDecodeError:
        if b"\0" in content and not content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise error(f"{path} is not a text file: give the path of {kind} (.toml)") from None
        raise error(f"{path} cannot be read as {kind}: it is not text in UTF-8; save it as such") from None
    except OSError as reason:
        raise error(
            f"{path} cannot be read: {reason.strerror or reason}; give {kind} that can be read"
        ) from None
    except ValueError as reason:
        raise error(f"{path} cannot be read as {kind}: {reason}") from None
    mistake = complexity_mistake(text)
    if mistake is not None:
        raise error(f"{path} is no usable TOML: {mistake}")
    try:
        table = tomllib.loads(text)
    except ValueError as reason:  # TOMLDecodeError, or an integer of more than 4300 digits
        raise error(f"{path} is not valid TOML: {reason}") from None
    other = _other_kind(table, kind)
    if other is not None:
        raise error(f"{path} is {other}, not {kind}: {_USES[other].format(path=path)}")
    return table


def _other_kind(table: Mapping[str, Any], kind: str) -> str | None:
    """Which other kind of file has keys of a table that has none of its own kind; None: none has."""
    if _KEYS.get(kind, set()) & table.keys():
        return None
    return next((other for other, keys in _KEYS.items() if keys & table.keys()), None)


def complexity_mistake(text: str) -> str | None:
    """Why parsing this text could take much time or memory; None if it cannot."""
    code = np.frombuffer(_NO_SYNTAX.sub("x", text).encode(), dtype=np.uint8)
    if not len(code):
        return None
    opens = (code == ord("[")) | (code == ord("{"))
    closes = (code == ord("]")) | (code == ord("}"))
    depth = np.cumsum(opens.astype(np.int32) - closes)
    dots = np.cumsum(code == ord("."), dtype=np.int32)
    ends = np.flatnonzero(~_NAME[code])
    dots_of_key = np.diff(np.concatenate([[0], dots[ends], dots[-1:]]))
    nested = max(int(depth.max()), int(dots_of_key.max()) + 1)
    if nested > MAX_TOML_DEPTH:
        return f"it is nested {nested} deep, at most {MAX_TOML_DEPTH} are allowed"
    keys = int((code == ord("=")).sum()) + int((opens & (depth == 1)).sum())
    if keys > MAX_TOML_KEYS:
        return f"it has {keys} keys, at most {MAX_TOML_KEYS} are allowed"
    lists, values = int(opens.sum()), int((code == ord(",")).sum())
    if lists > MAX_TOML_LISTS or values > MAX_TOML_VALUES:
        return (
            f"it has {lists} lists and {values} separated values, at most {MAX_TOML_LISTS} and "
            f"{MAX_TOML_VALUES} are allowed"
        )
    return None
