"""The outputs by the scheme of their URL, in one place; each is imported when it is used."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from manytouch.errors import ManytouchError, OutputError
from manytouch.pipeline import Controls
from manytouch.sinks.publishers.address import OutputAddress, parse_address
from manytouch.sinks.publishers.images import ImageTurns
from manytouch.sinks.publishers.midi import MidiPublisher, MpeEncoder
from manytouch.sinks.publishers.osc import encode_osc
from manytouch.sinks.publishers.queued import Publisher, QueuedOutput
from manytouch.sinks.publishers.touches import FULL_SCALES, full_scales, scale_of
from manytouch.sinks.publishers.tuio import PORT as TUIO_PORT
from manytouch.sinks.publishers.tuio import Tuio11, Tuio20
from manytouch.sinks.publishers.udp import OscPublisher
from manytouch.values import Reading, Sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheme:
    """A kind of output.

    Attributes:
        example: a URL.
        purpose: what receives it.
        options: names that may follow "?" in the URL.
        check: raises ManytouchError if an option has a wrong value, or a part of the address is missing.
        open_publisher: opens it.
        warm_up: makes messages of a reading without sending them, so that the first ones take no longer.
    """

    example: str
    purpose: str
    options: tuple[str, ...]
    check: Callable[[OutputAddress], object] | None = None
    open_publisher: Callable[[OutputAddress, Controls], Publisher]
    warm_up: Callable[[Reading, Sensor], object] | None = None


def _ros2(address: OutputAddress, controls: Controls) -> Publisher:
    from manytouch.sinks.publishers.ros2 import Ros2Publisher

    return Ros2Publisher(address, controls)


def _check_ros2(address: OutputAddress) -> None:
    from manytouch.sinks.publishers import ros2

    ros2.settings(address)


def _warm_up_ros2(reading: Reading, sensor: Sensor) -> None:
    from manytouch.sinks.publishers import ros2

    ros2.warm_up(reading, sensor)


def _foxglove(address: OutputAddress, controls: Controls) -> Publisher:
    from manytouch.sinks.publishers.foxglove_live import FoxglovePublisher

    return FoxglovePublisher(address, controls)


def _warm_up_foxglove(reading: Reading, sensor: Sensor) -> None:
    from manytouch.sinks.publishers import foxglove_live

    foxglove_live.warm_up(reading, sensor)


def _osc(address: OutputAddress, _: Controls) -> Publisher:
    return OscPublisher(address, encode_osc)


def _tuio_version(address: OutputAddress) -> str:
    return address.choice("version", ("1.1", "2.0"))


def _tuio(address: OutputAddress, controls: Controls) -> Publisher:
    scale = scale_of(address, controls)
    if _tuio_version(address) == "1.1":
        return OscPublisher(address, Tuio11(scale), TUIO_PORT)
    camera = controls.sensor.camera
    return OscPublisher(address, Tuio20(scale, (camera.width_px, camera.height_px)), TUIO_PORT)


def _midi_notes(address: OutputAddress) -> tuple[int, float]:
    """The lowest note, and the number of notes."""
    low_note = address.number("low-note", 48.0, (0.0, 127.0))
    return round(low_note), address.number("notes", 24.0, (0.0, 127.0))


def _midi(address: OutputAddress, controls: Controls) -> Publisher:
    low_note, notes = _midi_notes(address)
    return MidiPublisher(address, MpeEncoder(scale_of(address, controls), low_note=low_note, notes=notes))


SCHEMES: Mapping[str, Scheme] = {
    "ros2": Scheme(
        example="ros2://manytouch",
        purpose="nodes of ROS 2, which need not be installed here",
        options=("domain", "images", "parent", "pose"),
        check=_check_ros2,
        open_publisher=_ros2,
        warm_up=_warm_up_ros2,
    ),
    "foxglove": Scheme(
        example="foxglove://127.0.0.1:8765",
        purpose="Foxglove and Lichtblick",
        options=("images",),
        check=ImageTurns,
        open_publisher=_foxglove,
        warm_up=_warm_up_foxglove,
    ),
    "tuio": Scheme(
        example="tuio://127.0.0.1:3333",
        purpose="programs for touch screens and interactive tables",
        options=("version", *FULL_SCALES),
        check=lambda address: (_tuio_version(address), full_scales(address)),
        open_publisher=_tuio,
    ),
    "osc": Scheme(
        example="osc://127.0.0.1:9000",
        purpose="Max, Pure Data, SuperCollider, TouchDesigner, own programs",
        options=(),
        check=OutputAddress.required_port,
        open_publisher=_osc,
    ),
    "midi": Scheme(
        example="midi://PORT",
        purpose="synthesizers with MPE; midi://take.mid writes a file",
        options=("low-note", "notes", *FULL_SCALES),
        check=lambda address: (_midi_notes(address), full_scales(address)),
        open_publisher=_midi,
    ),
}


def open_outputs(urls: Sequence[str], controls: Controls) -> list[QueuedOutput]:
    """Open outputs; each has its own queue and thread.

    Args:
        urls: their addresses.
        controls: the session whose readings they get; some outputs send commands to it.

    Raises:
        ManytouchError: an address is wrong.
        OutputError: an output cannot be opened; those before it are closed again.
        MissingExtraError: an output needs a package that is not installed.
    """
    addresses = [_known_address(url) for url in urls]
    opened: list[QueuedOutput] = []
    try:
        opened.extend(_opened(address, controls) for address in addresses)
    except ManytouchError:
        for output in opened:
            output.close()
        raise
    return opened


def warm_up(urls: Sequence[str], reading: Reading, sensor: Sensor) -> None:
    """Make the messages of outputs once, which loads packages and kernels for a second; nothing is sent."""
    for scheme in {parse_address(url).scheme for url in urls}:
        prepare = SCHEMES[scheme].warm_up
        if prepare is not None:
            prepare(reading, sensor)


def check_addresses(urls: Sequence[str]) -> None:
    """Raises ManytouchError if the address of an output is wrong; opens nothing."""
    for url in urls:
        _known_address(url)


def _known_address(url: str) -> OutputAddress:
    address = parse_address(url)
    scheme = SCHEMES.get(address.scheme)
    if scheme is None:
        known = ", ".join(each.example for each in SCHEMES.values())
        raise ManytouchError(
            f"{address.text!r}: there is no output {address.scheme}://; choose one like {known}"
        )
    address.refuse_options_except(*scheme.options)
    if scheme.check is not None:
        scheme.check(address)
    return address


def _opened(address: OutputAddress, controls: Controls) -> QueuedOutput:
    open_publisher = SCHEMES[address.scheme].open_publisher
    try:
        return QueuedOutput(address.text, lambda: open_publisher(address, controls))
    except ManytouchError:
        raise
    except OSError as error:
        raise OutputError(f"{address.text!r} cannot be opened: {error.strerror or error}") from error
    except Exception as error:
        raise OutputError(
            f"{address.text!r} cannot be opened: internal error: {type(error).__name__}: {error}; please "
            "report it"
        ) from error
