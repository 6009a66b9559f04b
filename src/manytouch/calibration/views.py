"""Several cameras on one sheet at rest: the pose of each, by the markers that it shows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.rest_calibration import RestCalibration
from manytouch.calibration.rest.rest_report import describe
from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import view_of
from manytouch.geometry.views.view_sensors import view_sensors
from manytouch.values import Frame, Sensor, Sheet
from manytouch.values.arrays import read_only
from manytouch.values.sensor import camera_of_views


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ViewsCalibration:
    """A sensor with several views, calibrated on its untouched sheet.

    Attributes:
        sensor: with the pose of each view, the missing markers and the noise.
        views: the calibration of each view by its name, in the order of the sensor.
    """

    sensor: Sensor
    views: dict[str, RestCalibration]


def calibrate_views(
    sensor: Sensor, frames: Sequence[Frame], *, sheet: Sheet | None = None
) -> ViewsCalibration:
    """Estimate the pose of each view, missing markers and noise from some seconds of the untouched sheet.

    All views share the markers of the sensor file. The given poses decide which dot is which marker; they may
    misplace the markers by up to 0.4 pitch. A marker is missing if the view that shows it nearest to the
    middle of its image does not find it. The noise is the median over the views.

    Args:
        sensor: with several views and a layout.
        frames: one after the other; the image of each contains the pictures of all views.
        sheet: for the calibrated sensor; None keeps that of `sensor`.

    Raises:
        SensorError: the sensor has no layout.
        LayoutError: a view shows fewer than half of its markers; the message names the view.
    """
    layout = sensor.layout
    if layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has several views but no [markers], which all views share: "
            "add them to the file"
        )
    parts, found = view_sensors(sensor), {}
    for part in parts:
        try:
            pictures = [part.picture(frame) for frame in frames]
            found[part.view.name] = calibrate_rest(part.sensor, pictures, sheet=sheet)
        except LayoutError as error:
            raise LayoutError(f"view {part.view.name!r}: {error}") from error
    camera = camera_of_views({name: view.sensor.camera for name, view in found.items()})
    number, is_missing = view_of(camera, layout.rest_mm), layout.is_missing.copy()
    for index, (part, view) in enumerate(zip(parts, found.values(), strict=True)):
        assert view.sensor.layout is not None
        is_own = number[part.marker] == index
        is_missing[part.marker[is_own]] = view.sensor.layout.is_missing[is_own]
    calibrated = replace(
        sensor,
        camera=camera,
        sheet=sheet or sensor.sheet,
        layout=replace(layout, is_missing=read_only(is_missing), rest_px=None),
        centre_noise_px=float(np.median([view.noise_px for view in found.values()])),
        assumptions=(),
    )
    return ViewsCalibration(sensor=calibrated, views=found)


def describe_views(calibration: ViewsCalibration) -> Iterator[str]:
    """The report of each view; every line starts with the name of the view."""
    for name, view in calibration.views.items():
        yield from (f"view {name}: {line}" for line in describe(view))


def with_provenance_of_views(calibration: ViewsCalibration, source_name: str) -> Sensor:
    """The calibrated sensor; its provenance names the source, the smallest number of frames of a view,
    and residuals and warnings of each view.
    """
    views = calibration.views
    provenance = {
        **calibration.sensor.provenance,
        "rest": f"calibrated from {min(view.frames for view in views.values())} frames of {source_name}",
        "rest_rms_px": [round(view.rms_px, 4) for view in views.values()],
        "rest_warnings": [
            f"view {name}: {sentence}" for name, view in views.items() for sentence in view.warnings
        ],
    }
    return replace(calibration.sensor, provenance=provenance)
