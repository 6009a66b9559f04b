"""What a person asks of a session while it runs; `manytouch.session` does it between two frames."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Go on after `Stop`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Hold: what a camera shows meanwhile is not read, and does not count as dropped; a file waits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tare:
    """What the next frames show is the untouched sheet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UseMethod:
    """Read with another method from the next frame on."""

    method: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Tune:
    """Give a parameter of a stage another value.

    Attributes:
        parameter: stage and field, such as "detect.least_share"; `Health.parameters` names all.
        value: a whole number where the parameter is one.
    """

    parameter: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Begin a recording.

    Attributes:
        path: the file; None makes a name from the time, in the session's folder.
    """

    path: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRecording:
    """End the recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """Press the simulated sensor, or move a finger that presses it.

    Attributes:
        finger: which one.
        x_mm, y_mm: undeformed sheet coordinates.
        depth_mm: how deep.
    """

    finger: int
    x_mm: float
    y_mm: float
    depth_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """Lift a finger off the simulated sensor."""

    finger: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Seek:
    """Go to a place of a recording, counted in frames from 0."""

    frame: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Play:
    """Replay at a multiple of the recorded pace."""

    speed: float


Command = Start | Stop | Tare | UseMethod | Tune | Record | StopRecording | Press | Release | Seek | Play
