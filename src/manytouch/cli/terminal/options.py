"""Options that several commands share, and their conversion to values."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter, Token, validators

from manytouch.cli.terminal.failures import usage_error
from manytouch.errors import without_password
from manytouch.limits import HIGHEST_FPS, LARGEST_NUMBER, LEAST_HFOV_DEG, MOST_HFOV_DEG
from manytouch.source_names import is_camera, views_of

Method = Literal["mechanics", "perimeter", "paper"]


def _numbers(tokens: Sequence[Token], counts: tuple[int, ...], form: str) -> list[float]:
    text = tokens[0].value
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"expected {form}, found {text!r}") from None
    if len(found) not in counts or not all(map(math.isfinite, found)):
        raise ValueError(f"expected {form}, found {text!r}")
    return found


def _pitch(_: Any, tokens: Sequence[Token]) -> float | tuple[float, float]:
    found = _numbers(tokens, (1, 2), "a length or X,Y in mm")
    least = 1.0 / LARGEST_NUMBER
    if not (min(found) >= least and max(found) <= LARGEST_NUMBER):
        raise ValueError(
            f"expected a pitch from {least:g} to {LARGEST_NUMBER:g} mm, found {tokens[0].value!r}"
        )
    return found[0] if len(found) == 1 else (found[0], found[1])


def _between(what: str, least: float, most: float) -> Any:
    """A converter for numbers in a range."""

    def convert(_: Any, tokens: Sequence[Token]) -> float:
        (value,) = _numbers(tokens, (1,), what)
        if not least <= value <= most:
            raise ValueError(f"expected {what} from {least:g} to {most:g}, found {tokens[0].value!r}")
        return value

    return convert


def numbers(count: int, form: str) -> Any:
    """A converter for positive numbers separated by commas."""

    def convert(_: Any, tokens: Sequence[Token]) -> tuple[float, ...]:
        found = _numbers(tokens, (count,), form)
        if min(found) <= 0:
            raise ValueError(f"expected {form} above 0, found {tokens[0].value!r}")
        return tuple(found)

    return convert


def as_typed(default: Sequence[float]) -> str:
    """Default numbers in the form in which they are typed: 100,60."""
    return ",".join(f"{value:g}" for value in default)


def pair(form: str) -> Any:
    """A converter for two positive numbers."""
    return numbers(2, form)


def _roi(_: Any, tokens: Sequence[Token]) -> Any:
    found = _numbers(tokens, (4,), "X,Y,W,H in whole px")
    if any(value != int(value) for value in found):
        raise ValueError("expected X,Y,W,H in whole px")
    from manytouch.errors import SourceError
    from manytouch.values import Roi

    try:
        return Roi(*map(int, found))
    except SourceError as error:
        raise ValueError(str(error)) from None


def _frames(_: Any, tokens: Sequence[Token]) -> tuple[int, ...]:
    words = tokens[0].value.split(",")
    if not all(word.strip().isdecimal() for word in words):
        raise ValueError(f"expected frame numbers N,N,... from 0, found {tokens[0].value}")
    return tuple(int(word) for word in words)


def _size(_: Any, tokens: Sequence[Token]) -> tuple[int, int]:
    words = tokens[0].value.lower().split("x")
    if len(words) != 2 or not all(word.isdecimal() and int(word) > 0 for word in words):
        raise ValueError(f"expected WIDTHxHEIGHT in px such as 2560x1440, found {tokens[0].value!r}")
    return int(words[0]), int(words[1])


def _amount(_: Any, tokens: Sequence[Token]) -> float | str:
    text = tokens[0].value
    if text == "auto":
        return text
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"expected a number or auto, found {text!r}") from None
    if not 0 <= value < math.inf:
        raise ValueError(f"expected a number from 0, or auto, found {text}")
    return value


def _camera_option(name: str, metavar: str, words: str, converter: Any = _amount) -> Parameter:
    """An option that requests a setting of a camera."""
    return Parameter(name=name, metavar=metavar, converter=converter, n_tokens=1, group="Camera", help=words)


def _is_token(_: Any, value: str | None) -> None:
    if value is not None and not re.fullmatch(r"[A-Za-z0-9_~.-]{8,200}", value):
        raise ValueError("a token has 8 to 200 characters: letters, digits, and . - _ ~")


def refuse_two_scales(verb: str, sensor: str | None, pitch_mm: object, hfov_deg: object) -> None:
    """Refuse --pitch-mm and --hfov-deg together with a sensor file.

    Raises:
        CycloptsError: both are given.
    """
    if sensor is not None and (pitch_mm is not None or hfov_deg is not None):
        raise usage_error(
            verb,
            "--pitch-mm and --hfov-deg are for inputs without a sensor file: omit them, or the file; "
            "manytouch calibrate rest adds [markers] to a file that has a [camera] only",
        )


def given_options(options: Mapping[str, object]) -> list[str]:
    """The names of those options that were given."""
    return [
        name for name, value in options.items() if not (value is None or value is False or value in ((), {}))
    ]


def refuse_camera_options(verb: str, source: str, camera_options: Mapping[str, object]) -> None:
    """Refuse options of a camera with a source that is none, such as a file or a stream.

    Raises:
        CycloptsError: one is given.
    """
    given = given_options(camera_options)
    if given and not any(is_camera(part) and "://" not in part for part in views_of(source)):
        raise usage_error(
            verb,
            f"{', '.join(given)} can be requested of a camera of this computer only, not of "
            f"{without_password(source)}: omit {'it' if len(given) == 1 else 'them'}",
        )


def refuse_unused_viewer(
    verb: str, no_view: bool, *, host: str, port: int, token: str | None, max_clients: int
) -> None:
    """Refuse options of the viewer with --no-view.

    Raises:
        CycloptsError: one is given.
    """
    is_given = {
        "--host": host != HOST,
        "--port": port != 0,
        "--token": token is not None,
        "--max-clients": max_clients != MAX_CLIENTS,
    }
    given = given_options(is_given)
    if no_view and given:
        be, them = ("is", "it") if len(given) == 1 else ("are", "them")
        raise usage_error(
            verb,
            f"{', '.join(given)} {be} for the viewer, which --no-view omits: omit {them}, or --no-view",
        )


def positive(what: str) -> Any:
    """A converter for positive numbers."""

    def convert(_: Any, tokens: Sequence[Token]) -> float:
        (value,) = _numbers(tokens, (1,), what)
        if not value > 0:
            raise ValueError(f"expected {what} above 0, found {tokens[0].value}")
        return value

    return convert


def switch(words: str) -> Parameter:
    """An option without a value."""
    return Parameter(negative=(), show_default=False, help=words)


def folder(words: str) -> Parameter:
    """An option with a folder as value."""
    return Parameter(negative=(), metavar="DIR", help=words)


def _is_recording(_: Any, path: Path | None) -> None:
    if path is not None and path.suffix.lower() != ".mcap":
        raise ValueError("expected the name of a recording, which ends in .mcap")


SOURCE_WORDS = (
    "Camera (0, /dev/video2), stream URL, video, image, folder of images, recording (.mcap), or sim:."
)
OutputUrls = Annotated[
    tuple[str, ...],
    Parameter(
        name="--to",
        negative=(),
        metavar="URL",
        show_default=False,
        help="Also send the readings to another program: ros2://, foxglove://, tuio://, osc://, midi://; "
        "may be repeated.",
    ),
]
WithSurface = Annotated[bool, switch("Also write depth maps, surface.zarr.")]
Annotate = Annotated[bool, switch("Also write images with markers and contacts drawn in.")]
NoView = Annotated[bool, switch("Do not start the viewer.")]
HOST, MAX_CLIENTS = "127.0.0.1", 16
"""Defaults of the viewer's options, equal to those of `Viewer`, whose import takes long."""
Host = Annotated[
    str,
    Parameter(
        name="--host",
        metavar="ADDRESS",
        help="Address that the viewer listens on. Others than the own machine require an access token.",
    ),
]
Port = Annotated[
    int,
    Parameter(
        name="--port",
        validator=validators.Number(gte=0, lte=65535),
        help="Port of the viewer. [default: any free port]",
        show_default=False,
    ),
]
ViewToken = Annotated[
    str | None,
    Parameter(
        name="--token",
        validator=_is_token,
        help="Access token of the viewer. [default: generated if other machines can reach the viewer]",
    ),
]
MaxClients = Annotated[
    int,
    Parameter(
        name="--max-clients",
        validator=validators.Number(gte=1, lte=256),
        help="Clients that the viewer serves at once; more are refused.",
    ),
]
SensorFile = Annotated[
    str | None,
    Parameter(
        name="--sensor",
        metavar="FILE",
        help="Sensor file of this camera and sheet. Without it the layout is found in the first frames.",
    ),
]
MethodName = Annotated[
    Method | None,
    Parameter(
        name="--method",
        help="Estimation method. [default: mechanics; perimeter if the sensor file has no sheet]",
        show_default=False,
    ),
]
PitchMm = Annotated[
    Any,
    Parameter(
        name="--pitch-mm",
        metavar="P|X,Y",
        converter=_pitch,
        n_tokens=1,
        allow_leading_hyphen=True,
        help="Distance between neighbouring markers in mm. Without it lengths are in pitches.",
    ),
]
HfovDeg = Annotated[
    Any,
    Parameter(
        name="--hfov-deg",
        metavar="A",
        converter=_between("an angle in degrees", LEAST_HFOV_DEG, MOST_HFOV_DEG),
        n_tokens=1,
        help="Horizontal field of view of the camera. Without it 60 degrees is assumed.",
    ),
]
RoiPx = Annotated[
    Any,
    Parameter(
        name="--roi",
        metavar="X,Y,W,H",
        converter=_roi,
        n_tokens=1,
        allow_leading_hyphen=True,
        help="Region of interest: process only this part of the image, px.",
    ),
]
PictureFrames = Annotated[
    Any,
    Parameter(
        name="--picture",
        metavar="N,N,...",
        converter=_frames,
        n_tokens=1,
        help="Also draw the surface in 3-D for these frames, counted from 0.",
    ),
]
Fps = Annotated[
    Any,
    Parameter(
        name="--fps",
        metavar="F",
        converter=_between("a number of frames per second", 1.0 / HIGHEST_FPS, HIGHEST_FPS),
        n_tokens=1,
        help="Override the frame rate, frames per second.",
    ),
]
Size = Annotated[Any, _camera_option("--size", "WxH", "Image size of the camera, px.", _size)]
ExposureMs = Annotated[Any, _camera_option("--exposure-ms", "T|auto", "Exposure time of the camera.")]
Gain = Annotated[Any, _camera_option("--gain", "G", "Gain, in the unit of the camera.", positive("a gain"))]
Focus = Annotated[Any, _camera_option("--focus", "F|auto", "Focus, in the unit of the camera.")]
WhiteBalanceK = Annotated[
    Any, _camera_option("--white-balance-K", "T|auto", "White balance, as colour temperature.")
]
NoMjpg = Annotated[
    bool,
    Parameter(
        name="--no-mjpg",
        negative=(),
        show_default=False,
        group="Camera",
        help="Do not request Motion JPEG; the frame rate of large images over USB is then low.",
    ),
]
RecordFile = Annotated[
    Path | None,
    Parameter(
        name="--record",
        negative=(),
        metavar="FILE.mcap",
        validator=_is_recording,
        help="Record the frames as they arrive, and the readings, for playback or Foxglove.",
    ),
]
