"""Detection: from an image to its dots, with sub-pixel centres and covariances, for any dotted sheet.

`survey` determines the appearance of the dots of an unknown recording, and `DotSearch` finds the dots of a
known sensor frame by frame, in the whole image or in windows. Which marker a dot belongs to is determined by
`tracking`.
"""

from manytouch.detection.appearance.survey import Survey, survey
from manytouch.detection.dot_appearance import Appearance, expected_appearance
from manytouch.detection.measurement.centroid import MeasuredDots, measure
from manytouch.detection.noise import estimate_noise
from manytouch.detection.search import DotSearch

__all__ = [
    "Appearance",
    "DotSearch",
    "MeasuredDots",
    "Survey",
    "estimate_noise",
    "expected_appearance",
    "measure",
    "survey",
]
