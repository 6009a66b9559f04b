"""Calibration: from frames or boards to a `Sensor`; each module reports how well it is known."""

from manytouch.calibration.rest.assumed_sensor import sensor_from_rest
from manytouch.calibration.rest.layout_report import LayoutReport, examine
from manytouch.calibration.rest.register_rest import register_rest

__all__ = ["LayoutReport", "examine", "register_rest", "sensor_from_rest"]
