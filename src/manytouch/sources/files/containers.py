"""Completeness of a video file from its outermost structure, without decoding.

RIFF (AVI): Microsoft, "AVI RIFF File Reference". MP4 and MOV: ISO/IEC 14496-12, 4.2. Matroska and
WebM: RFC 8794 (EBML) and RFC 9559.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal

MP4_TYPES = {b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"}
EBML, SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Container:
    """The kind of a video file, and whether it ends before its declared end."""

    kind: Literal["riff", "mp4", "matroska", "other"]
    is_cut_short: bool


def read_container(path: Path) -> Container:
    """Read the sizes that the file's outermost elements declare."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(12)
        if head[:4] == b"RIFF":
            return Container(kind="riff", is_cut_short=any(end > size for end in _riff_ends(file, size)))
        if head[4:8] in MP4_TYPES:
            return Container(kind="mp4", is_cut_short=any(end > size for end in _mp4_ends(file, size)))
        if head[:4] == EBML:
            return Container(kind="matroska", is_cut_short=_segment_end(file) > size)
    return Container(kind="other", is_cut_short=False)


def _riff_ends(file: BinaryIO, size: int) -> Iterator[int]:
    place = 0
    while place + 8 <= size:
        file.seek(place)
        head = file.read(8)
        if head[:4] != b"RIFF":
            return
        place += 8 + int.from_bytes(head[4:], "little")
        yield place


def _mp4_ends(file: BinaryIO, size: int) -> Iterator[int]:
    place = 0
    while place + 8 <= size:
        file.seek(place)
        head = file.read(16)
        length = int.from_bytes(head[:4], "big")
        if length == 1:
            length = int.from_bytes(head[8:], "big")
        if length < 8:  # 0: to the end of the file
            return
        place += length
        yield place


def _segment_end(file: BinaryIO) -> int:
    """End of the segment; 0 when its length is not declared, as in a stream."""
    file.seek(4)
    length = _ebml_length(file)
    if length is None:
        return 0
    file.seek(length, 1)
    if file.read(4) != SEGMENT:
        return 0
    length = _ebml_length(file)
    return 0 if length is None else file.tell() + length


def _ebml_length(file: BinaryIO) -> int | None:
    first = file.read(1)
    if not first or not first[0]:
        return None
    more = 8 - first[0].bit_length()
    bits = 7 * (more + 1)
    length = int.from_bytes(first + file.read(more), "big") & ((1 << bits) - 1)
    return None if length == (1 << bits) - 1 else length
