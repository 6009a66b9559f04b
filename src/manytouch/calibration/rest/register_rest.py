"""Registration of a known sensor to a recording: image positions of its markers at rest."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from manytouch.calibration.rest.first_frames import MOST_FRAMES, detect_in_frames, image_size
from manytouch.calibration.rest.local_bulge import local_bulge_px
from manytouch.calibration.rest.pose import adapt_pose
from manytouch.calibration.rest.shift_check import UNDETECTABLE_SHIFT, shift_is_undetectable
from manytouch.calibration.rest.whole_recording import WHOLE_RECORDING, arrangements_of_recording
from manytouch.calibration.rest_dots import RestDots, rest_arrangements
from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import mm_per_px
from manytouch.geometry.refraction import rest_px
from manytouch.geometry.views.view_sensors import view_sensors
from manytouch.tracking import MarkerTracker
from manytouch.values import Camera, Detections, Frame, Roi, Sensor, TrackedGrid
from manytouch.values.arrays import Mask, Points2, read_only
from manytouch.values.sensor_file.default_std import camera_std

TOUCHED_PITCHES = 0.08
"""If the markers of one place are farther from the lattice of the sensor file, the sheet was touched; smaller
distances may be those of the print. Chosen on the scene sim:one, where a press 2.6 mm deep moves markers as
far as this (ADR 112)."""
MOVED_PITCHES = 0.05
"""The limit where the sensor file states measured places, instead of `TOUCHED_PITCHES`."""
_LESS_TOUCHED_PITCHES = 0.01
"""Frames are rest instead of the most probable ones if the largest distance of markers from their places in
the sensor file is this much less. In the moving scenes of `benchmarks/random_scenes.py` it is below 0.001 at
rest, also with drawn sensor files, and 0.006 to 0.1 in pressed frames (ADR 139)."""
_UNEVEN_PITCHES = 0.02
"""A distance above this is stated: that of a press 0.8 mm deep on a sheet of 1.8 mm (ADR 139)."""
_LEAST_SHARE = 0.5
"""Least share of the markers, or of those in the region of interest, that must be found."""
_UNUSUAL_STDS = 4.0
"""An inclination that differs from the stated one by more standard deviations is reported: a choice."""
_FRAMES_OF_REST = {"rest_frames", "still_frames"}  # keys of provenance
_SAME_DOT = 0.3  # distance of a marker from its own dot, over the root of the area of a dot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _MarkersAtRest:
    """Where the first frames show the markers.

    Attributes:
        grid: with the markers that are seen.
        is_expected: (m,) markers that are wholly in the region of interest; without a region, all that are
            not missing.
        position_px: (m, 2) of all markers; those that are not seen are moved as their neighbours are.
        bulge: see `_bulge_in_pitches`.
    """

    grid: TrackedGrid
    is_expected: Mask
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
        LayoutError: fewer than half of the markers, or of those in the region, were found.
    """
    return register_and_count(sensor, frames, roi_px=roi_px)[0]


def register_and_count(
    sensor: Sensor, frames: Sequence[Frame], *, roi_px: Roi | None = None
) -> tuple[Sensor, int]:
    """As `register_rest`, with the number of markers that were found."""
    require_markers(sensor)
    width, height = image_size(frames, roi_px)
    camera = sensor.camera
    if (width, height) != (camera.width_px, camera.height_px):
        raise SensorError(
            f"the sensor {sensor.name!r} is for images of {camera.width_px} x {camera.height_px} px, but the "
            f"input has {width} x {height} px: give the sensor file of this camera, or none"
        )
    if camera.views:
        return _register_views(sensor, frames)
    assert sensor.layout is not None
    if sensor.layout.polarity == "auto":
        return _register_in_frames(_with_surveyed_appearance(sensor, frames, roi_px), frames, roi_px)
    try:
        return _register_in_frames(sensor, frames, roi_px)
    except LayoutError:
        if sensor.layout.colour_weights is not None:
            raise
    # Markers may be visible in colour only.
    return _register_in_frames(_with_surveyed_appearance(sensor, frames, roi_px), frames, roi_px)


