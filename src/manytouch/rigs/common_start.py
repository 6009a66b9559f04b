"""One clock for all sensors of a rig: files and simulations begin together, with the times that they state.

A file, a recording or a simulation is not begun before all others of the rig are ready, as some need longer
to compile or to open. Recordings keep the distances of their starts.
"""

import contextlib
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection

LEAD_NS = 200_000_000
"""How long after the last is ready all begin, so that each has received the message."""
MOST_APART_NS = 600 * 10**9
"""Recordings that were begun further apart belong to different sessions: each is replayed from its start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadyMessage:
    """A sensor with a file or a simulation is ready to begin.

    Attributes:
        started_unix_ns: start of its recording; None: it is not a recording of manytouch.
    """

    started_unix_ns: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class BeginMessage:
    """When to begin: timestamp 0 is due at `at_ns` by the monotonic clock that all processes share."""

    at_ns: int


@dataclass(eq=False)
class CommonStart:
    """Lets the sensors that have files or simulations begin together.

    Attributes:
        began_ns: second 0 of the rig; that of the first frame if no sensor has a camera.
        has_camera: whether one of the sensors has a camera.
        waiting: sensors that are ready, by name.
        is_begun: whether the files and simulations run.
    """

    has_camera: bool
    began_ns: int = field(default_factory=time.monotonic_ns)
    waiting: dict[str, tuple[Connection, ReadyMessage]] = field(default_factory=dict)
    is_begun: bool = False

    def ready(self, name: str, connection: Connection, message: ReadyMessage) -> None:
        """Note that a sensor is ready; one that has been started again begins at once."""
        if self.is_begun:
            _send(connection, time.monotonic_ns())
        else:
            self.waiting[name] = connection, message

    def begin_if_ready(self, expected: Mapping[str, bool]) -> None:
        """Begin once no sensor is expected that is not ready.

        Args:
            expected: whether each sensor with a file or a simulation may still become ready, by name.
        """
        if (
            self.is_begun
            or not self.waiting
            or any(expected[name] and name not in self.waiting for name in expected)
        ):
            return
        self.is_begun = True
        at_ns = time.monotonic_ns() + LEAD_NS
        if not self.has_camera:
            self.began_ns = at_ns
        offsets_ns = offsets({name: message.started_unix_ns for name, (_, message) in self.waiting.items()})
        for name, (connection, _) in self.waiting.items():
            _send(connection, at_ns + offsets_ns[name])
        self.waiting.clear()


def offsets(started_unix_ns: Mapping[str, int | None]) -> dict[str, int]:
    """How much later than the first each begins, in ns; 0 for what is not a recording."""
    known = [start for start in started_unix_ns.values() if start is not None]
    first = min(known, default=0)
    is_one_session = max(known, default=0) - first <= MOST_APART_NS
    return {
        name: start - first if start is not None and is_one_session else 0
        for name, start in started_unix_ns.items()
    }


def _send(connection: Connection, at_ns: int) -> None:
    with contextlib.suppress(OSError):  # it has died, and is started again
        connection.send(BeginMessage(at_ns=at_ns))
