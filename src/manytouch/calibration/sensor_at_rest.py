"""Calibration of a sensor whose sheet is at rest, with one camera or with several.

A recording may begin touched, so frames at rest are searched in the whole of it, as `process` does.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from manytouch.calibration.marker_tracks import track_markers
from manytouch.calibration.outline.pad_outline import pad_of
from manytouch.calibration.rest.calibrate import REST_MOTION_PITCHES, calibrate_rest, layout_and_rest
from manytouch.calibration.rest.rest_calibration import with_provenance
from manytouch.calibration.rest.rest_report import describe
from manytouch.calibration.rest.whole_recording import RestDoubt, rest_of_recording
from manytouch.calibration.views import calibrate_views, describe_views, with_provenance_of_views
from manytouch.errors import SensorError
from manytouch.geometry.refraction import rest_px
from manytouch.limits import sheet_mistake
from manytouch.sources.source import Source
from manytouch.tracking.lattice.find import local_spacing
from manytouch.values import Frame, Roi, Sensor, Sheet

DOUBTFUL_FRAMES = (
    f"the frames at rest are doubtful, because {RestDoubt.EQUALLY_COMMON.value}, and one of them may be "
    "touched: record two seconds without a touch, and repeat"
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CandidateFrames:
    """Frames of a recording among which `calibrate_rest` selects those at rest.

    Attributes:
        frames: in order; the first ones of the recording, unless its rest is shown elsewhere.
        notes: sentences on where they are, if the recording begins touched.
        doubts: warnings.
    """

    frames: Sequence[Frame]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def candidate_frames(
    known: Sensor,
    source: Source,
    first: Sequence[Frame],
    *,
    pitch_mm: float | tuple[float, float] | None = None,
    sheet: Sheet | None = None,
    roi_px: Roi | None = None,
) -> CandidateFrames:
    """The first frames; or, if the rest that the whole recording shows is not theirs, frames that show it.

    The rest is the stillest and most common arrangement of the markers (`rest_of_recording`). Of cameras,
    pictures and several views the first frames are taken. Frames in which markers move are left out later, by
    `calibrate_rest`.

    Args:
        known: with a camera; a pad needs its [sheet].
        source: the recording; it is read up to twice more.
        first: its first frames.
        pitch_mm, sheet, roi_px: see `calibrate_sensor_at_rest`.

    Raises:
        SensorError, LayoutError: see `calibrate_rest`.
    """
    is_recording = not (source.is_live or source.frame_count == 1 or source.capabilities.is_images)
    if not is_recording or known.camera.views:
        return CandidateFrames(frames=first)
    known = replace(known, sheet=known.sheet if sheet is None else sheet)
    _, registered = layout_and_rest(known, first, pitch_mm=pitch_mm, roi_px=roi_px)
    settled = rest_of_recording(registered, source, frame_count=source.frame_count, roi_px=roi_px)
    doubts = (DOUBTFUL_FRAMES,) if settled.doubt is RestDoubt.EQUALLY_COMMON else ()
    if not settled.still_frames:
        return CandidateFrames(frames=first, doubts=doubts)
    found = settled.sensor
    assert found.layout is not None
    assert registered.layout is not None
    at_px, first_px = rest_px(found, found.layout), rest_px(registered, registered.layout)
    limit_px = REST_MOTION_PITCHES * float(np.median(local_spacing(at_px[np.isfinite(at_px[:, 0])])))
    motion_px = track_markers(found, first, roi_px).motion_px(at_px)
    begins_touched = bool(motion_px[0] > limit_px)
    if not begins_touched and np.nanmax(np.linalg.norm(first_px - at_px, axis=1)) <= limit_px:
        return CandidateFrames(frames=first, doubts=doubts)
    wanted = {
        *settled.still_frames,
        *(index + 1 for index in settled.still_frames),
    }  # each was compared with the one after it
    frames = [frame for frame in islice(source, max(wanted) + 1) if frame.index in wanted]
    begin = "begins touched" if begins_touched else "is touched in most of its first frames"
    note = (
        f"the recording {begin}, with markers up to {np.nanmax(motion_px):.1f} px from rest, so that "
        f"{len(frames)} of the frames {min(wanted)} to {frames[-1].index} are used, in which the markers are "
        "stillest and most often in the same places"
    )
    return CandidateFrames(frames=frames, notes=(note,), doubts=doubts)


def calibrate_sensor_at_rest(
    known: Sensor,
    frames: Sequence[Frame],
    name: str,
    *,
    pitch_mm: float | tuple[float, float] | None = None,
    sheet: Sheet | None = None,
    thickness_mm: float | None = None,
    roi_px: Roi | None = None,
    doubts: Sequence[str] = (),
) -> tuple[Iterable[str], Sensor]:
    """Pose, layout and noise from a few seconds at rest.

    Args:
        known: with a camera, or several; a pad needs its [sheet].
        frames: of the sensor at rest, such as from `candidate_frames`.
        name: of the recording, for the provenance.
        pitch_mm, roi_px: see `calibrate_rest`; no effect with several cameras, as the
            command refuses them there.
        sheet: from `stated_sheet`.
        thickness_mm: without `sheet` the clamped outline is measured in the image; not
            with several cameras either.
        doubts: about the frames (`candidate_frames`), which are added to the warnings.

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
    found = replace(found, warnings=(*doubts, *found.warnings))
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
        SensorError: the size of a clamped sheet is given without its thickness, or they do not fit.
    """
    pad = pad_of(known)
    if pad is not None:
        return _computable(
            replace(
                pad,
                size_mm=pad.size_mm if sheet_mm is None else np.array(sheet_mm, dtype=np.float64),
                thickness_mm=pad.thickness_mm if thickness_mm is None else float(thickness_mm),
            )
        )
    if sheet_mm is None:
        return None
    if thickness_mm is None:
        raise SensorError(
            f"the size of the sheet, {sheet_mm[0]:g} x {sheet_mm[1]:g} mm, is given without its thickness: "
            "give both, or neither to keep the sheet of the sensor file"
        )
    return _computable(Sheet(size_mm=np.array(sheet_mm, dtype=np.float64), thickness_mm=float(thickness_mm)))


def _computable(sheet: Sheet) -> Sheet:
    mistake = sheet_mistake(sheet.size_mm[0], sheet.size_mm[1], sheet.thickness_mm)
    if mistake is not None:
        raise SensorError(mistake)
    return sheet