def require_markers(sensor: Sensor) -> None:
    """Check that a sensor has a layout, not a camera only.

    Raises:
        SensorError: it has not.
    """
    if sensor.layout is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has a camera but no [markers]: add them by manytouch calibrate rest "
            "SOURCE --sensor FILE --pitch-mm P --out NEW_FILE, or omit the sensor file"
        )


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
    found, count = _registered_to_start(sensor, markers, len(still.frames))
    found = _with_radii(found, still)
    if shift_is_undetectable(found, still, roi_px=roi_px):
        found = replace(found, assumptions=(*found.assumptions, UNDETECTABLE_SHIFT))
    return found, count


def may_begin_pressed(given: Sensor, registered: Sensor) -> bool:
    """Whether the first frames of a recording may show a pressed sheet.

    Args:
        given: from a sensor file.
        registered: the same, registered to these frames.
    """
    return _bulge_of(given, registered) >= _LESS_TOUCHED_PITCHES


def register_to_recording(
    given: Sensor,
    registered: Sensor,
    frames: Iterable[Frame],
    *,
    frame_count: int | None = None,
    roi_px: Roi | None = None,
) -> Sensor:
    """The sensor registered to the still frames of a recording that depart least from its file.

    It is `registered` unless there are frames that depart clearly less than the first ones.

    Args:
        given: from a sensor file.
        registered: the same, registered to the first frames.
        frames: of the recording from its beginning.
        frame_count: expected number of frames; None when not known.
        roi_px: x, y, width, height of the region of interest.
    """
    found = arrangements_of_recording(registered, frames, frame_count=frame_count, roi_px=roi_px)
    known = [each.position_px[np.isfinite(each.position_px[:, 0])] for each in found]
    candidates = []
    for arrangement, centre_px in zip(found, known, strict=True):
        try:
            candidates.append((_find_markers(given, centre_px, roi_px), arrangement.frames))
        except LayoutError:
            continue
    if not candidates:
        return registered
    markers, still = min(candidates, key=lambda each: each[0].bulge)
    if markers.bulge >= _bulge_of(given, registered) - _LESS_TOUCHED_PITCHES:
        return registered
    where = (
        f"{len(still)} of the frames {min(still)} to {max(still)}, in which the markers are nearest to their "
        "places in the sensor file"
    )
    origin = {"from": WHOLE_RECORDING, "still_frames": list(still)}
    sensor, _ = _registered(given, markers, where=where, origin=origin)
    assert sensor.layout is not None
    assert registered.layout is not None
    layout = replace(
        sensor.layout,
        polarity=registered.layout.polarity,
        colour_weights=registered.layout.colour_weights,
        rest_radius_px=registered.layout.rest_radius_px,
    )
    return replace(sensor, layout=layout)


def _bulge_of(given: Sensor, registered: Sensor) -> float:
    """The bulge of rest places.

    Where those of the file were taken, since the sheet was touched, it is half of the limit above which they
    are: measured places that depart more may be those of a lighter touch.
    """
    assert given.layout is not None
    assert registered.layout is not None
    place_px, file_px = registered.layout.rest_px, rest_px(given, given.layout)
    assert place_px is not None
    if np.array_equal(place_px, file_px):
        return 0.5 * _touched_limit(given)
    return _bulge_in_pitches(given, place_px, ~given.layout.is_missing)


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
    markers = _find_markers(sensor, centre_px, roi_px)
    return _registered_to_start(sensor, markers, still_frames)[0]


def _find_markers(sensor: Sensor, centre_px: np.ndarray, roi_px: Roi | None) -> _MarkersAtRest:
    """The markers of a sensor among the centres (n, 2) of dots.

    Raises:
        LayoutError: fewer than half of the expected markers were found.
    """
    assert sensor.layout is not None
    layout = sensor.layout
    tracker = MarkerTracker(roi_px=roi_px)
    nominal = tracker.start(replace(sensor, layout=replace(layout, rest_px=None)))
    # The nominal pose serves as the previous frame: markers near it have not shifted by a pitch.
    state, grid = tracker.step(replace(nominal, is_consecutive=True), _detections_at(centre_px))
    # without a region all are expected: a camera that shows few of them is that of another sensor
    is_expected = ~layout.is_missing if roi_px is None else nominal.graph.is_expected(state.position_px)
    is_found = grid.is_seen & is_expected
    found, wanted = int(is_found.sum()), int(is_expected.sum())
    if found < max(_LEAST_SHARE * wanted, 1):
        where = "" if roi_px is None else f" in the region of interest {roi_px}"
        raise LayoutError(
            f"only {found} of the {wanted} markers of the sensor {sensor.name!r}{where} were found in the "
            f"first frames ({len(centre_px)} dots): check that the sensor file belongs to this recording, "
            "that the sheet is untouched at the start, light and focus; or leave the sensor file out"
        )
    bulge = _bulge_in_pitches(sensor, grid.position_px, is_found)
    return _MarkersAtRest(grid=grid, is_expected=is_expected, position_px=state.position_px, bulge=bulge)


