"""Damaged and hostile recordings, from a seed; each is refused in one sentence, or what is whole replays."""

import atexit
import random
import shutil
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard

from drawn_source import DrawnSource
from manytouch.errors import SourceError
from manytouch.recording.reader import Recording
from manytouch.recording.records import CHUNK, ChunkLocation, read_chunk
from manytouch.recording.repair import check, repair
from manytouch.session import prepare
from manytouch.sinks.recorder import Recorder
from manytouch.sources import open_source
from manytouch.values import Reading, Status

HEAD = struct.Struct("<BQ")
FRAMES = 16
SIZES = (0, 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)


def damaged(whole: bytes, seed: int) -> tuple[str, bytes]:
    """One kind of damage, and the damaged bytes of a recording."""
    chance = random.Random(seed)
    kind = chance.choice(list(KINDS))
    return kind, KINDS[kind](whole, chance)


def attempt(path: Path, original: Recording, *, is_sealed: bool) -> None:
    """Open, replay, check and repair a file.

    Args:
        path: the damaged file.
        original: the recording of which it was made.
        is_sealed: whether its checksums are right although its content was changed.

    Raises:
        SourceError: it is refused.
        AssertionError: something differs from the original although its status is `ok`.
        Exception: another error; it is a fault.
    """
    try:
        source = open_source(path)
    except SourceError:
        _try_repair(path)
        raise
    timeline = source.capabilities.seek
    assert timeline is not None
    readings = [timeline.reading(place) for place in range(len(timeline))]
    has_reading = [reading is not None for reading in readings]
    has_end = is_sealed or Recording(path).is_complete
    assert all(has_reading[: len(has_reading) if has_end else sum(has_reading)]), "a reading is skipped"
    expected = _readings(original)
    for place, reading in enumerate(readings):
        frame = timeline.frame(place) if reading is None else reading.frame
        if frame.encoded is not None and not is_sealed:
            assert frame.encoded == expected[frame.index].frame.encoded
        if reading is not None and reading.status is Status.OK and not is_sealed:
            known = expected[frame.index]
            np.testing.assert_array_equal(reading.surface.position_mm, known.surface.position_mm)
            np.testing.assert_array_equal(reading.grid.position_px, known.grid.position_px)
    _try_repair(path)


@cache
def _readings(original: Recording) -> dict[int, Reading]:
    """The readings of an undamaged recording by the number of their frame."""
    found = (original.reading(original.frame(place)) for place in range(len(original)))
    return {reading.frame.index: reading for reading in found if reading is not None}


def is_sealed(kind: str) -> bool:
    """Whether a kind of damage has right checksums."""
    return kind.startswith("sealed")


def _try_repair(path: Path) -> None:
    report = check(path)
    assert list(report.lines())
    repaired = path.with_name("repaired.mcap")
    repaired.unlink(missing_ok=True)
    try:
        repair(path, repaired)
    except SourceError:
        return
    assert Recording(repaired).is_complete


def _flip(whole: bytes, chance: random.Random) -> bytes:
    content = bytearray(whole)
    for _ in range(chance.choice((1, 1, 1, 3, 20))):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    return bytes(content)


def _cut(whole: bytes, chance: random.Random) -> bytes:
    return whole[: chance.randrange(len(whole))]


def _remove(whole: bytes, chance: random.Random) -> bytes:
    begin = chance.randrange(len(whole))
    return whole[:begin] + whole[begin + chance.choice((1, 8, 1000)) :]


def _insert(whole: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(whole))
    return whole[:at] + chance.randbytes(chance.choice((1, 9, 3000))) + whole[at:]


def _erase(whole: bytes, chance: random.Random) -> bytes:
    begin = chance.randrange(len(whole))
    end = min(len(whole), begin + 4096)
    return whole[:begin] + bytes(end - begin) + whole[end:]


def _swap(whole: bytes, chance: random.Random) -> bytes:
    chunks = list(_chunks(whole))
    one, other = sorted(chance.sample(range(len(chunks)), 2))
    (a, b), (c, d) = chunks[one], chunks[other]
    return whole[:a] + whole[c:d] + whole[b:c] + whole[a:b] + whole[d:]


def _repeat(whole: bytes, chance: random.Random) -> bytes:
    begin, end = chance.choice(list(_chunks(whole)))
    return whole[:end] + whole[begin:end] + whole[end:]


def _record_size(whole: bytes, chance: random.Random) -> bytes:
    begin, _ = chance.choice(list(_chunks(whole)))
    return whole[: begin + 1] + struct.pack("<Q", chance.choice(SIZES)) + whole[begin + 9 :]


