"""How a session is doing."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A property of a camera.

    Attributes:
        name: such as "exposure".
        asked: what was asked for, in words; None when nothing was.
        found: what the camera says, in words; None when it does not tell.
    """

    name: str
    asked: str | None
    found: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """A session at one moment.

    Attributes:
        is_running: False between `Stop` and `Start`.
        source: "ok", or a sentence about what is wrong with it.
        fps: readings per second of the last two seconds.
        latency_ms_p50, latency_ms_p99: from the arrival of a frame until all sinks had its reading, over the
            last 300 readings; NaN before the first.
        frames: readings so far.
        dropped: frames that arrived and were not read, because reading was too slow.
        markers_seen, markers: of the last frame, and of the layout.
        method, methods: in use, and those there are.
        parameters: by stage and field; those that `Tune` changes.
        settings: of the camera.
        recording: name of the file, or None.
        notes: what there was to tell, newest last.
        frame, frame_count: place on a recording's timeline; None when there is none.
        can_press: does `Press` do anything?
        sensor_version: grows with every change of the sensor value.
    """

    is_running: bool
    source: str
    fps: float
    latency_ms_p50: float
    latency_ms_p99: float
    frames: int
    dropped: int
    markers_seen: int
    markers: int
    method: str
    methods: tuple[str, ...]
    parameters: Mapping[str, int | float]
    settings: tuple[Setting, ...] = ()
    recording: str | None = None
    notes: tuple[str, ...] = ()
    frame: int | None = None
    frame_count: int | None = None
    can_press: bool = False
    sensor_version: int = 0
