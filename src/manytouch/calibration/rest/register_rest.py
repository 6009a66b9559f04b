"""Registration of a known sensor to a recording: image positions of its markers at rest."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from manytouch.calibration.rest.first_frames import MOST_FRAMES, detect_in_frames, image_size
from manytouch.calibration.rest.local_bulge import local_bulge_px
from manytouch.calibration.rest.pose import adapt_pose
from manytouch.calibration.rest.shift_check import UNDETECTABLE_SHIFT, shift_is_undetectable
from manytouch.calibration.rest_dots import RestDots, rest_arrangements
from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import mm_per_px
from manytouch.geometry.refraction import rest_px
from manytouch.geometry.views.view_sensors import view_sensors
from manytouch.tracking import MarkerTracker
from manytouch.values import Camera, Detections, Frame, Roi, Sensor, TrackedGrid
from manytouch.values.arrays import Points2, read_only
from manytouch.values.sensor_file.default_std import camera_std

TOUCHED_PITCHES = 0.08
"""If the markers of one place are farther from the lattice of the sensor file, the sheet was touched; smaller
distances may be those of the print. Chosen on the scene sim:one, where a press 2.6 mm deep moves markers as
far as this (ADR 112)."""
MOVED_PITCHES = 0.05
"""The limit where the sensor file states measured places, instead of `TOUCHED_PITCHES`."""
_LESS_TOUCHED_PITCHES = 0.02
"""Frames are rest instead of the most probable ones if the largest distance of markers from their places in
the sensor file is this much less: a choice, a quarter of `TOUCHED_PITCHES`."""
_LEAST_SHARE = 0.5
"""Least share of the markers that must be found."""
_UNUSUAL_STDS = 4.0
"""An inclination that differs from the stated one by more standard deviations is reported: a choice."""
_SAME_DOT = 0.3  # distance of a marker from its own dot, over the root of the area of a dot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _MarkersAtRest:
    """Where the first frames show the markers.

    Attributes:
        grid: with the markers that are seen.
        position_px: (m, 2) of all markers; those that are not seen are moved as their neighbours are.
        bulge: see `_bulge_in_pitches`.
    """

    grid: TrackedGrid
    position_px: Points2
    bulge: float


def register_rest(sensor: Sensor, frames: Sequence[Frame], *, roi_px: Roi | None = None) -> Sensor:
    """Return the sensor with the marker centres measured in the rest frames at the start of a recording.

    The nominal pose may be off by up to about 0.4 pitch and a few degrees. A marker that is not found
    keeps its projected position, shifted as its neighbours are.

    Args:
        sensor: with a layout; a polarity "auto" is determined, and so are colour weights if the grey image
            shows no markers.
        frames: the first frames of the recording.
        roi_px: x, y, width, height of the region of interest.

    Raises:
        SensorError: the sensor has no layout, or its camera has another image size.
        SourceError: no frame could be decoded, or frames differ in size.
        LayoutError: fewer than half of the markers were found.
    """
    return register_and_count(sensor, frames, roi_px=roi_px)[0]


def register_and_count(
    sensor: Sensor, frames: Sequence[Frame], *, roi_px: Roi | None = None
) -> tuple[Sensor, int]:
    """As `register_rest`, with the number of markers that were found."""
    if sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no markers: give a sensor file with [markers], or no sensor file"
        )
    width, height = image_size(frames, roi_px)
    camera = sensor.camera
    if (width, height) != (camera.width_px, camera.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but the "
            f"input has {width} x {height} px: give the sensor file of this camera, or none"
        )
    if camera.views:
        return _register_views(sensor, frames)
    if sensor.layout.polarity == "auto":
        return _register_in_frames(_with_surveyed_appearance(sensor, frames, roi_px), frames, roi_px)
    try:
        return _register_in_frames(sensor, frames, roi_px)
    except LayoutError:
        if sensor.layout.colour_weights is not None:
            raise
    # Markers may be visible in colour only.
    return _register_in_frames(_with_surveyed_appearance(sensor, frames, roi_px), frames, roi_px)


def _register_views(sensor: Sensor, frames: Sequence[Frame]) -> tuple[Sensor, int]:
    """Each view registered to its own pictures, and all of them in one layout."""
    layout = sensor.layout
    assert layout is not None
    place_px = np.array(rest_px(sensor, layout))
    sentences: list[str] = []
    total = 0
    for view in view_sensors(sensor):
        pictures = [view.picture(frame) for frame in frames]
        found, count = register_and_count(replace(view.sensor, assumptions=()), pictures)
        total += count
        part = found.layout
        assert part is not None
        assert part.rest_px is not None
        place_px[view.marker[view.is_own]] = view.view.to_frame(part.rest_px)[view.is_own]
        layout = replace(layout, polarity=part.polarity, colour_weights=part.colour_weights)
        sentences += [f"View {view.view.name}: {sentence}" for sentence in found.assumptions]
    layout = replace(layout, rest_px=read_only(place_px))
    return replace(sensor, layout=layout, assumptions=(*sensor.assumptions, *sentences)), total


def _register_in_frames(sensor: Sensor, frames: Sequence[Frame], roi_px: Roi | None) -> tuple[Sensor, int]:
    """Registered to the motionless frames in which the markers depart least from the sensor file."""
    first, *others = rest_arrangements(detect_in_frames(sensor, frames[:MOST_FRAMES], roi_px))
    still, markers = first, _find_markers(sensor, first.centre_px, roi_px)
    for other in others:
        try:
            other_markers = _find_markers(sensor, other.centre_px, roi_px)
        except LayoutError:
            continue
        if other_markers.bulge < markers.bulge - _LESS_TOUCHED_PITCHES:
            still, markers = other, other_markers
    found, count = _registered(sensor, markers, still_frames=len(still.frames))
    found = _with_radii(found, still)
    if shift_is_undetectable(found, still, roi_px=roi_px):
        found = replace(found, assumptions=(*found.assumptions, UNDETECTABLE_SHIFT))
    return found, count


def _with_radii(sensor: Sensor, still: RestDots) -> Sensor:
    """The registered sensor with the radii of its dots at rest.

    They differ where dots are half printed, which are measured less accurately.
    """
    layout = sensor.layout
    assert layout is not None
    assert layout.rest_px is not None
    distance_px, dot = cKDTree(still.centre_px).query(layout.rest_px)
    is_own = (distance_px < _SAME_DOT * np.sqrt(np.median(still.area_px2))) & ~layout.is_missing
    radius_px = np.where(is_own, np.sqrt(still.area_px2[dot] / np.pi), np.nan)
    return replace(sensor, layout=replace(layout, rest_radius_px=read_only(radius_px)))


def _with_surveyed_appearance(sensor: Sensor, frames: Sequence[Frame], roi_px: Roi | None) -> Sensor:
    """The sensor with the polarity and colour weights that a survey of the frames finds."""
    from manytouch.detection import survey

    assert sensor.layout is not None
    appearance, given = survey(frames[:MOST_FRAMES], roi_px=roi_px).appearance, sensor.layout.polarity
    layout = replace(sensor.layout, polarity=appearance.polarity, colour_weights=appearance.colour_weights)
    assumptions = sensor.assumptions
    if given not in {"auto", appearance.polarity}:
        assumptions = (
            *assumptions,
            f"The markers are {appearance.polarity}, although the sensor file specifies {given}.",
        )
    return replace(sensor, layout=layout, assumptions=assumptions)


def register_dots(
    sensor: Sensor, centre_px: np.ndarray, *, still_frames: int = 1, roi_px: Roi | None = None
) -> Sensor:
    """As `register_rest`, from the centres (n, 2) of the dots at rest, px."""
    return _registered(sensor, _find_markers(sensor, centre_px, roi_px), still_frames=still_frames)[0]


def _find_markers(sensor: Sensor, centre_px: np.ndarray, roi_px: Roi | None) -> _MarkersAtRest:
    """The markers of a sensor among the centres (n, 2) of dots.

    Raises:
        LayoutError: fewer than half of the markers were found.
    """
    assert sensor.layout is not None
    layout = sensor.layout
    tracker = MarkerTracker(roi_px=roi_px)
    nominal = tracker.start(replace(sensor, layout=replace(layout, rest_px=None)))
    # The nominal pose serves as the previous frame: markers near it have not shifted by a pitch.
    state, grid = tracker.step(replace(nominal, is_consecutive=True), _detections_at(centre_px))
    found, wanted = int(grid.is_seen.sum()), int((~layout.is_missing).sum())
    if found < _LEAST_SHARE * wanted:
        raise LayoutError(
            f"only {found} of the {wanted} markers of the sensor {sensor.name!r} were found in the first "
            f"frames ({len(centre_px)} dots): check that the sensor file belongs to this recording, that the "
            "sheet is untouched at the start, light and focus; or leave the sensor file out"
        )
    return _MarkersAtRest(grid=grid, position_px=state.position_px, bulge=_bulge_in_pitches(sensor, grid))


def _registered(sensor: Sensor, markers: _MarkersAtRest, *, still_frames: int) -> tuple[Sensor, int]:
    """The sensor with these places as rest, and the number of markers that were seen."""
    assert sensor.layout is not None
    layout, grid, bulge = sensor.layout, markers.grid, markers.bulge
    found, wanted = int(grid.is_seen.sum()), int((~layout.is_missing).sum())
    frames = "motionless frame" if still_frames == 1 else f"{still_frames} motionless frames"
    if bulge > (TOUCHED_PITCHES if layout.rest_px is None else MOVED_PITCHES):
        sentence = (
            f"The markers depart from their places in the sensor file by {bulge:.2f} pitches at one "
            f"place in the first {frames}: the sheet was touched, and the places of the sensor file are "
            "taken as rest; begin a recording untouched for better ones."
        )
        at_rest = replace(layout, rest_px=read_only(np.array(rest_px(sensor, layout))))
        return replace(sensor, layout=at_rest, assumptions=(*sensor.assumptions, sentence)), found
    sentence = f"The sheet is at rest in the first {frames}."
    if found < wanted:
        sentence += (
            f" {wanted - found} of {wanted} markers were not seen in them; their positions are interpolated."
        )
    camera = sensor.camera
    if sensor.sheet is not None and sensor.sheet.boundary == "clamped" and not camera.views:
        camera = adapt_pose(camera, layout.rest_mm[grid.is_seen], grid.position_px[grid.is_seen])
        sentence += _difference(sensor.camera, camera)
    registered = replace(
        sensor,
        camera=camera,
        layout=replace(layout, rest_px=markers.position_px),
        assumptions=(*sensor.assumptions, sentence),
        provenance={**sensor.provenance, "rest_frames": still_frames},
    )
    return registered, found


def _bulge_in_pitches(sensor: Sensor, grid: TrackedGrid) -> float:
    """Largest local distance of the markers, in pitches, from their places at rest in the sensor file.

    A wrong pose, lens or print changes positions smoothly, or by the same amount in whole rows; these
    changes do not count. It is 0 for a layout that is no full table, and for a pad, on which a press moves
    markers by less than an uneven print.
    """
    layout, sheet = sensor.layout, sensor.sheet
    assert layout is not None
    if layout.row_column is None or sheet is None or sheet.boundary != "clamped" or sensor.camera.views:
        return 0.0
    off_px = np.where(grid.is_seen[:, None], grid.position_px - rest_px(sensor, layout), 0.0)
    pitch_px = float(np.sqrt(np.prod(layout.pitch_mm))) / mm_per_px(sensor.camera)
    return local_bulge_px(layout.row_column, off_px, grid.is_seen) / pitch_px


def _difference(stated: Camera, adapted: Camera) -> str:
    """How far the inclination is from the stated one, if that is more than its deviation explains."""
    turn = np.abs(adapted.rotation_vector - stated.rotation_vector)[:2]
    if (turn <= _UNUSUAL_STDS * camera_std(stated).rotation_vector[:2]).all():
        return ""
    return (
        f" The camera is inclined by {np.rad2deg(np.hypot(*turn)):.1f} degrees against the pose in the "
        "sensor file; the inclination of these frames is used (manytouch calibrate rest writes it to a file)."
    )


def _detections_at(centre_px: np.ndarray) -> Detections:
    """Detections with known centres and placeholder areas and contrasts."""
    number = len(centre_px)
    return Detections(
        centre_px=centre_px,
        covariance_px2=np.zeros((number, 2, 2)),
        area_px2=np.ones(number),
        contrast=np.ones(number),
    )
