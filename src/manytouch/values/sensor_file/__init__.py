"""The sensor file (TOML): read with all its mistakes reported at once, and written.

Nothing of the file format is used elsewhere, except that scene files share the checks in `sections`.
"""

from manytouch.values.sensor_file.read import known_sensors, load_sensor
from manytouch.values.sensor_file.write import save_sensor

__all__ = ["known_sensors", "load_sensor", "save_sensor"]
