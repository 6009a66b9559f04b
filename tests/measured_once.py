"""Layouts of recordings that begin with the same pictures are measured once, for tests of what follows."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from hashlib import blake2b
from importlib import import_module
from typing import Any
from unittest import mock

from manytouch.calibration import sensor_from_rest
from manytouch.values import Frame, Sensor

_MEASURED: dict[object, Sensor] = {}


def _measured(frames: Sequence[Frame], **options: Any) -> Sensor:
    """As `sensor_from_rest`; a sensor is a value, so that tests can share it."""
    given = sorted((name, repr(value)) for name, value in options.items() if name != "spread")
    key = (*given, *((frame.index, _digest(frame)) for frame in frames))
    if key in _MEASURED:
        return _MEASURED[key]
    found = sensor_from_rest(frames, **options)
    if not (found.layout and found.layout.is_before_scene):  # else frames of the whole recording were used
        _MEASURED[key] = found
    return found


def _digest(frame: Frame) -> object:
    image = frame.image
    return None if image is None else (image.shape, image.dtype.str, blake2b(image.tobytes()).digest())


@contextmanager
def layouts_measured_once() -> Iterator[None]:
    """While it lasts, `prepare` measures layouts once."""
    module = import_module("manytouch.session.sensors.determine_sensor")
    with mock.patch.object(module, "sensor_from_rest", _measured):
        yield
