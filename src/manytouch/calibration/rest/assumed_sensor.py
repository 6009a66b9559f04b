"""A sensor from the first frames of a recording alone: a measured layout and an assumed camera.

The camera is assumed to be a pinhole without distortion whose optical axis is normal to the sheet, so lengths
on the sheet are pixels times one scale. The sensor's `assumptions` list what the image does not determine.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import NoneType

import numpy as np

from manytouch.calibration.rest.first_frames import (
    IN_FRONT_OF_A_SCENE,
    arrange_rest_dots,
    find_rest_dots,
    image_size,
)
from manytouch.calibration.rest.local_bulge import PRESSED_PITCHES, START_IS_REST, bulge_in_pitches
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.rest.shift_check import UNDETECTABLE_SHIFT, shift_is_undetectable
from manytouch.calibration.rest_dots import RestDots
from manytouch.calibration.separate_groups import separate_regions
from manytouch.errors import SensorError, require_type
from manytouch.geometry.camera import onto_plane
from manytouch.limits import LARGEST_NUMBER, LEAST_HFOV_DEG, MOST_HFOV_DEG
from manytouch.tracking.lattice.arrange import Arrangement
from manytouch.values import Camera, Frame, Layout, Polarity, Roi, Sensor
from manytouch.values.arrays import plain, read_only
from manytouch.values.images.roi import require_roi
from manytouch.values.sensor_file.assumed_sheet import ASSUMED_SHEET, assumed_sheet

__all__ = ["register_rest", "sensor_from_dots", "sensor_from_rest"]

ASSUMED_HFOV_DEG = 60.0
_ODD_PITCHES = 0.03


def sensor_from_rest(
    frames: Sequence[Frame],
    *,
    name: str,
    pitch_mm: float | tuple[float, float] | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
    spread: Callable[[], Sequence[Frame]] | None = None,
) -> Sensor:
    """Build a sensor from the first frames of any recording of a sheet with dots.

    Args:
        frames: the first frames of the recording, untouched in most of them; one is enough.
        name: of the sensor.
        pitch_mm: spacing of the markers, the geometric mean of both directions or (x, y); None gives
            lengths in pitches.
        hfov_deg: horizontal field of view of the camera; 60 degrees when not given.
        roi_px: x, y, width, height of the region of interest.
        spread: returns frames of the whole recording, used where the first ones show no clear pattern.

    Returns:
        A sensor whose layout contains the measured `rest_px`, `rest_mm` being their back-projection.

    Raises:
        SourceError: no frame could be decoded, or frames differ in size.
        SensorError: an impossible pitch, field of view or region.
        LayoutError: too few dots.
    """
    expected = "a list of frames, such as list(itertools.islice(manytouch.open_source('press.mp4'), 15))"
    require_type("frames", frames, (list, tuple), expected)
    for frame in frames:
        require_type("one of the frames", frame, Frame, expected)
    require_type("the name of the sensor", name, str, "a text")
    require_roi(roi_px)
    pitch_mm, hfov_deg = plain(pitch_mm), plain(hfov_deg)
    _check_numbers(pitch_mm, hfov_deg)
    width, height = image_size(frames, roi_px)
    appearance, still, notes = find_rest_dots(frames, roi_px, spread)
    sensor = sensor_from_dots(
        still,
        name=name,
        width_px=width,
        height_px=height,
        polarity=appearance.polarity,
        colour_weights=appearance.colour_weights,
        pitch_mm=pitch_mm,
        hfov_deg=hfov_deg,
        roi_px=roi_px,
    )
    assert sensor.layout is not None
    layout = replace(sensor.layout, is_before_scene=IN_FRONT_OF_A_SCENE in notes)
    return replace(sensor, layout=layout, assumptions=sensor.assumptions + notes)


def sensor_from_dots(
    still: RestDots,
    *,
    name: str,
    width_px: int,
    height_px: int,
    polarity: Polarity,
    colour_weights: np.ndarray | None = None,
    pitch_mm: float | tuple[float, float] | None = None,
    hfov_deg: float | None = None,
    roi_px: Roi | None = None,
) -> Sensor:
    """As `sensor_from_rest`, from dots that were detected before."""
    _check_numbers(pitch_mm, hfov_deg)
    arrangement = arrange_rest_dots(still, width_px, height_px, roi_px)
    pitch_px = float(np.sqrt(np.prod(arrangement.pitch_px)))
    wanted = 1.0 if pitch_mm is None else float(np.sqrt(np.prod(np.broadcast_to(pitch_mm, 2))))
    focal_px = 0.5 * width_px / np.tan(np.deg2rad(0.5 * float(hfov_deg or ASSUMED_HFOV_DEG)))
    camera = _camera(arrangement, width_px, height_px, focal_px, wanted / pitch_px)
    layout = _layout(
        arrangement,
        still,
        camera,
        mm_per_px=wanted / pitch_px,
        polarity=polarity,
        colour_weights=colour_weights,
    )
    noise = still.noise_px[np.isfinite(still.noise_px)]
    shown_px = arrangement.centre_px[arrangement.dot >= 0]
    regions = separate_regions(shown_px, width_px, height_px) if roi_px is None else ()
    sensor = Sensor(
        name=name,
        camera=camera,
        layout=layout,
        sheet=assumed_sheet(layout),
        scale_is_known=pitch_mm is not None,
        centre_noise_px=float(np.median(noise)) if len(still.frames) >= 5 and len(noise) else None,
        assumptions=tuple(_assumptions(arrangement, still, pitch_mm, hfov_deg, regions)),
        provenance={
            "made_by": "manytouch",
            "from": "first frames at rest",
            "still_frames": list(still.frames),
            "unmoved_frames": still.unmoved,
        },
    )
    if shift_is_undetectable(sensor, still, roi_px=roi_px):
        return replace(sensor, assumptions=(*sensor.assumptions, UNDETECTABLE_SHIFT))
    return sensor


def _check_numbers(pitch_mm: float | tuple[float, float] | None, hfov_deg: float | None) -> None:
    for pitch in pitch_mm if isinstance(pitch_mm, tuple) else (1.0 if pitch_mm is None else pitch_mm,):
        require_type("pitch_mm", pitch, (int, float), "a length in mm, or two: (x, y)")
    require_type("hfov_deg", hfov_deg, (int, float, NoneType), "an angle in degrees")
    least = 1.0 / LARGEST_NUMBER
    pitches = np.asarray(1.0 if pitch_mm is None else pitch_mm)
    if pitches.size not in (1, 2) or not np.all((pitches >= least) & (pitches <= LARGEST_NUMBER)):
        raise SensorError(
            f"a pitch of {pitch_mm} mm was given, but a pitch is a length from {least:g} to "
            f"{LARGEST_NUMBER:g} mm, or two: P or X,Y"
        )
    if hfov_deg is not None and not LEAST_HFOV_DEG <= hfov_deg <= MOST_HFOV_DEG:
        raise SensorError(
            f"a horizontal field of view of {hfov_deg} degrees was given, but it must lie between "
            f"{LEAST_HFOV_DEG:g} and {MOST_HFOV_DEG:g}"
        )


def _camera(
    arrangement: Arrangement, width_px: int, height_px: int, focal_px: float, mm_per_px: float
) -> Camera:
    """A camera normal to the sheet whose axis meets the image centre, with the layout centred on the
    sheet's origin."""
    centre_px = np.array([0.5 * (width_px - 1), 0.5 * (height_px - 1)])
    middle_px = 0.5 * (arrangement.centre_px.min(axis=0) + arrangement.centre_px.max(axis=0))
    if arrangement.row_column is not None:
        middle_px = arrangement.centre_px.mean(axis=0)
    offset = mm_per_px * (middle_px - centre_px)
    return Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=float(centre_px[0]),
        cy_px=float(centre_px[1]),
        distortion=read_only(np.zeros(5)),
        rotation_vector=read_only(np.zeros(3)),
        translation_mm=read_only(np.array([offset[0], offset[1], focal_px * mm_per_px])),
    )


