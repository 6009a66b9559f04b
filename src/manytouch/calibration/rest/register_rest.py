"""A known sensor meets a recording: where its markers lie in the image while nothing touches."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.calibration.rest.first_frames import MOST_FRAMES, RestRegion, image_size, searched_frames
from manytouch.calibration.rest.rest_frames import still_dots
from manytouch.calibration.rest.shift_check import CANNOT_BE_NOTICED, jumps_unseen
from manytouch.errors import LayoutError, SensorError
from manytouch.tracking import MarkerTracker
from manytouch.values import Detections, Frame, Sensor

_LEAST_SHARE = 0.5


def register_rest(sensor: Sensor, frames: Sequence[Frame], *, roi_px: RestRegion | None = None) -> Sensor:
    """The same sensor with the markers' centres as the first frames at rest show them.

    The nominal pose may be off by up to about 0.4 pitch and a few degrees. A marker that is not found
    keeps its projected place, moved as its neighbours are.

    Args:
        sensor: with a layout; a polarity "auto" is found out, and so are colours where grey shows no markers.
        frames: the first frames of the recording.
        roi_px: x, y, width, height of the part of the image to look at.

    Raises:
        SensorError: the sensor has no layout, or its camera has another image size.
        SourceError: no frame could be decoded, or frames differ in size.
        LayoutError: fewer than half of the markers were found.
    """
    if sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no markers: give a sensor file with [markers], or none at all"
        )
    width, height = image_size(frames, roi_px)
    camera = sensor.camera
    if (width, height) != (camera.width_px, camera.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but the "
            f"input has {width} x {height} px: give the sensor file of this camera, or none"
        )
    if sensor.layout.polarity == "auto":
        return _searched(_as_seen(sensor, frames, roi_px), frames, roi_px)
    try:
        return _searched(sensor, frames, roi_px)
    except LayoutError:
        if sensor.layout.colour_weights is not None:
            raise
    # Grey may not show the markers where colours do.
    return _searched(_as_seen(sensor, frames, roi_px), frames, roi_px)


def _searched(sensor: Sensor, frames: Sequence[Frame], roi_px: RestRegion | None) -> Sensor:
    still = still_dots(searched_frames(sensor, frames[:MOST_FRAMES], roi_px))
    found = referred(sensor, still.centre_px, still_frames=len(still.frames), roi_px=roi_px)
    if jumps_unseen(found, still, roi_px=roi_px):
        return replace(found, assumptions=(*found.assumptions, CANNOT_BE_NOTICED))
    return found


def _as_seen(sensor: Sensor, frames: Sequence[Frame], roi_px: RestRegion | None) -> Sensor:
    """The sensor with the polarity and the colours that a first look at the frames finds."""
    from manytouch.detection import survey

    assert sensor.layout is not None
    appearance, told = survey(frames[:MOST_FRAMES], roi_px=roi_px).appearance, sensor.layout.polarity
    layout = replace(sensor.layout, polarity=appearance.polarity, colour_weights=appearance.colour_weights)
    said = sensor.assumptions
    if told not in {"auto", appearance.polarity}:
        said = (*said, f"The markers are {appearance.polarity}, though the sensor file says {told}.")
    return replace(sensor, layout=layout, assumptions=said)


def referred(
    sensor: Sensor, centre_px: np.ndarray, *, still_frames: int = 1, roi_px: RestRegion | None = None
) -> Sensor:
    """As `register_rest`, from the (n, 2) centres of dots at rest."""
    assert sensor.layout is not None
    layout = sensor.layout
    follow = MarkerTracker(roi_px=roi_px)
    nominal = follow.start(replace(sensor, layout=replace(layout, rest_px=None)))
    # The nominal pose stands for a frame before: what is near it has not slipped by a pitch.
    state, grid = follow.step(replace(nominal, is_locked=True), _plain(centre_px))
    found, wanted = int(grid.is_seen.sum()), int((~layout.is_missing).sum())
    if found < _LEAST_SHARE * wanted:
        raise LayoutError(
            f"only {found} of the {wanted} markers of the sensor {sensor.name!r} were found in the first "
            f"frames ({len(centre_px)} dots): check that the sensor file belongs to this recording, that the "
            "sheet is untouched at the start, light and focus; or leave the sensor file out"
        )
    first = "frame that keeps" if still_frames == 1 else f"{still_frames} frames that keep"
    said = f"The sheet is at rest in the first {first} still."
    if found < wanted:
        said += f" {wanted - found} of {wanted} markers were not seen in them; their places are interpolated."
    return replace(
        sensor,
        layout=replace(layout, rest_px=state.place_px),
        assumptions=(*sensor.assumptions, said),
    )


def _plain(centre_px: np.ndarray) -> Detections:
    """Dots of which nothing but their centres is known."""
    number = len(centre_px)
    return Detections(
        centre_px=centre_px,
        covariance_px2=np.zeros((number, 2, 2)),
        area_px2=np.ones(number),
        contrast=np.ones(number),
    )
