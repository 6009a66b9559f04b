"""Format of the binary messages from viewer to browser, one per update.

    4 bytes   length n of the head, little endian
    n bytes   head, JSON, padded with spaces so that 4 + n is a multiple of 4
    the rest  the parts one after the other, each starting at a multiple of 4

`head["parts"]` names each part: `{"name", "type", "shape", "at", "size"}`, where `type` is a numpy
letter and byte count (`f4`, `u1`) or `jpeg`, and `at` counts bytes from the end of the head. The page
reads the types in `TYPES` of `page/connection.js`. Unknown numbers are null in the head and NaN in arrays;
`number` makes those of the head, and those of the other messages to the page, which are JSON.
"""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

_ALIGN = 4


def pack(head: Mapping[str, Any], parts: Mapping[str, np.ndarray | bytes]) -> bytes:
    """Encode a message from its head and its parts: arrays, or the bytes of a JPEG."""
    listed: list[dict[str, Any]] = []
    blocks: list[bytes] = []
    at = 0
    for name, part in parts.items():
        if isinstance(part, np.ndarray):
            block, kind, shape = part.tobytes(), part.dtype.str[1:], list(part.shape)
        else:
            block, kind, shape = part, "jpeg", [len(part)]
        listed.append({"name": name, "type": kind, "shape": shape, "at": at, "size": len(block)})
        blocks.append(block.ljust(_whole(len(block)), b"\0"))
        at += len(blocks[-1])
    text = json.dumps({**head, "parts": listed}, allow_nan=False, separators=(",", ":")).encode()
    text = text.ljust(_whole(len(text)))
    return b"".join([len(text).to_bytes(4, "little"), text, *blocks])


def unpack(message: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray | bytes]]:
    """Decode a message into head and parts; for client programs other than the page."""
    start = 4 + int.from_bytes(message[:4], "little")
    head = json.loads(message[4:start])
    parts: dict[str, np.ndarray | bytes] = {}
    for part in head["parts"]:
        block = message[start + part["at"] : start + part["at"] + part["size"]]
        if part["type"] == "jpeg":
            parts[part["name"]] = block
        else:
            parts[part["name"]] = np.frombuffer(block, dtype=f"<{part['type']}").reshape(part["shape"])
    return head, parts


def number(value: float | int | None, digits: int = 4) -> float | None:
    """A rounded number for JSON; None if it is not known."""
    return None if value is None or not math.isfinite(value) else round(float(value), digits)


def _whole(size: int) -> int:
    return -(-size // _ALIGN) * _ALIGN
