"""From a picture to its dots, for any dotted sheet and without a setting.

`survey` looks at the first frames of an unknown recording and says how its dots look (`Appearance`).
A `Sensor` holds the same knowledge once it is known; `DotSearch` then finds the dots of each frame,
everywhere or in windows around expected places. Both measure each dot in the same way (`measure`):
flattened, with a covariance that agrees with the error.
"""

from manytouch.detection.appearance.dot_appearance import Appearance, appearance_of
from manytouch.detection.appearance.survey import Survey, survey
from manytouch.detection.measurement.centroid import Dots, measure
from manytouch.detection.noise import noise_of
from manytouch.detection.search import DotSearch

__all__ = ["Appearance", "DotSearch", "Dots", "Survey", "appearance_of", "measure", "noise_of", "survey"]