def _stated_size(whole: bytes, chance: random.Random) -> bytes:
    begin, _ = chance.choice(list(_chunks(whole)))
    return whole[: begin + 25] + struct.pack("<Q", chance.choice(SIZES)) + whole[begin + 33 :]


def _sealed_bytes(whole: bytes, chance: random.Random) -> bytes:
    return _resealed(whole, chance, lambda data: _flip(data, chance))


def _sealed_text(whole: bytes, chance: random.Random) -> bytes:
    old, new = chance.choice(
        (
            (b'"milliseconds":', b'"milliseconds":NaN,"x":'),
            (b'"milliseconds":', b'"milliseconds":1e999,"x":'),
            (b'"frame":', b'"frame":\xff\xfe,"x":'),
            (b'"values":{', b'"values":' + b"[" * 100_000),
            (b'"type":"', b'"type":"\xc3\x28'),
            (b'"shape":[', b'"shape":[999999999,'),
            (b'"shape":[', b'"shape":[-1,'),
            (b'"at":', b'"at":1'),
            (b'"bytes":', b'"bytes":9999999999'),
            (b'"width_px":', b'"width_px":99999'),
            (b'"started_unix_ns":', b'"started_unix_ns":1'),
            (b'"schema":2', b'"schema":3'),
            (b'"schema":2', b'"schema":"2"'),
            (b'"elements":[', b'"elements":[9'),
            (b'"status":"ok"', b'"status":"fine"'),
            (b"null", b"0"),
        )
    )
    return _resealed(whole, chance, lambda data: data.replace(old, new, 1), having=old)


KINDS: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "bits": _flip,
    "cut": _cut,
    "bytes removed": _remove,
    "bytes inserted": _insert,
    "zeros": _erase,
    "chunks swapped": _swap,
    "chunk repeated": _repeat,
    "size of a record": _record_size,
    "stated size": _stated_size,
    "sealed bytes": _sealed_bytes,
    "sealed text": _sealed_text,
}


def _chunks(whole: bytes) -> Iterator[tuple[int, int]]:
    """Begin and end of the chunks of an undamaged recording."""
    at = 8
    while at + HEAD.size <= len(whole):
        opcode, length = HEAD.unpack(whole[at : at + HEAD.size])
        end = at + HEAD.size + length
        if opcode == CHUNK:
            yield at, end
        at = end


def _resealed(
    whole: bytes, chance: random.Random, change: Callable[[bytes], bytes], *, having: bytes = b""
) -> bytes:
    """A recording in which one chunk has changed records and the right checksum and sizes."""
    chunks = list(_chunks(whole))
    chance.shuffle(chunks)
    for begin, end in chunks:
        data = read_chunk(whole, ChunkLocation(begin + HEAD.size, end))
        if having in data:
            changed = _message_lengths(data, change)
            body = zstandard.compress(changed)
            head = whole[begin + HEAD.size : begin + HEAD.size + 16]
            content = head + struct.pack("<QI", len(changed), zlib.crc32(changed))
            content += struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(body)) + body
            return whole[:begin] + HEAD.pack(CHUNK, len(content)) + content + whole[end:]
    return whole


def _message_lengths(data: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """Records whose last one, a message, has changed content and the right length."""
    at = last = 0
    while at < len(data):
        last = at
        at += HEAD.size + HEAD.unpack(data[at : at + HEAD.size])[1]
    begin = last + HEAD.size + 22
    changed = change(data[begin:])
    return data[:last] + HEAD.pack(data[last], 22 + len(changed)) + data[last + HEAD.size : begin] + changed


class RecordingFuzzer(NamedTuple):
    """A kind of inputs for `make faults`: its name, and what makes and reads the input of a seed."""

    name: str
    run: Callable[[int, Path], None]


@cache
def small_recording() -> Recording:
    """A recording of a few frames, in a folder that is removed at the end of the process."""
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    job = prepare(DrawnSource(frames=FRAMES, fps=30.0))
    recorder = Recorder(folder / "small.mcap", source=job.input_info)
    recorder.describe(job.sensor, job.pipeline, job.method)
    for reading in job.readings():
        recorder.take(reading.frame)
        recorder.write(reading)
    recorder.close()
    return Recording(folder / "small.mcap")


def warm_up() -> None:
    """Compile and load what valid inputs need."""
    run_recording(0, small_recording().path.parent)


def run_recording(seed: int, folder: Path) -> None:
    """Damage a recording and read it."""
    original = small_recording()
    kind, content = damaged(original.path.read_bytes(), seed)
    path = folder / "damaged.mcap"
    path.write_bytes(content)
    attempt(path, original, is_sealed=is_sealed(kind))


FUZZERS = (RecordingFuzzer("recording", run_recording),)
