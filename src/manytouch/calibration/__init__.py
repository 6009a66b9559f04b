"""Calibration: from frames or boards to a `Sensor`; each module reports how well it is known."""

from manytouch.calibration.examination import LayoutReport, examine
from manytouch.calibration.reference import refer
from manytouch.calibration.rest import sensor_from_rest

__all__ = ["LayoutReport", "examine", "refer", "sensor_from_rest"]
