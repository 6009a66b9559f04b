"""The sensor that the methods are given for a case of any group."""

from manytouch.evaluation.suite.cases import Case
from manytouch.evaluation.suite.sensors import exact_sensor, nominal_sensor, true_sensor, with_all_dots
from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.evaluation.suite.varied.sensor_files import drawn_sensor
from manytouch.values import Sensor


def given_sensor(case: Case) -> Sensor:
    """With the errors that the group of the case stands for."""
    if not isinstance(case, VariedCase):
        return nominal_sensor(case)
    true = with_all_dots(true_sensor(case))
    return drawn_sensor(case, true) if case.group == "drawn" else exact_sensor(true)
