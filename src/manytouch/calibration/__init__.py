"""Calibration of camera, rest state and sheet: from frames, views of a board or presses to a `Sensor` with
deviations.

Inside are the camera (`camera`), pose, layout and noise of the untouched sheet (`rest`), its outline in
the image (`outline`) and the mechanics of the sheet (`sheet`). `sensor_at_rest` is what `manytouch calibrate
rest` runs: it chooses frames of a recording for `rest`, which selects those at rest, or, of several cameras
on one sheet, for `views`. Reading results of a calibrated sensor is not inside: that is estimation.
"""

from manytouch.calibration.rest.assumed_sensor import sensor_from_rest
from manytouch.calibration.rest.layout_report import LayoutReport, examine
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.rest.whole_recording import rest_of_recording

__all__ = ["LayoutReport", "examine", "register_rest", "rest_of_recording", "sensor_from_rest"]
