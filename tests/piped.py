"""Values as they travel between processes, through a file instead of a pipe."""

import io
from pathlib import Path
from typing import Any

from manytouch.child_process import receive, send


def sent(value: object, file: Path) -> bytes:
    with file.open("wb", buffering=0) as raw:
        send(raw, value)
    return file.read_bytes()


def received(data: bytes) -> Any:
    return receive(io.BufferedReader(io.BytesIO(data)))
