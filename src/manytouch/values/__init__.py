"""The nouns of manytouch: immutable values without algorithms, one per arrow of the pipeline."""

from manytouch.values.contacts import ESTIMATES, Contact, Contacts, Phase
from manytouch.values.detections import Detections
from manytouch.values.frame import Frame
from manytouch.values.grid import TrackedGrid
from manytouch.values.reading import Reading, Truth
from manytouch.values.sensor import Camera, Layout, LengthUnit, Polarity, Sensor, Sheet
from manytouch.values.surface import Surface

__all__ = [
    "ESTIMATES",
    "Camera",
    "Contact",
    "Contacts",
    "Detections",
    "Frame",
    "Layout",
    "LengthUnit",
    "Phase",
    "Polarity",
    "Reading",
    "Sensor",
    "Sheet",
    "Surface",
    "TrackedGrid",
    "Truth",
]
