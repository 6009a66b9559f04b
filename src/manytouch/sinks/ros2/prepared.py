"""Serialized messages of which only the stamp and the last bytes change from one reading to the next.

CDR, little-endian, as ROS 2 sends it: four bytes of encapsulation, and then, in messages with a header, its
stamp of two 32-bit integers.
"""

import struct

STAMP = slice(4, 12)
LENGTH_BYTES = 4
FILLER = 0xA5


def with_stamp(cdr: bytes, stamp_ns: int) -> bytes:
    """A message with another stamp."""
    return b"".join((cdr[: STAMP.start], _stamp(stamp_ns), cdr[STAMP.stop :]))


def without_last_length(cdr: bytes) -> bytes:
    """A message whose last field is an empty sequence of bytes, without the length of this sequence."""
    return cdr[:-LENGTH_BYTES]


def with_last_bytes(cdr: bytes, content: bytes) -> bytes:
    """A message without its last field, with a sequence of bytes as the last field."""
    return b"".join((cdr, struct.pack("<I", len(content)), content))


class PreparedCloud:
    """A point cloud of a fixed number of points."""

    def __init__(self, cdr: bytes, content_bytes: int) -> None:
        """Prepare.

        Args:
            cdr: the message, with `FILLER` in all bytes of its points.
            content_bytes: number of these bytes.
        """
        begin = cdr.rindex(bytes([FILLER]) * content_bytes) if content_bytes else len(cdr)
        self._start, self._middle = cdr[: STAMP.start], cdr[STAMP.stop : begin]
        self._end = cdr[begin + content_bytes :]

    def __call__(self, stamp_ns: int, content: bytes) -> bytes:
        """The message with these points."""
        return b"".join((self._start, _stamp(stamp_ns), self._middle, content, self._end))


def _stamp(stamp_ns: int) -> bytes:
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    return struct.pack("<iI", seconds, nanoseconds)
