"""Refuses sensors and regions that do not fit a source, before its frames are read."""

from manytouch.errors import SensorError
from manytouch.sources import Source
from manytouch.values import Roi, Sensor


def require_region(source: Source, text: str, roi_px: Roi | None) -> None:
    """Check that a region is inside the images of a source.

    Args:
        source: its size is not checked where it does not state one.
        text: the source in messages.
        roi_px: x, y, width, height of the region; None is always right.

    Raises:
        SourceError: it is not inside.
    """
    if roi_px is not None and source.width_px is not None and source.height_px is not None:
        roi_px.require_inside(source.width_px, source.height_px, text)


def require_views(source: Source, text: str, given: Sensor | None, roi_px: Roi | None) -> None:
    """Check that several views come with a sensor that has them, and without a region of interest.

    Raises:
        SensorError: they do not.
    """
    known = given or source.capabilities.sensor
    if roi_px is not None and known is not None and known.camera.views:
        raise SensorError(
            f"a region of interest is a part of one picture, but {known.name!r} has several views: omit it"
        )
    if given is None and source.capabilities.views > 1:
        raise SensorError(
            f"{text} needs a sensor file with [[views]], which states where each camera is: give --sensor"
        )


def require_fit(source: Source, text: str, sensor: Sensor) -> None:
    """Check that the camera of a sensor has the number of views and the image size that a source states.

    A source that does not state its size is compared later, when its frames are registered.

    Raises:
        SensorError: it has not.
    """
    camera, views = sensor.camera, source.capabilities.views
    if views > 1 and views != max(len(camera.views), 1):
        raise SensorError(
            f"{text} has {views} views, but the sensor {sensor.name!r} has "
            f"{max(len(camera.views), 1)}: name one source for each of its [[views]], in their order"
        )
    stated = (source.width_px, source.height_px)
    if None not in stated and stated != (camera.width_px, camera.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but "
            f"{text} has {source.width_px} x {source.height_px} px: give this camera's sensor file, or none"
        )
