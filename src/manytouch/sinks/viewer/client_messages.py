"""Messages that a browser may send: a closed list, validated field by field, without paths or file names."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from manytouch.values import (
    Command,
    Pause,
    Play,
    Press,
    Record,
    Release,
    Resume,
    Seek,
    StopRecording,
    Tare,
    Tune,
    UndoTare,
    UseMethod,
)
from manytouch.values.arrays import Points2, read_only

MAX_CHARACTERS = 4096

Length = Annotated[float, Field(ge=-1e4, le=1e4, allow_inf_nan=False)]
Identifier = Annotated[str, Field(max_length=60, pattern=r"^[A-Za-z0-9_.]+$")]

Word = Annotated[str, Field(max_length=60, pattern=r"^[a-z][a-z_]*$")]


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class SimpleRequest(_Message):
    """A command without parameters."""

    type: Literal["start", "stop", "tare", "untare", "record", "stop_recording"]

    def command(self) -> Command:
        match self.type:
            case "start":
                return Resume()
            case "stop":
                return Pause()
            case "tare":
                return Tare()
            case "untare":
                return UndoTare()
            case "record":
                return Record(path=None)
            case "stop_recording":
                return StopRecording()


class MethodRequest(_Message):
    """Use another method."""

    type: Literal["method"]
    method: Identifier

    def command(self) -> Command:
        return UseMethod(method=self.method)


class ParameterRequest(_Message):
    """Set a parameter of the pipeline; null: automatic."""

    type: Literal["tune"]
    parameter: Identifier
    value: Annotated[float, Field(allow_inf_nan=False)] | Word | None

    def command(self) -> Command:
        return Tune(parameter=self.parameter, value=self.value)


class PressRequest(_Message):
    """Put a finger on the simulated sheet, or move it."""

    type: Literal["press"]
    finger: Annotated[int, Field(ge=0, le=999)]
    x_mm: Length
    y_mm: Length
    depth_mm: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]

    def command(self) -> Command:
        return Press(finger=self.finger, x_mm=self.x_mm, y_mm=self.y_mm, depth_mm=self.depth_mm)


class ReleaseRequest(_Message):
    """Lift a finger."""

    type: Literal["release"]
    finger: Annotated[int, Field(ge=0, le=999)]

    def command(self) -> Command:
        return Release(finger=self.finger)


class SeekRequest(_Message):
    """Go to a frame of a recording."""

    type: Literal["seek"]
    frame: Annotated[int, Field(ge=0, le=2**40)]

    def command(self) -> Command:
        return Seek(frame=self.frame)


class SpeedRequest(_Message):
    """Play back a recording at a multiple of its own speed."""

    type: Literal["play"]
    speed: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]

    def command(self) -> Command:
        return Play(speed=self.speed)


class MeasureRequest(_Message):
    """Measure at no, one or two points, for this client only."""

    type: Literal["measure"]
    point_mm: Annotated[list[Annotated[list[Length], Field(min_length=2, max_length=2)]], Field(max_length=2)]

    def points(self) -> Points2:
        """(n, 2) the points."""
        return read_only(np.array(self.point_mm, dtype=np.float64).reshape(-1, 2))


class ShowRequest(_Message):
    """What this client displays, so that nothing else is sent to it."""

    type: Literal["show"]
    layer: Literal["depth", "strain", "pressure", "difference"]
    image: bool


class Ack(_Message):
    """The client has received update `number`."""

    type: Literal["ack"]
    number: Annotated[int, Field(ge=0)]


SessionRequest = (
    SimpleRequest
    | MethodRequest
    | ParameterRequest
    | PressRequest
    | ReleaseRequest
    | SeekRequest
    | SpeedRequest
)
"""Requests that become a command of the session."""

ClientMessage = SessionRequest | MeasureRequest | ShowRequest | Ack

_ADAPTER: TypeAdapter[ClientMessage] = TypeAdapter(Annotated[ClientMessage, Field(discriminator="type")])


def parse_client_message(text: str) -> ClientMessage | None:
    """Parse the message of a browser; None if it is not valid."""
    if len(text) > MAX_CHARACTERS:
        return None
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError:
        return None
