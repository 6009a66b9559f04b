"""Calibration: from frames or boards to a `Sensor`; each module reports how well it is known."""

from manytouch.calibration.rest import sensor_from_rest

__all__ = ["sensor_from_rest"]
