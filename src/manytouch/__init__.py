"""manytouch: where, how deep and how hard a dotted soft sheet is touched, for every contact at once.

Importing this package imports nothing heavy; names are loaded when they are first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "Camera": "manytouch.values",
    "Contact": "manytouch.values",
    "Contacts": "manytouch.values",
    "Detections": "manytouch.values",
    "Frame": "manytouch.values",
    "Layout": "manytouch.values",
    "ManytouchError": "manytouch.errors",
    "Phase": "manytouch.values",
    "Pipeline": "manytouch.pipeline",
    "Reading": "manytouch.values",
    "Sensor": "manytouch.values",
    "Sheet": "manytouch.values",
    "Surface": "manytouch.values",
    "TrackedGrid": "manytouch.values",
    "Truth": "manytouch.values",
    "load_sensor": "manytouch.values.sensor_file",
    "open_source": "manytouch.sources",
    "pipeline_for": "manytouch.session",
    "process": "manytouch.session",
    "sample": "manytouch.geometry.surface_sampling",
    "save_sensor": "manytouch.values.sensor_file",
    "sensor_from_rest": "manytouch.calibration.rest.assumed_sensor",
}

__all__ = [
    "Camera",
    "Contact",
    "Contacts",
    "Detections",
    "Frame",
    "Layout",
    "ManytouchError",
    "Phase",
    "Pipeline",
    "Reading",
    "Sensor",
    "Sheet",
    "Surface",
    "TrackedGrid",
    "Truth",
    "__version__",
    "load_sensor",
    "open_source",
    "pipeline_for",
    "process",
    "sample",
    "save_sensor",
    "sensor_from_rest",
]

if TYPE_CHECKING:
    from manytouch.calibration.rest.assumed_sensor import sensor_from_rest
    from manytouch.errors import ManytouchError
    from manytouch.geometry.surface_sampling import sample
    from manytouch.pipeline import Pipeline
    from manytouch.session import pipeline_for, process
    from manytouch.sources import open_source
    from manytouch.values import (
        Camera,
        Contact,
        Contacts,
        Detections,
        Frame,
        Layout,
        Phase,
        Reading,
        Sensor,
        Sheet,
        Surface,
        TrackedGrid,
        Truth,
    )
    from manytouch.values.sensor_file import load_sensor, save_sensor


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'manytouch' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
