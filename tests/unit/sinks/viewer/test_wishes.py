"""What a browser may ask for, and nothing else."""

import json

import numpy as np
import pytest

from manytouch.sinks.viewer.client_messages import LONGEST_WISH, Ack, Order, Points, Show, read_wish
from manytouch.values import (
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


@pytest.mark.parametrize(
    ("wish", "command"),
    [
        ({"wish": "start"}, Start()),
        ({"wish": "stop"}, Stop()),
        ({"wish": "tare"}, Tare()),
        ({"wish": "record"}, Record(path=None)),
        ({"wish": "stop_recording"}, StopRecording()),
        ({"wish": "method", "method": "paper"}, UseMethod(method="paper")),
        (
            {"wish": "tune", "parameter": "detect.share", "value": 0.5},
            Tune(parameter="detect.share", value=0.5),
        ),
        (
            {"wish": "press", "finger": 3, "x_mm": 1.5, "y_mm": -2, "depth_mm": 2},
            Press(finger=3, x_mm=1.5, y_mm=-2.0, depth_mm=2.0),
        ),
        ({"wish": "release", "finger": 3}, Release(finger=3)),
        ({"wish": "seek", "frame": 120}, Seek(frame=120)),
        ({"wish": "play", "speed": 0.5}, Play(speed=0.5)),
    ],
)
def test_orders_become_commands(wish: dict[str, object], command: object) -> None:
    found = read_wish(json.dumps(wish))
    assert isinstance(found, Order)
    assert found.command() == command


def test_what_concerns_one_browser_alone() -> None:
    points = read_wish('{"wish": "measure", "point_mm": [[1, 2], [3.5, -4]]}')
    assert isinstance(points, Points)
    np.testing.assert_array_equal(points.points(), [[1.0, 2.0], [3.5, -4.0]])
    nothing = read_wish('{"wish": "measure", "point_mm": []}')
    assert isinstance(nothing, Points)
    assert nothing.points().shape == (0, 2)
    assert read_wish('{"wish": "show", "layer": "strain", "image": false}') == Show(
        wish="show", layer="strain", image=False
    )
    assert read_wish('{"wish": "taken", "number": 7}') == Ack(wish="taken", number=7)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "tare",
        "[]",
        '{"wish": "shell", "command": "ls"}',
        '{"wish": "record", "path": "/etc/passwd"}',
        '{"wish": "method", "method": "../../paper"}',
        '{"wish": "tune", "parameter": "detect.share", "value": NaN}',
        '{"wish": "tune", "parameter": "detect.share", "value": "1"}',
        '{"wish": "press", "finger": -1, "x_mm": 0, "y_mm": 0, "depth_mm": 1}',
        '{"wish": "press", "finger": 1, "x_mm": 1e9, "y_mm": 0, "depth_mm": 1}',
        '{"wish": "measure", "point_mm": [[1, 2], [3, 4], [5, 6]]}',
        '{"wish": "measure", "point_mm": [[1, 2, 3]]}',
        '{"wish": "show", "layer": "secrets", "image": true}',
        '{"wish": "seek", "frame": -1}',
        '{"wish": "tare", "padding": "' + LONGEST_WISH * " " + '"}',
    ],
)
def test_anything_else_is_nothing(text: str) -> None:
    assert read_wish(text) is None
