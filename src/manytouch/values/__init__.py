"""Immutable values that the stages, sources, sinks and sessions exchange, and the sensor file.

No algorithm is in here: what computes a value from another one is in the packages above.
"""

from manytouch.values.commands import (
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
from manytouch.values.contacts import ESTIMATES, Contact, Contacts, ContactShape, OutlineRing, Phase
from manytouch.values.detections import Detections
from manytouch.values.frame import Frame
from manytouch.values.grid import TrackedGrid
from manytouch.values.health import Health, OutputState, ParameterInfo, Setting
from manytouch.values.images.roi import Roi
from manytouch.values.reading import Comparison, Reading, Truth
from manytouch.values.sensor import Camera, Layout, LengthUnit, Polarity, Sensor, Sheet, View
from manytouch.values.status import Status
from manytouch.values.surface import Interpolation, SheetSpline, Surface

__all__ = [
    "ESTIMATES",
    "Camera",
    "Command",
    "Comparison",
    "Contact",
    "ContactShape",
    "Contacts",
    "Detections",
    "Frame",
    "Health",
    "Interpolation",
    "Layout",
    "LengthUnit",
    "OutlineRing",
    "OutputState",
    "ParameterInfo",
    "Pause",
    "Phase",
    "Play",
    "Polarity",
    "Press",
    "Reading",
    "Record",
    "Release",
    "Resume",
    "Roi",
    "Seek",
    "Sensor",
    "Setting",
    "Sheet",
    "SheetSpline",
    "Status",
    "StopRecording",
    "Surface",
    "Tare",
    "TrackedGrid",
    "Truth",
    "Tune",
    "UndoTare",
    "UseMethod",
    "View",
]
