"""Messages that a browser may send, and nothing else."""

import json

import numpy as np
import pytest

from manytouch.sinks.viewer.client_messages import (
    MAX_CHARACTERS,
    Ack,
    MeasureRequest,
    SessionRequest,
    ShowRequest,
    parse_client_message,
)
from manytouch.values import (
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
    UseMethod,
)


@pytest.mark.parametrize(
    ("message", "command"),
    [
        ({"type": "start"}, Resume()),
        ({"type": "stop"}, Pause()),
        ({"type": "tare"}, Tare()),
        ({"type": "record"}, Record(path=None)),
        ({"type": "stop_recording"}, StopRecording()),
        ({"type": "method", "method": "paper"}, UseMethod(method="paper")),
        (
            {"type": "tune", "parameter": "detect.share", "value": 0.5},
            Tune(parameter="detect.share", value=0.5),
        ),
        (
            {"type": "press", "finger": 3, "x_mm": 1.5, "y_mm": -2, "depth_mm": 2},
            Press(finger=3, x_mm=1.5, y_mm=-2.0, depth_mm=2.0),
        ),
        ({"type": "release", "finger": 3}, Release(finger=3)),
        ({"type": "seek", "frame": 120}, Seek(frame=120)),
        ({"type": "play", "speed": 0.5}, Play(speed=0.5)),
    ],
)
def test_session_requests_become_commands(message: dict[str, object], command: object) -> None:
    found = parse_client_message(json.dumps(message))
    assert isinstance(found, SessionRequest)
    assert found.command() == command


def test_requests_of_one_client_only() -> None:
    points = parse_client_message('{"type": "measure", "point_mm": [[1, 2], [3.5, -4]]}')
    assert isinstance(points, MeasureRequest)
    np.testing.assert_array_equal(points.points(), [[1.0, 2.0], [3.5, -4.0]])
    nothing = parse_client_message('{"type": "measure", "point_mm": []}')
    assert isinstance(nothing, MeasureRequest)
    assert nothing.points().shape == (0, 2)
    assert parse_client_message('{"type": "show", "layer": "strain", "image": false}') == ShowRequest(
        type="show", layer="strain", image=False
    )
    assert parse_client_message('{"type": "ack", "number": 7}') == Ack(type="ack", number=7)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "tare",
        "[]",
        '{"type": "shell", "command": "ls"}',
        '{"type": "record", "path": "/etc/passwd"}',
        '{"type": "method", "method": "../../paper"}',
        '{"type": "tune", "parameter": "detect.share", "value": NaN}',
        '{"type": "tune", "parameter": "detect.share", "value": "1"}',
        '{"type": "press", "finger": -1, "x_mm": 0, "y_mm": 0, "depth_mm": 1}',
        '{"type": "press", "finger": 1, "x_mm": 1e9, "y_mm": 0, "depth_mm": 1}',
        '{"type": "measure", "point_mm": [[1, 2], [3, 4], [5, 6]]}',
        '{"type": "measure", "point_mm": [[1, 2, 3]]}',
        '{"type": "show", "layer": "secrets", "image": true}',
        '{"type": "seek", "frame": -1}',
        '{"type": "tare", "padding": "' + MAX_CHARACTERS * " " + '"}',
    ],
)
def test_other_messages_are_invalid(text: str) -> None:
    assert parse_client_message(text) is None
