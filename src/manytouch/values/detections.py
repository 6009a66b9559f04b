"""Dots of one frame."""

from dataclasses import dataclass

from manytouch.values.arrays import Covariances2, Points2, Scalars, reduced
from manytouch.values.display.text import count_of
from manytouch.values.status import Status


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Detections:
    """Dots found in one frame, in no particular order.

    Attributes:
        centre_px: (n, 2) x, y in the image as the camera gave it, whole-image coordinates.
        covariance_px2: (n, 2, 2) of the centres.
        area_px2: (n,) area of the dot in the image.
        contrast: (n,) grey level of the dot minus that of its background, of 255; positive for the sensor's
            polarity.
        status: `OK`, or what is wrong with the whole image: decode_error, wrong_size, dark, saturated,
            blurred.
        is_predicted: of the frame.
    """

    centre_px: Points2
    covariance_px2: Covariances2
    area_px2: Scalars
    contrast: Scalars
    status: Status = Status.OK
    is_predicted: bool = False

    __reduce__ = reduced

    def __repr__(self) -> str:
        return f"Detections({count_of(len(self.centre_px), 'dot')}, {self.status})"
