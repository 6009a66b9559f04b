"""Pose, layout and noise of the untouched sheet in the view of a calibrated camera, with warnings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from manytouch.calibration.dot_sharpness import edge_width_px, is_soft
from manytouch.calibration.marker_tracks import MarkerTracks, track_markers
from manytouch.calibration.outline.clamp_line import ClampLine, clamp_line, clamp_warnings
from manytouch.calibration.outline.pad_outline import pad_of, with_origin_at, with_seen_outline
from manytouch.calibration.rest.adapt_nominal import register_nominal
from manytouch.calibration.rest.assumed_sensor import sensor_from_rest
from manytouch.calibration.rest.pose import fit_pose, pose_std_by_lens
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.rest.rest_calibration import RestCalibration
from manytouch.detection import expected_appearance
from manytouch.detection.dot_appearance import radius_in_image
from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import project
from manytouch.geometry.centre_noise import LEAST_FRAMES, centre_noise_px
from manytouch.geometry.refraction import onto_plane_through_window, project_through_window, rest_px
from manytouch.limits import sheet_mistake
from manytouch.tracking import COMPRESSED_VIDEO
from manytouch.tracking.lattice.find import local_spacing
from manytouch.values import Camera, Frame, Layout, Roi, Sensor, Sheet
from manytouch.values.arrays import Mask, Points2, read_only

# All of these limits are choices; none was fitted to recordings.
SEEN_SHARE = 0.5
"""A marker that is seen in a smaller share of the frames is treated as missing."""
LEAST_MARKERS = 6
"""Fewer markers are refused: the six numbers of a pose need three, and as many more show their error."""
REST_MOTION_PITCHES = 0.02
"""A frame whose markers are farther from rest is not at rest (0.08 mm at a pitch of 4 mm)."""
MAX_MOTION_OVER_MEDIAN = 3.0
"""A frame whose markers move more than this multiple of the median over the frames at rest is left out."""
MAX_DRIFT_PITCHES = 0.02
"""A marker that moves farther from the first to the last of the frames used gives a warning."""
MAX_RESIDUAL_PITCHES = 0.02
"""A larger RMS residual from a flat lattice gives a warning."""
MAX_DISTANCE_ERROR = 0.03
"""A larger relative difference from the distance in the sensor file gives a warning: ten times the default
standard deviation of a distance (`values.sensor_file.default_std`)."""
MIN_CONTRAST_GREY = 25.0
"""A lower contrast of the markers, in grey levels of 255, gives a warning."""
LEAST_NOISE_PX = 1e-3
"""Smaller measured noise is that of equal pictures (stills, simulations without noise) and would give markers
weights without limit."""


def calibrate_rest(
    sensor: Sensor,
    frames: Sequence[Frame],
    *,
    pitch_mm: float | tuple[float, float] | None = None,
    sheet: Sheet | None = None,
    thickness_mm: float | None = None,
    roi_px: Roi | None = None,
) -> RestCalibration:
    """Estimate pose, layout and noise from some seconds of the untouched sheet.

    A bonded pad is seen through its window: the pose is that of its markers, with the tilt by the glue, and
    sides of the outline that the image shows replace those of the sensor file
    (`calibration.outline.pad_outline`).

    Args:
        sensor: with a calibrated camera; its layout is used if it has one, and found otherwise. A polarity
            "auto" is determined.
        frames: of one recording of the untouched sheet; those in which markers move are left out.
        pitch_mm: distance of neighbouring markers, required if the sensor has no layout.
        sheet: for the calibrated sensor; None keeps that of `sensor`.
        thickness_mm: of a clamped sheet whose outline is to be measured in the image, and which replaces that
            of `sensor`; no effect if `sheet` is given or the sensor has a pad.
        roi_px: x, y, width, height of the region of interest.

    Raises:
        SensorError: the scale is not known, a required outline is not visible, or the sensor does not fit
            the frames.
        LayoutError: no markers, no lattice, or fewer than half of those of the layout were found; fewer than
            `LEAST_MARKERS` were seen in at least half of the frames; or none in `LEAST_FRAMES` frames, which
            its noise needs.
    """
    sensor = replace(sensor, sheet=sheet if sheet is not None else sensor.sheet)
    with_layout, registered = layout_and_rest(sensor, frames, pitch_mm=pitch_mm, roi_px=roi_px)
    layout, pad = with_layout.layout, pad_of(sensor)
    assert layout is not None
    layout = _with_determined_polarity(layout, registered)
    all_tracks = track_markers(registered, frames, roi_px)
    motion_px, at_rest = _frames_at_rest(all_tracks, registered)
    seen = all_tracks.of(at_rest)
    frames = [frame for frame, is_still in zip(frames, at_rest, strict=True) if is_still]
    is_present = _seen_in_most_frames(seen)
    place_px = seen.median_px(np.ones(len(seen.timestamp_ns), dtype=np.bool_))
    is_used = is_present & np.isfinite(place_px[:, 0])
    camera, std = _fitted_camera(with_layout.camera, layout.rest_mm[is_used], place_px[is_used], pad)
    px_per_mm = _px_per_mm(camera, sensor.sheet, place_px[is_used])
    if sensor.layout is None:
        layout = _with_measured_radius(layout, px_per_mm, seen, is_used)
    residual = np.full(place_px.shape, np.nan)
    residual[is_used] = place_px[is_used] - _images(camera, sensor.sheet, layout.rest_mm[is_used])
    noise = _noise_px(seen, is_used)
    found = replace(
        with_layout,
        camera=camera,
        layout=replace(layout, is_missing=read_only(~is_used), rest_px=read_only(place_px)),
        centre_noise_px=noise,
        assumptions=(),
    )
    seen_clamp = clamp_line(camera, layout, frames, pad)
    if pad is not None:
        found, seen_clamp = with_seen_outline(found, seen_clamp)
    elif thickness_mm is not None and sheet is None:
        found, seen_clamp = _with_measured_outline(found, seen_clamp, thickness_mm)
    return RestCalibration(
        sensor=found,
        residual_px=read_only(residual),
        pose_std=std,
        noise_px=noise,
        contrast=float(np.nanmedian(seen.contrast)),
        frames=len(frames),
        frames_given=len(at_rest),
        first_and_last=(frames[0].index, frames[-1].index),
        motion_px=float(np.nanmax(motion_px[at_rest])),
        clamp=seen_clamp,
        warnings=(
            *_warnings(sensor, found, residual, seen, px_per_mm),
            *clamp_warnings(seen_clamp, found.sheet),
            *_focus_warnings(found, frames, roi_px),
        ),
    )


def layout_and_rest(
    sensor: Sensor,
    frames: Sequence[Frame],
    *,
    pitch_mm: float | tuple[float, float] | None = None,
    roi_px: Roi | None = None,
) -> tuple[Sensor, Sensor]:
    """The sensor with its layout, and the same with the rest positions of its markers in the frames.

    Args:
        sensor, frames, pitch_mm, roi_px: see `calibrate_rest`; a nominal sensor gets the print of the frames
            with the given pitch.

    Raises:
        SensorError, LayoutError: see `calibrate_rest`.
    """
    if sensor.is_nominal and sensor.layout is not None and pitch_mm is not None:
        found = register_nominal(sensor, frames, pitch_mm=pitch_mm, roi_px=roi_px)
        return found, found
    with_layout = sensor
    if sensor.layout is None:
        with_layout = _with_found_layout(sensor, frames, pitch_mm, roi_px)
    elif pitch_mm is not None:
        with_layout = replace(sensor, layout=_rescale(sensor.layout, pitch_mm))
    try:
        return with_layout, register_rest(with_layout, frames, roi_px=roi_px)
    except LayoutError:
        if not sensor.is_nominal:
            raise
    found = register_nominal(with_layout, frames, roi_px=roi_px)
    return found, found


def _with_determined_polarity(layout: Layout, registered: Sensor) -> Layout:
    """The layout; a polarity "auto" and the colour weights are replaced by those that the frames show."""
    if layout.polarity != "auto":
        return layout
    assert registered.layout is not None
    polarity, weights = registered.layout.polarity, registered.layout.colour_weights
    return replace(layout, polarity=polarity, colour_weights=weights)


def _seen_in_most_frames(seen: MarkerTracks) -> Mask:
    """(m,) whether each marker is seen in at least `SEEN_SHARE` of the frames.

    Raises:
        LayoutError: fewer than `LEAST_MARKERS` are.
    """
    is_present = seen.is_seen.mean(axis=0) >= SEEN_SHARE
    if int(is_present.sum()) < LEAST_MARKERS:
        raise LayoutError(
            f"only {int(is_present.sum())} of {len(is_present)} markers were seen in most frames: check "
            "light and focus"
        )
    return np.asarray(is_present)


def _fitted_camera(
    camera: Camera, rest_mm: np.ndarray, place_px: Points2, pad: Sheet | None
) -> tuple[Camera, Float64[np.ndarray, "6"]]:
    """The camera with the pose in which it shows markers (n, 3) at places (n, 2), and deviations of that.

    The deviations (6,) of rotation vector (rad) and translation (mm) contain those by the lens.
    """
    fitted, std = fit_pose(camera, rest_mm, place_px, pad)
    std = np.hypot(std, pose_std_by_lens(fitted, rest_mm, pad))
    rotation_std, translation_std_mm = read_only(std[:3].copy()), read_only(std[3:].copy())
    fitted = replace(fitted, rotation_vector_std=rotation_std, translation_std_mm=translation_std_mm)
    return fitted, std


def _frames_at_rest(seen: MarkerTracks, registered: Sensor) -> tuple[np.ndarray, np.ndarray]:
    """(k,) motion of the markers in px, and (k,) whether a frame is at rest.

    All frames are used if fewer than `LEAST_FRAMES` are at rest; then only the warning of a drift shows it.
    """
    layout = registered.layout
    assert layout is not None
    at_px = rest_px(registered, layout)
    motion_px = seen.motion_px(at_px)
    pitch_px = float(np.median(local_spacing(at_px[np.isfinite(at_px[:, 0])])))
    at_rest = motion_px <= REST_MOTION_PITCHES * pitch_px
    if at_rest.sum() < LEAST_FRAMES:
        return motion_px, np.ones_like(at_rest)
    return motion_px, motion_px <= min(
        MAX_MOTION_OVER_MEDIAN * float(np.median(motion_px[at_rest])), REST_MOTION_PITCHES * pitch_px
    )


def _with_measured_outline(found: Sensor, seen: ClampLine, thickness_mm: float) -> tuple[Sensor, ClampLine]:
    """The sensor with the measured outline, and its origin at the centre of it.

    Raises:
        SensorError: not all sides are visible, or the thickness does not fit them.
    """
    if seen.unseen:
        raise SensorError(
            f"the image does not show the whole clamp line ({', '.join(seen.unseen)} missing): give the "
            "outline of the sheet by --sheet-mm X,Y"
        )
    if (mistake := sheet_mistake(seen.size_mm[0], seen.size_mm[1], thickness_mm)) is not None:
        raise SensorError(mistake)
    sheet = Sheet(size_mm=read_only(seen.size_mm.copy()), thickness_mm=thickness_mm)
    return with_origin_at(replace(found, sheet=sheet), seen)


def _with_found_layout(
    sensor: Sensor, frames: Sequence[Frame], pitch_mm: float | tuple[float, float] | None, roi_px: Roi | None
) -> Sensor:
    """The sensor with the lattice found in the frames, in an approximate pose."""
    if pitch_mm is None:
        raise SensorError(
            f"the sensor {sensor.name!r} has no [markers], so their pitch is not known: give --pitch-mm"
        )
    found = sensor_from_rest(frames, name=sensor.name, pitch_mm=pitch_mm, roi_px=roi_px)
    layout = found.layout
    assert layout is not None
    if layout.row_column is None or layout.rest_px is None:
        raise LayoutError(
            "the markers do not form a lattice of rows and columns, so their positions in mm cannot be "
            "determined from one image: write them into the sensor file as rest_mm = [[x, y], ...]"
        )
    camera = sensor.camera
    if (camera.width_px, camera.height_px) != (found.camera.width_px, found.camera.height_px):
        raise SensorError(
            f"the camera of {sensor.name!r} is calibrated for {camera.width_px} x {camera.height_px} px, "
            f"but the frames have {found.camera.width_px} x {found.camera.height_px} px: calibrate it at "
            "this size"
        )
    pitch = np.broadcast_to(np.asarray(pitch_mm, dtype=np.float64), 2)
    middle = layout.row_column.max(axis=0) / 2
    rest = np.zeros((len(layout.rest_mm), 3))
    rest[:, :2] = ((layout.row_column - middle) * pitch[::-1])[:, ::-1]
    is_used = ~layout.is_missing & np.isfinite(layout.rest_px[:, 0])
    posed, _ = fit_pose(camera, rest[is_used], layout.rest_px[is_used], pad_of(sensor))
    layout = replace(layout, rest_mm=read_only(rest), pitch_mm=read_only(pitch.copy()), rest_px=None)
    return replace(sensor, camera=posed, layout=layout)


def _rescale(layout: Layout, pitch_mm: float | tuple[float, float]) -> Layout:
    pitch = np.broadcast_to(np.asarray(pitch_mm, dtype=np.float64), 2)
    rest = layout.rest_mm.copy()
    rest[:, :2] *= pitch / layout.pitch_mm
    return replace(layout, rest_mm=read_only(rest), pitch_mm=read_only(pitch.copy()))


def _images(camera: Camera, sheet: Sheet | None, rest_mm: np.ndarray) -> Points2:
    """(n, 2) images of the markers of a flat sheet or of a pad behind its window."""
    return project(camera, rest_mm) if sheet is None else project_through_window(camera, sheet, rest_mm)


def _px_per_mm(camera: Camera, sheet: Sheet | None, place_px: Points2) -> float:
    """Scale of the image at the sheet; for a pad the median over its markers, through the window."""
    if sheet is None or sheet.window_mm is None:
        return float(np.sqrt(camera.fx_px * camera.fy_px)) / float(camera.translation_mm[2])
    x_mm, y_mm = (
        onto_plane_through_window(camera, sheet, place_px + step)[:, :2]
        - onto_plane_through_window(camera, sheet, place_px - step)[:, :2]
        for step in 0.5 * np.eye(2)
    )
    area_mm2 = np.abs(x_mm[:, 0] * y_mm[:, 1] - x_mm[:, 1] * y_mm[:, 0])
    return float(np.median(1.0 / np.sqrt(area_mm2)))


def _with_measured_radius(
    layout: Layout, px_per_mm: float, seen: MarkerTracks, is_used: np.ndarray
) -> Layout:
    """The layout with the marker radius that follows from the areas of the dots."""
    areas = seen.area_px2[:, is_used]
    if not np.isfinite(areas).any():
        return layout
    radius = float(np.sqrt(np.nanmedian(areas) / np.pi)) / px_per_mm
    return replace(layout, radius_mm=read_only(np.full(len(layout.rest_mm), radius)))


def _noise_px(seen: MarkerTracks, is_used: np.ndarray) -> float:
    """Median noise of the markers (`geometry.centre_noise`), and what compressed video adds to it."""
    noise = centre_noise_px(seen.position_px[:, is_used])
    noise = noise[np.isfinite(noise)]
    if len(noise) == 0:
        raise LayoutError(
            f"the noise of the markers needs at least {LEAST_FRAMES} frames in which they are seen: record "
            "two seconds without a touch"
        )
    return max(float(np.hypot(np.median(noise), seen.compression_std_px)), LEAST_NOISE_PX)


def _warnings(
    given: Sensor, found: Sensor, residual: np.ndarray, seen: MarkerTracks, px_per_mm: float
) -> Sequence[str]:
    """Warnings about the sheet, the markers and the light."""
    is_used = np.isfinite(residual[:, 0])
    layout, camera = found.layout, found.camera
    assert layout is not None
    pitch_px = float(np.sqrt(np.prod(layout.pitch_mm))) * px_per_mm
    sentences = []
    rms_px = np.sqrt(np.nanmean(np.square(residual).sum(axis=1)))
    if rms_px > MAX_RESIDUAL_PITCHES * pitch_px:
        sentences.append(
            f"markers lie {rms_px:.2f} px (RMS) off a flat lattice: calibrate the lens (manytouch calibrate "
            "camera, with views of a board), and check pitch_mm along x and y; what remains is a sheet "
            "that is not flat, which results allow for"
        )
    lost = int((~is_used).sum()) - (int(given.layout.is_missing.sum()) if given.layout is not None else 0)
    if lost > 0:
        were = "1 marker was not seen and is" if lost == 1 else f"{lost} markers were not seen and are"
        sentences.append(f"{were} treated as missing")
    drift = np.nanmax(np.linalg.norm(seen.position_px[-1] - seen.position_px[0], axis=1))
    if drift > MAX_DRIFT_PITCHES * pitch_px:
        sentences.append(
            f"a marker moved by {drift:.2f} px between the first and the last of the frames that were used: "
            "if the sheet was touched, record two seconds without touching it, and repeat"
        )
    if seen.compression_std_px > 0.0:
        sentences.append(COMPRESSED_VIDEO)
    contrast = float(np.nanmedian(seen.contrast))
    if contrast < MIN_CONTRAST_GREY:
        sentences.append(
            f"the contrast of the markers is only {contrast:.0f} of 255 grey levels: increase light or "
            f"contrast"
        )
    if given.layout is not None:
        relative_change = float(given.camera.translation_mm[2]) / float(camera.translation_mm[2]) - 1.0
        if abs(relative_change) > MAX_DISTANCE_ERROR:
            sentences.append(
                f"the sheet is at a distance of {camera.translation_mm[2]:.1f} mm, "
                f"{100 * abs(relative_change):.0f} % {'nearer' if relative_change > 0 else 'farther'} than "
                f"in the sensor file: check pitch_mm ({layout.pitch_mm[0]:g} mm) and the camera's calibration"
            )
    sentences += _border_warnings(found, px_per_mm)
    return sentences


def _focus_warnings(found: Sensor, frames: Sequence[Frame], roi_px: Roi | None) -> list[str]:
    """A warning if the dots are out of focus."""
    layout = found.layout
    assert layout is not None and layout.rest_px is not None  # noqa: PT018 - just found
    is_used = ~layout.is_missing
    image = next(frame.image for frame in frames if frame.image is not None)
    weights = expected_appearance(found).weights(1 if image.ndim == 2 else image.shape[2])
    radius_px = radius_in_image(found.camera, layout.rest_mm[is_used], layout.radius_mm[is_used])
    edge_px = edge_width_px(image, weights, layout.rest_px[is_used], radius_px, roi_px=roi_px)
    if not is_soft(edge_px, radius_px):
        return []
    return [f"the dots are out of focus: their edges are {edge_px:.1f} px wide; focus the lens on the sheet"]


def _border_warnings(found: Sensor, px_per_mm: float) -> list[str]:
    """Warnings about markers at the border of the image or outside the clamp."""
    layout, camera, sheet = found.layout, found.camera, found.sheet
    assert layout is not None
    place = _images(camera, sheet, layout.rest_mm[~layout.is_missing])
    room = np.minimum(place, np.array([camera.width_px, camera.height_px]) - 1 - place).min(axis=1)
    cut = int((room < layout.radius_mm[0] * px_per_mm).sum())
    sentences = [f"{cut} markers are cut by the border of the image"] if cut else []
    if sheet is not None:
        over = np.abs(layout.rest_mm[:, :2]) > sheet.size_mm / 2
        if over.any():
            sentences.append(
                f"{int(over.any(axis=1).sum())} markers lie outside the outline of "
                f"{sheet.size_mm[0]:g} x {sheet.size_mm[1]:g} mm: check size_mm and offset_mm"
            )
    return sentences
