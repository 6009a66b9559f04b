"""The untouched sheet or pad of a sensor, with one camera or with several."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from manytouch.calibration.outline.pad_outline import pad_of
from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.report import describe, with_provenance
from manytouch.calibration.views import calibrate_views, describe_views, with_provenance_of_views
from manytouch.values import Frame, Roi, Sensor, Sheet


def calibrate_untouched(
    known: Sensor,
    frames: Sequence[Frame],
    name: str,
    *,
    pitch_mm: float | tuple[float, float] | None = None,
    sheet: Sheet | None = None,
    thickness_mm: float | None = None,
    roi_px: Roi | None = None,
) -> tuple[Iterable[str], Sensor]:
    """Pose, layout and noise from a few seconds at rest.

    Args:
        known: with a camera, or several; a pad needs its [sheet].
        frames: of the untouched sensor.
        name: of the recording, for the provenance.
        pitch_mm, roi_px: see `calibrate_rest`; not with several cameras.
        sheet: from `stated_sheet`.
        thickness_mm: without a size of the sheet the outline is measured in the image.

    Returns:
        The report in lines, and the calibrated sensor.

    Raises:
        SensorError, LayoutError: see `calibrate_rest` and `calibrate_views`.
    """
    if known.camera.views:
        joined = calibrate_views(known, frames, sheet=sheet)
        return describe_views(joined), with_provenance_of_views(joined, name)
    found = calibrate_rest(
        known, frames, pitch_mm=pitch_mm, sheet=sheet, thickness_mm=thickness_mm, roi_px=roi_px
    )
    return describe(found), with_provenance(found, name)


def stated_sheet(
    known: Sensor, sheet_mm: tuple[float, float] | None, thickness_mm: float | None
) -> Sheet | None:
    """The pad of the sensor file with the size and thickness that were given instead, or a sheet of these.

    None where the image has to show the outline of a sheet.
    """
    pad = pad_of(known)
    if pad is not None:
        return replace(
            pad,
            size_mm=pad.size_mm if sheet_mm is None else np.array(sheet_mm, dtype=np.float64),
            thickness_mm=pad.thickness_mm if thickness_mm is None else float(thickness_mm),
        )
    if sheet_mm is not None and thickness_mm is not None:
        return Sheet(size_mm=np.array(sheet_mm), thickness_mm=float(thickness_mm))
    return None
