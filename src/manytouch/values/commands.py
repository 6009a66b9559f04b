"""Requests to a running session; `manytouch.session` carries them out between two frames."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Resume:
    """Continue after `Pause`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """Process no frames until `Resume`.

    Those that a camera delivers meanwhile are skipped and not counted as dropped; a file waits. What ends a
    run is its `session.StopCondition`.
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class Tare:
    """Take the marker positions of the next frames as the reference; the sheet must be untouched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UndoTare:
    """Take the reference before the last `Tare` again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UseMethod:
    """Process with another method from the next frame on."""

    method: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Tune:
    """Change a parameter of a stage.

    Attributes:
        parameter: stage and field, such as "detect.least_share"; `Health.parameters` lists all of them.
        value: the new value; integral if the parameter is an integer, a word if it is a choice. None:
            determined automatically.
    """

    parameter: str
    value: float | str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """Start a recording.

    Attributes:
        path: the file; None: a name made from the time, in the session's folder.
    """

    path: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRecording:
    """End the recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """Press the simulated sensor, or move an indenter that presses it.

    Attributes:
        finger: number of the indenter.
        x_mm, y_mm: undeformed sheet coordinates.
        depth_mm: depth of the press, positive.
    """

    finger: int
    x_mm: float
    y_mm: float
    depth_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """Lift an indenter off the simulated sensor."""

    finger: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Seek:
    """Go to a frame of a recording, counted from 0."""

    frame: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Play:
    """Play back at a multiple of the recorded rate."""

    speed: float


Command = (
    Resume
    | Pause
    | Tare
    | UndoTare
    | UseMethod
    | Tune
    | Record
    | StopRecording
    | Press
    | Release
    | Seek
    | Play
)


def command_kind(command: Command) -> tuple[str, int | str]:
    """The kind of a command. Of several of one kind that wait, only the newest is carried out."""
    match command:
        case Resume() | Pause():
            return "run", ""
        case Tare() | UndoTare():
            return "tare", ""
        case Record() | StopRecording():
            return "record", ""
        case Press(finger=finger) | Release(finger=finger):
            return "finger", finger
        case Tune(parameter=parameter):
            return "tune", parameter
    return type(command).__name__, ""
