"""State of a running session as it is displayed."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A property of a camera.

    Attributes:
        name: such as "exposure".
        requested: the requested value as text; None if nothing was requested.
        found: the value that the camera reports, as text; None if it reports none.
    """

    name: str
    requested: str | None
    found: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputState:
    """State of an output to another program.

    Attributes:
        name: its address, as given.
        sent: readings that were passed on.
        dropped: readings that were not, because the output was too slow or has failed.
        problem: a sentence on what is wrong; None if nothing is.
    """

    name: str
    sent: int
    dropped: int
    problem: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterInfo:
    """What a settings page shows of a parameter.

    Attributes:
        label: in words.
        unit: of its value; empty for a number without unit, or a choice.
        help: what it does.
        default: its value if it was not changed; None: determined automatically.
        is_essential: whether it is one of the few that users change.
    """

    label: str
    unit: str
    help: str
    default: int | float | str | None
    is_essential: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """State of a session at one time.

    Attributes:
        is_running: false between `Pause` and `Resume`.
        source_state: "ok", or a sentence on what is wrong with the source.
        readings_per_s: of the last two seconds; `Source.fps` is the rate of the source.
        latency_ms_p50, latency_ms_p99: from the arrival of a frame until all sinks have received its reading,
            over the last 300 readings; NaN before the first.
        frames: readings so far.
        dropped: frames that arrived but were not processed, because processing was too slow.
        markers_seen, markers: of the last frame, and of the layout.
        method, methods: the method in use, and those available.
        parameters: that `Tune` can change, by stage and field; None: determined automatically.
        choices: the words to choose from, of the parameters that are a choice.
        parameter_info: label, unit, help and default of the parameters, those that matter most first.
        settings: of the camera.
        recording: name of the file, or None.
        notes: messages of the session, newest last.
        frame, frame_count: position in a recording and its length; None if the source is not a recording.
        can_press: whether the source accepts `Press`.
        can_untare: whether there is a `Tare` to undo.
        reference_warning: a sentence if something touched the sheet during the `Tare` whose reference is in
            use; else None.
        sensor_version: increases with every change of the sensor.
        is_preparing: whether a changed method, parameter or reference is being prepared.
        outputs: to other programs.
    """

    is_running: bool
    source_state: str
    readings_per_s: float
    latency_ms_p50: float
    latency_ms_p99: float
    frames: int
    dropped: int
    markers_seen: int
    markers: int
    method: str
    methods: tuple[str, ...]
    parameters: Mapping[str, int | float | str | None]
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    parameter_info: Mapping[str, ParameterInfo] = field(default_factory=dict)
    settings: tuple[Setting, ...] = ()
    recording: str | None = None
    notes: tuple[str, ...] = ()
    frame: int | None = None
    frame_count: int | None = None
    can_press: bool = False
    can_untare: bool = False
    reference_warning: str | None = None
    sensor_version: int = 0
    is_preparing: bool = False
    outputs: tuple[OutputState, ...] = ()
