"""Registration of a nominal sensor: rows, columns, pitch and pose are changed to those of the recording.

A nominal sensor file describes a kind of sensor. The device in the recording may have another print of
markers, and its camera another pose.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from manytouch.calibration.outline.pad_outline import pad_of
from manytouch.calibration.rest.assumed_sensor import sensor_from_rest
from manytouch.calibration.rest.pose import fit_pose
from manytouch.calibration.rest.register_rest import register_and_count, register_rest
from manytouch.errors import LayoutError
from manytouch.geometry.refraction import rest_px
from manytouch.values import Frame, Layout, Roi, Sensor
from manytouch.values.arrays import Points2, read_only

NOMINAL, NOMINAL_SHAPE = "nominal", "nominal_shape"
"""Key of `[provenance]` in the sensor files of the package, which describe a kind of sensor, not a device;
and that of a calibrated sensor, whose thickness and outline are still those of such a file."""
NOMINAL_NAME = " (nominal)"
"""End of the names of such sensors."""
MOST_RESIDUAL = 0.15
"""If the RMS residual of the fitted pose is larger, in pitches, the file describes another kind of sensor. A
choice: no residuals of sensors of that kind and of others are recorded, so that the range in which it
separates them is not known."""
_ADVICE = ": give the file of this sensor, calibrate one (manytouch calibrate rest), or leave the file out"
_SAME_PITCH = 0.12
"""If the logarithm of the ratio of the found to the expected pitch in the image is larger, the device has
another print; if it is smaller, the camera has another distance."""


def register_nominal(
    sensor: Sensor,
    frames: Sequence[Frame],
    *,
    pitch_mm: float | tuple[float, float] | None = None,
    roi_px: Roi | None = None,
    spread: Callable[[], Sequence[Frame]] | None = None,
) -> Sensor:
    """Register a nominal sensor: as `register_rest`, or with another layout if more markers are then found.

    The other layout has the rows, columns and pose that the frames show; camera and sheet stay. Its pitch is
    the nominal one if the pitch in the image differs by less than 12 % from the expected one. If it differs
    more, the device has another print: the distance of the camera stays, and the pitch follows from it. A
    pitch that is given counts instead, and the distance follows. The sensor lists what was changed as an
    assumption.

    Args:
        sensor: nominal, with a layout.
        frames: the first frames of the recording.
        pitch_mm: measured distance of neighbouring markers, or (x, y); None where it is not known.
        roi_px: x, y, width, height of the region of interest.
        spread: returns frames from all parts of the recording; called if the first ones show no lattice.

    Raises:
        SensorError, SourceError: see `register_rest`.
        LayoutError: the frames do not show the nominal markers, and no lattice that this camera may see.
    """
    assert sensor.layout is not None
    if pitch_mm is not None:
        found = sensor_from_rest(
            frames, name=sensor.name, pitch_mm=pitch_mm, roi_px=roi_px, spread=spread
        ).layout
        assert found is not None
        return register_rest(_with_print(sensor, found, pitch_mm), frames, roi_px=roi_px)
    usual = adapted = refused = None
    try:
        usual, usual_count = register_and_count(sensor, frames, roi_px=roi_px)
    except LayoutError as error:
        refused = error
    try:
        found = sensor_from_rest(frames, name=sensor.name, roi_px=roi_px, spread=spread).layout
        if found is not None and (usual is None or found.shape != sensor.layout.shape):
            adapted, adapted_count = register_and_count(_with_print(sensor, found), frames, roi_px=roi_px)
    except LayoutError as error:
        refused = error
    if usual is None:
        if adapted is None:
            assert refused is not None
            raise refused
        return adapted
    if adapted is None:
        return usual
    adapted_unseen = _present_count(adapted) - adapted_count
    usual_unseen = _present_count(usual) - usual_count
    return adapted if (adapted_count, -adapted_unseen) > (usual_count, -usual_unseen) else usual


def _present_count(sensor: Sensor) -> int:
    """Number of markers of the layout that are not missing."""
    assert sensor.layout is not None
    return int((~sensor.layout.is_missing).sum())


def _with_print(sensor: Sensor, found: Layout, given_mm: float | tuple[float, float] | None = None) -> Sensor:
    """The sensor with the rows, columns, missing markers and dot radii of a layout found in frames.

    Args:
        sensor: nominal, with a layout.
        found: the layout, in any unit of length.
        given_mm: its measured pitch; None derives it from that of the sensor.

    Raises:
        LayoutError: the camera of the sensor cannot see this layout as a plane.
    """
    nominal = sensor.layout
    assert nominal is not None
    if found.row_column is None or found.rest_px is None or nominal.row_column is None:
        raise LayoutError(f"the markers of this recording form no rows and columns{_ADVICE}")
    at_rest_px = rest_px(sensor, nominal)
    step_px, nominal_step_px = _steps(found.rest_px, found), _steps(at_rest_px, nominal)
    ratio = step_px / nominal_step_px
    is_same = given_mm is None and bool(np.all(np.abs(np.log(ratio)) < _SAME_PITCH))
    pitch_mm = np.array(nominal.pitch_mm) * (1.0 if is_same else ratio)
    if given_mm is not None:
        pitch_mm = np.array(np.broadcast_to(given_mm, 2), dtype=np.float64)
    middle_mm = np.zeros(2)
    if not is_same:  # another print need not be in the middle of the pad; the camera looks at the same place
        away_px = _middle(found.rest_px) - _middle(at_rest_px)
        middle_mm = away_px / step_px * pitch_mm + _middle(nominal.rest_mm[:, :2])
    rest_mm = np.zeros((len(found.rest_mm), 3))
    order = found.row_column - found.row_column.max(axis=0) / 2
    rest_mm[:, :2] = order[:, ::-1] * pitch_mm + middle_mm
    there = ~found.is_missing & np.isfinite(found.rest_px[:, 0])
    camera, _ = fit_pose(sensor.camera, rest_mm[there], found.rest_px[there], pad_of(sensor))
    adapted = replace(
        found,
        rest_mm=read_only(rest_mm),
        pitch_mm=read_only(pitch_mm),
        radius_mm=read_only(found.radius_mm / found.pitch_mm.mean() * pitch_mm.mean()),
        height_mm=nominal.height_mm,
        rest_px=None,
    )
    away = rest_px(replace(sensor, camera=camera, layout=adapted), adapted) - found.rest_px
    residual = float(np.sqrt(np.square(away[there]).sum(axis=1).mean()) / step_px.mean())
    shapes = [" x ".join(map(str, layout.shape or ("?",))) for layout in (found, nominal)]
    if residual > MOST_RESIDUAL:
        raise LayoutError(
            f"the recording shows {shapes[0]} markers that lie {100 * residual:.0f} % of a pitch (RMS) off a "
            f"plane in the camera of {sensor.name!r}: it is of another sensor, or something presses on it "
            f"where it begins: begin it untouched{_ADVICE.replace(':', ',', 1)}"
        )
    kept = "camera, pitch and sheet are" if is_same else "distance of the camera and sheet are"
    changed = "" if is_same else f" The pitch of {pitch_mm[0]:.2f} x {pitch_mm[1]:.2f} mm follows."
    if given_mm is not None:
        kept, changed = "the lens and the sheet are", " The pitch is the one that was given."
    sentence = (
        f"The sensor file is nominal: it has {shapes[1]} markers, but {shapes[0]} were found. Rows, columns "
        f"and pose are those of this recording; {kept} those of the file.{changed}"
    )
    return replace(sensor, camera=camera, layout=adapted, assumptions=(*sensor.assumptions, sentence))


def _steps(place_px: Points2, layout: Layout) -> Float64[np.ndarray, "2"]:
    """Median distances of neighbouring markers along x (columns) and y (rows), px."""
    assert layout.row_column is not None
    number = {(int(row), int(column)): k for k, (row, column) in enumerate(layout.row_column)}
    steps = []
    for after in ((0, 1), (1, 0)):
        pairs = [
            (k, number[row + after[0], column + after[1]])
            for (row, column), k in number.items()
            if (row + after[0], column + after[1]) in number
        ]
        away = np.linalg.norm(np.diff(place_px[np.array(pairs)], axis=1)[:, 0], axis=1)
        steps.append(float(np.nanmedian(away)))
    return np.array(steps)


def _middle(place: Points2) -> Float64[np.ndarray, "2"]:
    """The middle of the outline of points, of which some may be NaN."""
    return np.asarray(0.5 * (np.nanmin(place, axis=0) + np.nanmax(place, axis=0)))
