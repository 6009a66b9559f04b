"""The sheet and the frames that a calibration at rest starts from."""

from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from clips import COLUMNS, HEIGHT_PX, PITCH_PX, ROWS, WIDTH_PX
from drawn_source import DrawnSource, drawn
from layouts import lattice_layout
from manytouch.calibration import sensor_at_rest
from manytouch.calibration.rest.whole_recording import RestDoubt, SettledRest
from manytouch.calibration.sensor_at_rest import calibrate_sensor_at_rest, candidate_frames, stated_sheet
from manytouch.errors import SensorError
from manytouch.session.prepare import prepare
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Sensor, Sheet
from straight import straight_camera

SENSOR = demo_sensor()
PAD = Sheet(size_mm=np.array([20.0, 16.0]), thickness_mm=4.0, boundary="bonded", marker_depth_mm=1.0)


def test_a_size_without_a_thickness_is_refused_and_not_dropped() -> None:
    with pytest.raises(SensorError, match="90 x 70 mm, is given without its thickness"):
        stated_sheet(SENSOR, (90.0, 70.0), None)


def test_a_sheet_is_that_of_the_file_or_wholly_given() -> None:
    assert stated_sheet(SENSOR, None, None) is None
    assert stated_sheet(SENSOR, None, 2.0) is None
    given = stated_sheet(SENSOR, (90.0, 70.0), 2.0)
    assert given is not None
    assert (given.boundary, given.size_mm.tolist(), given.thickness_mm) == ("clamped", [90.0, 70.0], 2.0)


def test_each_of_size_and_thickness_replaces_that_of_a_pad() -> None:
    known = replace(SENSOR, sheet=PAD)
    wide, thin = stated_sheet(known, (25.0, 16.0), None), stated_sheet(known, None, 3.0)
    assert wide is not None
    assert thin is not None
    assert (wide.size_mm.tolist(), wide.thickness_mm, wide.marker_depth_mm) == ([25.0, 16.0], 4.0, 1.0)
    assert (thin.size_mm.tolist(), thin.thickness_mm, thin.marker_depth_mm) == ([20.0, 16.0], 3.0, 1.0)


PITCH_MM = (1.6, 1.7)
REST_PX = np.stack(
    np.meshgrid(
        0.5 * WIDTH_PX + (np.arange(COLUMNS) - 0.5 * (COLUMNS - 1)) * PITCH_PX[0],
        0.5 * HEIGHT_PX + (np.arange(ROWS) - 0.5 * (ROWS - 1)) * PITCH_PX[1],
    ),
    axis=-1,
).reshape(-1, 2)


def gel(**provenance: object) -> Sensor:
    """The sensor that `clips.picture` shows, on a pad."""
    return Sensor(
        name="gel",
        camera=straight_camera(WIDTH_PX, HEIGHT_PX, focal_px=300.0, distance_mm=15.0),
        layout=lattice_layout(ROWS, COLUMNS, PITCH_MM, radius_mm=0.35, polarity="dark"),
        sheet=Sheet(
            size_mm=np.array([18.0, 14.0]),
            thickness_mm=4.0,
            young_MPa=0.3,
            poisson=0.48,
            boundary="bonded",
            marker_depth_mm=0.5,
        ),
        provenance=provenance,
    )


def begins_pressed(frames: int, press_of: Callable[[int], float]) -> DrawnSource:
    return DrawnSource(frames=frames, is_touched=False, change=lambda index, _: drawn(press_of(index), index))


def error_px(sensor: Sensor) -> float:
    assert sensor.layout is not None
    assert sensor.layout.rest_px is not None
    return float(np.abs(sensor.layout.rest_px - REST_PX).max())


def held_at_first(index: int) -> float:
    return 9.0 if index < 40 else 0.0


def held_for_long(index: int) -> float:
    """Released after the frames that are read first."""
    return 9.0 if index < 100 else 0.0


@pytest.mark.parametrize(
    ("press_of", "provenance"),
    [
        (held_for_long, {"nominal": True}),
        pytest.param(held_at_first, {}, marks=pytest.mark.slow),
        pytest.param(held_for_long, {}, marks=pytest.mark.slow),
        pytest.param(held_at_first, {"nominal": True}, marks=pytest.mark.slow),
    ],
)
def test_a_recording_that_begins_pressed_is_calibrated_where_it_is_at_rest(
    press_of: Callable[[int], float], provenance: dict[str, object]
) -> None:
    source = begins_pressed(160, press_of)
    first = list(islice(source, 90))
    _, of_first = calibrate_sensor_at_rest(gel(**provenance), first, "press.mp4")
    assert error_px(of_first) > 5.0
    found = candidate_frames(gel(**provenance), source, first)
    assert all(press_of(frame.index) == 0.0 for frame in found.frames)
    (note,) = found.notes
    assert "begins touched" in note
    assert not found.doubts
    lines, sensor = calibrate_sensor_at_rest(
        gel(**provenance), found.frames, "press.mp4", doubts=found.doubts
    )
    assert error_px(sensor) < 0.2
    assert any(f"of the frames {found.frames[0].index} to {found.frames[-1].index}" in line for line in lines)


