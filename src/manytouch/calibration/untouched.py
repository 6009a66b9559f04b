"""Calibration of a sensor whose sheet is untouched, with one camera or with several."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from manytouch.calibration.outline.pad_outline import pad_of
from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.report import describe, with_provenance
from manytouch.calibration.views import calibrate_views, describe_views, with_provenance_of_views
from manytouch.errors import SensorError
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
        pitch_mm, roi_px: see `calibrate_rest`; no effect with several cameras, as the
            command refuses them there.
        sheet: from `stated_sheet`.
        thickness_mm: without `sheet` the clamped outline is measured in the image; not
            with several cameras either.

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
    """The pad of `known`, size and thickness replaced where given; else a clamped sheet if both are given.

    Args:
        known: the sensor as it was read.
        sheet_mm: size along x and y.
        thickness_mm: of the sheet.

    Returns:
        None: keep the sheet of `known`; or, if a thickness is given, measure the outline in the image.

    Raises:
        SensorError: the size of a clamped sheet is given without its thickness.
    """
    pad = pad_of(known)
    if pad is not None:
        return replace(
            pad,
            size_mm=pad.size_mm if sheet_mm is None else np.array(sheet_mm, dtype=np.float64),
            thickness_mm=pad.thickness_mm if thickness_mm is None else float(thickness_mm),
        )
    if sheet_mm is None:
        return None
    if thickness_mm is None:
        raise SensorError(
            f"the size of the sheet, {sheet_mm[0]:g} x {sheet_mm[1]:g} mm, is given without its thickness: "
            "give both, or neither to keep the sheet of the sensor file"
        )
    return Sheet(size_mm=np.array(sheet_mm, dtype=np.float64), thickness_mm=float(thickness_mm))
