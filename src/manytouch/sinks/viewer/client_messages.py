"""What a browser may ask for: a closed list, checked key by key, without paths or names of files."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from manytouch.values import (
    Command,
    Play,
    Press,
    Record,
    Release,
    Seek,
    Start,
    Stop,
    StopRecording,
    Tare,
    Tune,
    UseMethod,
)
from manytouch.values.arrays import Points2, read_only

LONGEST_WISH = 4096  # characters

Length = Annotated[float, Field(ge=-1e4, le=1e4, allow_inf_nan=False)]
Word = Annotated[str, Field(max_length=60, pattern=r"^[A-Za-z0-9_.]+$")]


class _Wish(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Plain(_Wish):
    """A wish without particulars."""

    wish: Literal["start", "stop", "tare", "record", "stop_recording"]

    def command(self) -> Command:
        match self.wish:
            case "start":
                return Start()
            case "stop":
                return Stop()
            case "tare":
                return Tare()
            case "record":
                return Record(path=None)
            case "stop_recording":
                return StopRecording()


class Method(_Wish):
    """Read with another method."""

    wish: Literal["method"]
    method: Word

    def command(self) -> Command:
        return UseMethod(method=self.method)


class Threshold(_Wish):
    """Set a number of the pipeline."""

    wish: Literal["tune"]
    parameter: Word
    value: Annotated[float, Field(allow_inf_nan=False)]

    def command(self) -> Command:
        return Tune(parameter=self.parameter, value=self.value)


class Finger(_Wish):
    """Put a finger on the simulated sheet, or move it."""

    wish: Literal["press"]
    finger: Annotated[int, Field(ge=0, le=999)]
    x_mm: Length
    y_mm: Length
    depth_mm: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]

    def command(self) -> Command:
        return Press(finger=self.finger, x_mm=self.x_mm, y_mm=self.y_mm, depth_mm=self.depth_mm)


class Lift(_Wish):
    """Take a finger off."""

    wish: Literal["release"]
    finger: Annotated[int, Field(ge=0, le=999)]

    def command(self) -> Command:
        return Release(finger=self.finger)


class Moment(_Wish):
    """Go to a frame of a recording."""

    wish: Literal["seek"]
    frame: Annotated[int, Field(ge=0, le=2**40)]

    def command(self) -> Command:
        return Seek(frame=self.frame)


class Pace(_Wish):
    """Play a recording at a pace."""

    wish: Literal["play"]
    speed: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]

    def command(self) -> Command:
        return Play(speed=self.speed)


class Points(_Wish):
    """Measure at no, one or two points; of this browser alone."""

    wish: Literal["measure"]
    point_mm: Annotated[list[Annotated[list[Length], Field(min_length=2, max_length=2)]], Field(max_length=2)]

    def points(self) -> Points2:
        return read_only(np.array(self.point_mm, dtype=np.float64).reshape(-1, 2))


class Show(_Wish):
    """What this browser shows, so that nothing else is sent."""

    wish: Literal["show"]
    layer: Literal["depth", "strain", "pressure", "difference"]
    image: bool


class Ack(_Wish):
    """The browser has taken in update `number`."""

    wish: Literal["taken"]
    number: Annotated[int, Field(ge=0)]


Order = Plain | Method | Threshold | Finger | Lift | Moment | Pace
Wish = Order | Points | Show | Ack

_WISH: TypeAdapter[Wish] = TypeAdapter(Annotated[Wish, Field(discriminator="wish")])


def read_wish(text: str) -> Wish | None:
    """The wish in a browser's message; None of anything else."""
    if len(text) > LONGEST_WISH:
        return None
    try:
        return _WISH.validate_json(text)
    except ValidationError:
        return None