def _registered_to_start(sensor: Sensor, markers: _MarkersAtRest, still_frames: int) -> tuple[Sensor, int]:
    """As `_registered`, for places in the first frames."""
    count = "motionless frame" if still_frames == 1 else f"{still_frames} motionless frames"
    return _registered(sensor, markers, where=f"the first {count}", origin={"rest_frames": still_frames})


def _registered(
    sensor: Sensor, markers: _MarkersAtRest, *, where: str, origin: Mapping[str, object]
) -> tuple[Sensor, int]:
    """The sensor with these places as rest, and the number of markers that were seen.

    Args:
        sensor: from a file.
        markers: its markers.
        where: the frames that show them, in a sentence.
        origin: what `provenance` states of these frames.
    """
    assert sensor.layout is not None
    layout, grid, bulge = sensor.layout, markers.grid, markers.bulge
    found, unseen = int(grid.is_seen.sum()), int((markers.is_expected & ~grid.is_seen).sum())
    wanted = int(markers.is_expected.sum())
    if bulge > _touched_limit(sensor):
        sentence = (
            f"The markers depart from their places in the sensor file by {bulge:.2f} pitches at one "
            f"place in {where}: the sheet was touched, and the places of the sensor file are "
            "taken as rest; begin a recording untouched for better ones."
        )
        at_rest = replace(layout, rest_px=read_only(np.array(rest_px(sensor, layout))))
        return replace(sensor, layout=at_rest, assumptions=(*sensor.assumptions, sentence)), found
    sentence = f"The sheet is at rest in {where}."
    if unseen:
        sentence += f" {unseen} of {wanted} markers were not seen in them; their positions are interpolated."
    if bulge > _UNEVEN_PITCHES:
        sentence += (
            f" They depart from their places in the sensor file by {bulge:.2f} pitches at one place, by an "
            "uneven print or a light touch: tare while nothing touches the sheet if results are not 0 then."
        )
    camera = sensor.camera
    if sensor.sheet is not None and sensor.sheet.boundary == "clamped" and not camera.views:
        # the border of a region cuts dots, which displaces them
        is_whole = grid.is_seen & markers.is_expected
        camera = adapt_pose(camera, layout.rest_mm[is_whole], grid.position_px[is_whole])
        sentence += _difference(sensor.camera, camera)
    kept = {name: value for name, value in sensor.provenance.items() if name not in _FRAMES_OF_REST}
    registered = replace(
        sensor,
        camera=camera,
        layout=replace(layout, rest_px=markers.position_px),
        assumptions=(*sensor.assumptions, sentence),
        provenance={**kept, **origin},
    )
    return registered, found


def _touched_limit(sensor: Sensor) -> float:
    """The bulge above which a sheet was touched, in pitches."""
    assert sensor.layout is not None
    return TOUCHED_PITCHES if sensor.layout.rest_px is None else MOVED_PITCHES


def _bulge_in_pitches(sensor: Sensor, place_px: Points2, is_known: Mask) -> float:
    """Largest local distance of markers (m, 2) px, in pitches, from their places at rest in the sensor file.

    A wrong pose, lens or print changes positions smoothly, or by the same amount in whole rows; these
    changes do not count. It is 0 for a layout that is no full table, and for a pad, on which a press moves
    markers by less than an uneven print.
    """
    layout, sheet = sensor.layout, sensor.sheet
    assert layout is not None
    if layout.row_column is None or sheet is None or sheet.boundary != "clamped" or sensor.camera.views:
        return 0.0
    off_px = np.where(is_known[:, None], place_px - rest_px(sensor, layout), 0.0)
    pitch_px = float(np.sqrt(np.prod(layout.pitch_mm))) / mm_per_px(sensor.camera)
    return local_bulge_px(layout.row_column, off_px, is_known) / pitch_px


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