def _layout(
    arrangement: Arrangement,
    still: RestDots,
    camera: Camera,
    *,
    mm_per_px: float,
    polarity: Polarity,
    colour_weights: np.ndarray | None,
) -> Layout:
    is_missing = arrangement.dot < 0
    rest_px = arrangement.centre_px.copy()
    radius_px = np.sqrt(still.area_px2[np.maximum(arrangement.dot, 0)] / np.pi)
    radius_px[is_missing] = np.median(radius_px[~is_missing])
    return Layout(
        rest_mm=read_only(onto_plane(camera, rest_px)),
        row_column=arrangement.row_column,
        pitch_mm=read_only(mm_per_px * arrangement.pitch_px),
        radius_mm=read_only(mm_per_px * radius_px),
        polarity=polarity,
        colour_weights=None
        if colour_weights is None
        else read_only(np.array(colour_weights, dtype=np.float64)),
        is_missing=read_only(is_missing),
        rest_px=read_only(rest_px),
    )


def _assumptions(
    arrangement: Arrangement,
    still: RestDots,
    pitch_mm: float | tuple[float, float] | None,
    hfov_deg: float | None,
    regions: tuple[Roi, ...],
) -> list[str]:
    """One sentence for each property that the frames do not determine."""
    sentences = ["The camera has no lens distortion and looks straight at the sheet."]
    if hfov_deg is None:
        sentences.append(f"The camera's horizontal field of view is {ASSUMED_HFOV_DEG:.0f} degrees.")
    if pitch_mm is None:
        sentences.append("The scale is not known, so lengths are in pitches.")
    elif isinstance(pitch_mm, tuple):
        given = pitch_mm[0] / pitch_mm[1]
        seen = float(arrangement.pitch_px[0] / arrangement.pitch_px[1])
        if abs(np.log(given / seen)) > _ODD_PITCHES:
            sentences.append(
                f"The given pitches in x and y have the ratio 1 to {1.0 / given:.3f}, those in the image 1 "
                f"to {1.0 / seen:.3f}; their geometric mean sets the scale."
            )
    elif abs(differs := float(np.log(arrangement.pitch_px[0] / arrangement.pitch_px[1]))) > _ODD_PITCHES:
        sentences.append(
            f"The pitch in the image differs by {np.expm1(abs(differs)):.0%} along x and y; {pitch_mm:g} mm "
            "is taken as the geometric mean of both: give --pitch-mm X,Y if they differ on the sheet."
        )
    sentences.append(ASSUMED_SHEET)
    if still.moved and len(still.frames) == 1:
        sentences.append(
            "The sheet is at rest in the early frame in which its markers are most evenly spaced. They move "
            "between all of the early frames, so this is doubtful: begin the recording untouched."
        )
    elif still.moved:
        sentences.append(
            f"The sheet is at rest in the {len(still.frames)} early frames in which the dots do not move."
        )
    else:
        first = "frame" if len(still.frames) == 1 else f"{len(still.frames)} frames"
        sentences.append(f"The sheet is at rest in the first {first}.")
    sentences += _shape_assumptions(arrangement)
    if len(regions) > 1:
        listed = " and ".join(f"--roi {','.join(map(str, region))}" for region in regions)
        sentences.append(
            f"The markers are in {len(regions)} groups that are apart, such as views of a sheet in mirrors. "
            f"Groups that move differently lose markers: process each by itself, with {listed}."
        )
    return sentences


def _shape_assumptions(arrangement: Arrangement) -> list[str]:
    sentences = []
    missing = int((arrangement.dot < 0).sum())
    if missing:
        sentences.append(
            f"{missing} of {len(arrangement.dot)} markers were not found at the start and are treated "
            f"as missing."
        )
    bulge = bulge_in_pitches(arrangement)
    if bulge > PRESSED_PITCHES:
        sentences.append(
            f"The markers depart from a regular lattice by {bulge:.2f} pitches at one place at the start: "
            f"the pattern is uneven there, or the sheet was touched; {START_IS_REST}"
        )
    if arrangement.row_column is None:
        sentences.append(
            "The markers do not form a rectangle of rows and columns; they are numbered as a table."
        )
    return sentences