def test_a_recording_that_begins_untouched_is_calibrated_on_its_first_frames() -> None:
    source = begins_pressed(120, lambda index: 9.0 if 95 <= index < 110 else 0.0)
    first = list(islice(source, 90))
    found = candidate_frames(gel(), source, first)
    assert found.frames is first
    assert not found.notes
    assert not found.doubts


def test_two_arrangements_as_common_as_each_other_are_a_warning_of_the_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def doubtful(sensor: Sensor, *_: object, **__: object) -> SettledRest:
        return SettledRest(sensor=sensor, doubt=RestDoubt.EQUALLY_COMMON)

    monkeypatch.setattr(sensor_at_rest, "rest_of_recording", doubtful)
    source = begins_pressed(20, lambda _: 0.0)
    found = candidate_frames(gel(), source, first := list(source))
    assert found.frames is first
    (doubt,) = found.doubts
    assert "about as common" in doubt
    _, sensor = calibrate_sensor_at_rest(gel(), found.frames, "press.mp4", doubts=found.doubts)
    warnings = sensor.provenance["rest_warnings"]
    assert isinstance(warnings, list)
    assert doubt in warnings


def test_a_camera_and_pictures_are_calibrated_on_their_first_frames() -> None:
    source = replace(begins_pressed(60, held_at_first), is_live=True)
    first = list(islice(source, 50))
    assert candidate_frames(gel(), source, first).frames is first


@pytest.mark.parametrize("press_of", [held_at_first, pytest.param(held_for_long, marks=pytest.mark.slow)])
def test_a_calibrated_pad_has_the_rest_of_the_whole_recording_when_it_is_processed(
    press_of: Callable[[int], float],
) -> None:
    def registered(*, whole_recording: bool) -> Sensor:
        job = prepare(begins_pressed(160, press_of), sensor=gel(), whole_recording=whole_recording)
        return job.sensor

    assert error_px(registered(whole_recording=False)) > 5.0
    assert error_px(registered(whole_recording=True)) < 0.2


def clamped() -> Sensor:
    """The sensor that `clips.picture` shows, as a clamped sheet."""
    size_mm = np.array([(COLUMNS + 1) * PITCH_MM[0], (ROWS + 1) * PITCH_MM[1]])
    return replace(gel(), sheet=Sheet(size_mm=size_mm, thickness_mm=2.0, young_MPa=0.5, poisson=0.45))


def registered_sheet(press_of: Callable[[int], float], *, whole_recording: bool = True) -> tuple[Sensor, int]:
    """The sheet, registered to a recording of 100 frames, and how many frames were read for it."""
    source = begins_pressed(100, press_of)
    job = prepare(source, sensor=clamped(), whole_recording=whole_recording)
    return job.sensor, len(source.taken)


@pytest.mark.parametrize("press_px", [2.0, 9.0])
def test_a_known_sheet_that_is_pressed_at_first_is_at_rest_where_its_markers_are_nearest_to_its_file(
    press_px: float,
) -> None:
    def press_of(index: int) -> float:
        return press_px if index < 40 else 0.0

    first, _ = registered_sheet(press_of, whole_recording=False)
    assert error_px(first) > 0.5
    sensor, read = registered_sheet(press_of)
    assert read > 100
    assert error_px(sensor) < 0.2
    assert any("nearest to their places in the sensor file" in line for line in sensor.assumptions)
    still = sensor.provenance["still_frames"]
    assert isinstance(still, list)
    assert min(still) >= 40
    assert sensor.rest_frames == len(still)


def test_a_known_sheet_that_begins_untouched_is_not_read_twice() -> None:
    sensor, read = registered_sheet(lambda index: 9.0 if 30 <= index < 90 else 0.0)
    assert error_px(sensor) < 0.2
    assert read <= 16


def test_a_known_sheet_that_is_pressed_throughout_keeps_what_its_first_frames_show() -> None:
    sensor, _ = registered_sheet(lambda _: 2.0)
    assert sensor.provenance["rest_frames"] == 15


def test_images_are_a_recording_where_their_rate_is_known() -> None:
    """Others need not follow each other in time, so that their first ones are the rest."""

    def registered(fps: float | None) -> Sensor:
        source = replace(begins_pressed(160, held_at_first), is_images=True, fps=fps)
        return prepare(source, sensor=gel(), whole_recording=True).sensor

    assert error_px(registered(30.0)) < 0.2
    assert error_px(registered(None)) > 5.0


def test_a_calibrated_pad_keeps_the_first_frames_where_the_rest_would_be_doubtful() -> None:
    source = begins_pressed(60, lambda index: 0.0 if index < 15 else 0.4 * (index % 12))
    sensor = prepare(source, sensor=gel(), whole_recording=True).sensor
    assert not sensor.rest_is_doubtful
    assert error_px(sensor) < 0.2


@pytest.mark.parametrize(
    ("sheet_mm", "thickness_mm"), [((1e9, 80.0), 3.0), ((120.0, 80.0), 1e300), ((120.0, 80.0), 1e-9)]
)
def test_a_sheet_that_is_not_computed_is_refused(sheet_mm, thickness_mm: float) -> None:
    with pytest.raises(SensorError, match="is not computed: its longer side has at most 10000 thicknesses"):
        stated_sheet(demo_sensor(320), sheet_mm, thickness_mm)
