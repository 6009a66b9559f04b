"""What was assumed of a sensor, as far as it decides how contacts are found."""

from manytouch.values import Sensor


def view_is_assumed(sensor: Sensor) -> bool:
    """Whether the field of view of the camera was assumed, so that distances and slopes are poorly known."""
    return any("field of view" in sentence for sentence in sensor.assumptions)


def is_uncalibrated(sensor: Sensor) -> bool:
    """Whether the field of view or the sheet was assumed."""
    return view_is_assumed(sensor) or sensor.sheet is None or sensor.sheet.is_assumed
