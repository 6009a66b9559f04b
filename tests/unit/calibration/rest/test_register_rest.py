"""A sensor from frames at rest."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from flat_sensor import detections_of, rectangle_px
from manytouch.calibration import examine, register_rest, sensor_from_rest
from manytouch.calibration.rest import register_rest as reference
from manytouch.calibration.rest.assumed_sensor import sensor_from_dots
from manytouch.calibration.rest.local_bulge import bulge_in_pitches
from manytouch.calibration.rest.register_rest import (
    may_begin_pressed,
    register_dots,
    register_to_recording,
)
from manytouch.calibration.rest.shift_check import UNDETECTABLE_SHIFT
from manytouch.calibration.rest_dots import confirm_rest_dots, merge_rest_dots
from manytouch.errors import LayoutError, SensorError, SourceError
from manytouch.geometry.camera import mm_per_px, project
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.tracking import MarkerTracker
from manytouch.tracking.lattice.arrange import arrange
from manytouch.values import Frame, Roi, Status

WIDTH, HEIGHT = 640, 420


def grid_px(rows=7, columns=10, pitch=(50.0, 40.0), corner=(80.0, 70.0)):
    return rectangle_px(rows, columns, pitch, corner)


def dots_of(centre_px, status=Status.OK):
    return detections_of(centre_px, std_px=0.1, area_px2=150.0, status=status)


def noisy(points, frames=9, noise=0.1, seed=0):
    rng = np.random.default_rng(seed)
    return [dots_of(rng.permutation(points + rng.normal(0.0, noise, points.shape))) for _ in range(frames)]


def sensor_of(points, **options):
    return sensor_from_dots(
        merge_rest_dots(noisy(points)),
        name="any",
        width_px=WIDTH,
        height_px=HEIGHT,
        polarity="dark",
        **options,
    )


def test_rest_px_is_the_projection_of_rest_mm():
    sensor = sensor_of(grid_px())
    assert sensor.layout is not None
    assert sensor.layout.rest_px is not None
    np.testing.assert_allclose(
        project(sensor.camera, sensor.layout.rest_mm), sensor.layout.rest_px, atol=1e-6
    )
    np.testing.assert_allclose(sensor.layout.rest_px, grid_px(), atol=0.3)
    np.testing.assert_allclose(sensor.layout.rest_mm.mean(axis=0), 0.0, atol=1e-9)


def test_one_pitch_is_the_geometric_mean():
    sensor = sensor_of(grid_px())
    assert sensor.layout is not None
    assert sensor.length_unit == "pitch"
    assert sensor.layout.shape == (7, 10)
    np.testing.assert_allclose(np.prod(sensor.layout.pitch_mm), 1.0, rtol=1e-9)
    np.testing.assert_allclose(sensor.layout.pitch_mm[0] / sensor.layout.pitch_mm[1], 1.25, rtol=0.01)
    assert 0.05 < sensor.centre_noise_px < 0.15


@pytest.mark.parametrize("pitch_mm", [3.0, (2.5, 3.6)])
def test_pitch_mm_scales_lengths(pitch_mm):
    sensor = sensor_of(grid_px(), pitch_mm=pitch_mm)
    assert sensor.layout is not None
    assert sensor.length_unit == "mm"
    np.testing.assert_allclose(np.sqrt(np.prod(sensor.layout.pitch_mm)), 3.0, rtol=1e-9)
    (sentence,) = (each for each in sensor.assumptions if "geometric mean" in each)
    if isinstance(pitch_mm, tuple):
        assert "have the ratio 1 to" in sentence
    else:
        assert "differs by 25% along x and y" in sentence
        assert "give --pitch-mm X,Y" in sentence


def test_field_of_view_sets_the_focal_length_not_the_scale():
    wide, narrow = (sensor_of(grid_px(), hfov_deg=angle, pitch_mm=2.0) for angle in (90.0, 40.0))
    np.testing.assert_allclose(wide.camera.fx_px, 0.5 * WIDTH, rtol=1e-9)
    np.testing.assert_allclose(mm_per_px(wide.camera), mm_per_px(narrow.camera), rtol=1e-9)
    assert not any("field of view" in sentence for sentence in wide.assumptions)
    assert any("field of view is 60 degrees" in sentence for sentence in sensor_of(grid_px()).assumptions)


def test_missing_dots_are_listed_as_assumptions():
    kept = np.delete(grid_px(), [11, 45], axis=0)
    sensor = sensor_of(kept)
    assert sensor.layout is not None
    np.testing.assert_array_equal(np.flatnonzero(sensor.layout.is_missing), [11, 45])
    assert any(sentence.startswith("2 of 70 markers were not found") for sentence in sensor.assumptions)


def test_one_frame_is_enough():
    still = merge_rest_dots(noisy(grid_px(), frames=1))
    sensor = sensor_from_dots(still, name="one", width_px=WIDTH, height_px=HEIGHT, polarity="light")
    assert sensor.layout is not None
    assert sensor.layout.shape == (7, 10)
    assert sensor.centre_noise_px is None


def test_the_still_frames_are_taken_when_the_sheet_is_pressed_early():
    points = grid_px()
    bell = np.exp(-0.5 * (((points - points[33]) / 80.0) ** 2).sum(axis=1, keepdims=True))
    frames = noisy(points, frames=8)
    for k in range(7):
        frames += noisy(points + (4.0 + 4.0 * k) * bell * np.array([1.0, 0.4]), frames=1, seed=k)
    still = merge_rest_dots(frames)
    assert still.frames == tuple(range(8))
    assert still.moved
    sensor = sensor_from_dots(still, name="any", width_px=WIDTH, height_px=HEIGHT, polarity="dark")
    assert any("8 early frames" in sentence for sentence in sensor.assumptions)


@pytest.mark.parametrize(("early", "late", "expected"), [(7, 10, range(7)), (5, 10, range(5, 15))])
def test_the_earliest_group_of_frames_is_taken_unless_it_is_much_smaller(early, late, expected):
    """A sheet that stays displaced after a press: the rest before it counts, if it is long enough."""
    still = merge_rest_dots(noisy(grid_px(), frames=early) + noisy(grid_px() + 12.0, frames=late, seed=1))
    assert still.frames == tuple(expected)


def test_frames_with_a_bad_status_are_left_out():
    still = merge_rest_dots([dots_of(grid_px() + 9.0, status=Status.DARK), *noisy(grid_px(), frames=3)])
    assert still.frames == (1, 2, 3)


def test_a_press_at_the_start_is_an_assumption_and_perspective_is_not():
    points = grid_px(10, 12, pitch=(45.0, 35.0), corner=(60.0, 40.0))
    flat = arrange(points, np.zeros(len(points), dtype=bool))
    assert bulge_in_pitches(flat) < 1e-6
    away = points - points[65]
    bell = np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / 70.0**2)
    pressed = arrange(points + 0.5 * bell * away, np.zeros(len(points), dtype=bool))
    assert bulge_in_pitches(pressed) > 0.15
    tilted = points / (1.0 + 0.0004 * points[:, :1]) * (1.0 + 1e-7 * (away**2).sum(axis=1, keepdims=True))
    assert bulge_in_pitches(arrange(tilted, np.zeros(len(points), dtype=bool))) < 0.05


def test_too_few_dots_are_refused():
    with pytest.raises(LayoutError, match="only 3 dots"):
        sensor_of(grid_px()[:3])


@pytest.mark.parametrize("options", [{"pitch_mm": -1.0}, {"pitch_mm": (1.0, 0.0)}, {"hfov_deg": 190.0}])
def test_impossible_numbers_are_refused(options):
    with pytest.raises(SensorError, match="was given"):
        sensor_of(grid_px(), **options)


def turned(points, degrees, shift):
    angle = np.deg2rad(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    middle = points.mean(axis=0)
    return (points - middle) @ turn + middle + np.array(shift)


@pytest.mark.parametrize(("degrees", "shift"), [(0.0, (0.0, 0.0)), (2.0, (0.0, 0.0)), (-1.5, (15.0, -12.0))])
def test_a_known_sensor_is_referred_though_its_pose_is_off(degrees, shift):
    sensor = sensor_of(grid_px(9, 11, corner=(60.0, 40.0)))
    assert sensor.layout is not None
    moved = turned(sensor.layout.rest_px, degrees, shift)
    dots = np.random.default_rng(1).permutation(np.delete(moved, 20, axis=0))
    found = register_dots(sensor, dots)
    assert found.layout is not None
    rest = np.delete(found.layout.rest_px, 20, axis=0)
    np.testing.assert_allclose(rest, np.delete(moved, 20, axis=0), atol=1e-9)
    np.testing.assert_allclose(found.layout.rest_px[20], moved[20], atol=2.0)


def test_registration_passes_the_region_of_interest_to_tracking(monkeypatch):
    requested = []

    def spied(**options):
        requested.append(options["roi_px"])
        return MarkerTracker(**options)

    monkeypatch.setattr(reference, "MarkerTracker", spied)
    sensor = sensor_of(grid_px())
    assert sensor.layout is not None
    register_dots(sensor, sensor.layout.rest_px, roi_px=Roi(10, 20, 600, 380))
    assert requested == [Roi(10, 20, 600, 380)]


def test_markers_outside_the_region_of_interest_are_not_expected():
    sensor = sensor_of(grid_px())
    layout = sensor.layout
    assert layout is not None
    region = Roi(60, 50, 180, 200)
    is_inside = (layout.rest_px > [75.0, 65.0]).all(axis=1) & (layout.rest_px < [225.0, 235.0]).all(axis=1)
    assert is_inside.mean() < 0.3
    found = register_dots(sensor, layout.rest_px[is_inside], roi_px=region)
    assert not any("not seen" in sentence for sentence in found.assumptions)
    fewer = register_dots(sensor, layout.rest_px[is_inside][1:], roi_px=region)
    assert any(f"1 of {is_inside.sum()} markers were not seen" in each for each in fewer.assumptions)
    with pytest.raises(LayoutError, match=f"only 0 of the {is_inside.sum()} markers .* in the region"):
        register_dots(sensor, np.zeros((0, 2)), roi_px=region)
    with pytest.raises(LayoutError, match="only 0 of the 0 markers"):
        register_dots(sensor, np.zeros((0, 2)), roi_px=Roi(0, 0, 30, 30))


def test_a_recording_of_another_sheet_is_refused():
    sensor = sensor_of(grid_px())
    other = np.random.default_rng(2).uniform([50.0, 50.0], [600.0, 380.0], (25, 2))
    with pytest.raises(LayoutError, match="of the 70 markers"):
        register_dots(sensor, other)


def picture(points, radius=8, width=WIDTH, height=HEIGHT):
    image = np.full((height, width), 190, dtype=np.uint8)
    for x, y in points:
        centre = (round(16 * x), round(16 * y))
        cv2.circle(image, centre, 16 * radius, 60, -1, cv2.LINE_AA, 4)
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 1.5, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8)


def frames_of(image, count=4):
    return [Frame(index=k, timestamp_ns=k * 10**7, camera="test", image=image) for k in range(count)]


def test_from_pictures_to_a_sensor_and_back():
    points = turned(grid_px(), 3.0, (0.0, 0.0))
    frames = frames_of(picture(points))
    sensor = sensor_from_rest(frames, name="drawn")
    assert sensor.layout is not None
    assert sensor.layout.shape == (7, 10)
    assert sensor.layout.polarity == "dark"
    np.testing.assert_allclose(sensor.layout.rest_px, points, atol=0.2)
    moved = points + np.array([5.0, -4.0])
    again = register_rest(sensor, frames_of(picture(moved)))
    assert again.layout is not None
    np.testing.assert_allclose(again.layout.rest_px, moved, atol=0.2)
    report = examine(frames)
    assert (report.rows, report.columns, report.missing, report.dots) == (7, 10, 0, 70)
    assert report.residual_px < 0.3


def test_the_radii_of_the_dots_at_rest_are_measured():
    """A sensor file states one radius; a half-printed dot has another one."""
    points = turned(grid_px(), 3.0, (0.0, 0.0))
    sensor = sensor_from_rest(frames_of(picture(points)), name="drawn")
    image = picture(points)
    x, y = points[25].round().astype(int)
    image[y + 2 : y + 20, x - 15 : x + 15] = np.median(image)  # its lower half is not printed
    layout = register_rest(
        replace(sensor, layout=replace(sensor.layout, rest_px=None)), frames_of(image)
    ).layout
    assert layout.rest_radius_px is not None
    usual = np.median(layout.rest_radius_px)
    assert usual == pytest.approx(np.median(sensor.layout.radius_mm) / mm_per_px(sensor.camera), rel=0.1)
    assert layout.rest_radius_px[25] < 0.85 * usual
    others = np.delete(layout.rest_radius_px, 25)
    np.testing.assert_allclose(others, usual, rtol=0.1)


def test_a_wrong_polarity_of_the_file_is_corrected_and_reported():
    frames = frames_of(picture(grid_px()))
    sensor = sensor_from_rest(frames, name="drawn")
    wrong = replace(sensor, layout=replace(sensor.layout, polarity="light"), assumptions=())
    again = register_rest(wrong, frames)
    assert again.layout.polarity == "dark"
    assert "The markers are dark, although the sensor file specifies light." in again.assumptions
    silent = register_rest(replace(sensor, assumptions=()), frames[:1])
    assert silent.assumptions == ("The sheet is at rest in the first motionless frame.",)


def test_a_sensor_of_another_image_size_is_refused():
    sensor = sensor_of(grid_px())
    with pytest.raises(SensorError, match="640 x 420 px, but the input has 320 x 200 px"):
        register_rest(sensor, frames_of(np.zeros((200, 320), dtype=np.uint8)))


def test_frames_of_two_sizes_and_no_frames_are_refused():
    frames = frames_of(np.zeros((200, 320), dtype=np.uint8)) + frames_of(np.zeros((100, 320), dtype=np.uint8))
    with pytest.raises(SourceError, match="differ in size"):
        sensor_from_rest(frames, name="two")
    broken = [Frame(index=0, timestamp_ns=0, camera="test", image=None)]
    with pytest.raises(SourceError, match="none of the first 1 frames"):
        sensor_from_rest(broken, name="none")


def test_a_region_outside_the_image_is_refused():
    with pytest.raises(SourceError, match=r"does not lie inside.* 320 x 200 px"):
        examine(frames_of(np.zeros((200, 320), dtype=np.uint8)), roi_px=Roi(300, 10, 50, 50))


def pressed_px(sensor, depth_px):
    """Markers that move away from a place on the sheet, as under a press, by at most 0.6 times a length."""
    rest = project(sensor.camera, sensor.layout.rest_mm)
    away = rest - (rest.mean(axis=0) + np.array([150.0, -80.0]))
    return rest + depth_px * away / 90.0 * np.exp(-0.5 * (away**2).sum(axis=1, keepdims=True) / 90.0**2)


def test_a_sheet_that_is_touched_at_the_start_is_at_rest_where_its_file_has_it():
    sensor = demo_sensor(1280)
    touched = register_dots(sensor, pressed_px(sensor, 12.0))
    np.testing.assert_allclose(touched.layout.rest_px, project(sensor.camera, sensor.layout.rest_mm))
    assert (
        "the sheet was touched, and the places of the sensor file are taken as rest"
        in (touched.assumptions[-1])
    )
    measured = replace(sensor, layout=replace(sensor.layout, rest_px=pressed_px(sensor, 0.0) + 0.3))
    again = register_dots(measured, pressed_px(sensor, 6.0))
    np.testing.assert_array_equal(again.layout.rest_px, measured.layout.rest_px)


@pytest.mark.parametrize(("untouched", "pressed"), [((0, 4), (4, 15)), ((12, 15), (0, 12))])
def test_of_two_still_places_in_the_first_frames_the_one_of_the_sensor_file_is_rest(untouched, pressed):
    sensor = demo_sensor(1280)
    rest_px = pressed_px(sensor, 0.0)
    assert np.abs(pressed_px(sensor, 10.0) - rest_px).max() > 4.0
    image = {0: picture(rest_px, 5, 1280, 720), 1: picture(pressed_px(sensor, 10.0), 5, 1280, 720)}
    frames = [frame for k in range(15) for frame in frames_of(image[int(k in range(*pressed))], 1)]
    found = register_rest(replace(sensor, layout=replace(sensor.layout, polarity="dark")), frames)
    assert found.provenance["rest_frames"] == untouched[1] - untouched[0]
    assert np.abs(found.layout.rest_px - rest_px).max() < 0.5


@pytest.mark.parametrize(("later_px", "is_taken"), [(0.0, True), (9.0, False)])
def test_measured_places_replace_those_of_the_file_where_the_sheet_is_released(later_px, is_taken):
    """It is touched at first; later it is at rest, or touched less, with a print that is off by 0.4 px."""
    sensor = demo_sensor(1280)
    sensor = replace(sensor, layout=replace(sensor.layout, polarity="dark"))
    touched = frames_of(picture(pressed_px(sensor, 12.0), 5, 1280, 720), 5)
    registered = register_rest(sensor, touched)
    assert "the sheet was touched" in registered.assumptions[-1]
    assert may_begin_pressed(sensor, registered)
    later = frames_of(picture(pressed_px(sensor, later_px) + 0.4, 5, 1280, 720), 6)
    frames = [replace(frame, index=k) for k, frame in enumerate([*touched, *later])]
    found = register_to_recording(sensor, registered, frames, frame_count=len(frames))
    assert (found is not registered) == is_taken
    if is_taken:
        assert np.abs(found.layout.rest_px - pressed_px(sensor, 0.0) - 0.4).max() < 0.2
        assert not any("was touched" in sentence for sentence in found.assumptions)


def test_a_polarity_that_the_file_leaves_open_is_that_of_the_recording():
    sensor = demo_sensor(1280)
    sensor = replace(sensor, layout=replace(sensor.layout, polarity="auto"))
    touched = frames_of(picture(pressed_px(sensor, 12.0), 5, 1280, 720), 5)
    later = frames_of(picture(pressed_px(sensor, 0.0) + 0.4, 5, 1280, 720), 6)
    frames = [replace(frame, index=k) for k, frame in enumerate([*touched, *later])]
    registered = register_rest(sensor, touched)
    found = register_to_recording(sensor, registered, frames, frame_count=len(frames))
    assert found is not registered
    assert found.layout.polarity == registered.layout.polarity == "dark"


@pytest.mark.parametrize(("depth_px", "is_stated"), [(0.3, False), (3.0, True)])
def test_a_light_touch_or_an_uneven_print_is_stated(depth_px, is_stated):
    sensor = demo_sensor(1280)
    found = register_dots(sensor, pressed_px(sensor, depth_px))
    assert ("uneven print or a light touch: tare" in found.assumptions[-1]) == is_stated


def test_pose_lens_and_print_are_not_taken_for_a_touch():
    sensor = demo_sensor(1280)
    camera, rest_mm = sensor.camera, sensor.layout.rest_mm
    turned = replace(camera, rotation_vector=camera.rotation_vector + np.array([0.02, -0.015, 0.01]))
    other = replace(turned, fx_px=1.01 * camera.fx_px, distortion=np.array([-0.06, 0.01, 1e-3, 0.0, 0.0]))
    uneven = project(other, rest_mm)
    uneven[sensor.layout.row_column[:, 0] == 7] += np.array([0.0, 4.0])
    uneven += np.random.default_rng(1).normal(0.0, 1.0, uneven.shape)
    found = register_dots(sensor, uneven)
    assert found.assumptions[-1].startswith("The sheet is at rest in the first motionless frame.")
    assert np.mean(np.abs(found.layout.rest_px - uneven) < 1e-6) > 0.99


def test_glints_beyond_the_pattern_and_doubles_are_not_confirmed():
    points = grid_px()
    known = merge_rest_dots(noisy(np.delete(points, 25, axis=0), frames=1))
    beyond = points[:10] - np.array([0.0, 40.0])
    double = points[[3]] + np.array([8.0, 6.0])
    found = confirm_rest_dots(
        merge_rest_dots(noisy(np.concatenate([points, beyond, double]))), known, is_same_time=True
    )
    distance = np.linalg.norm(found.centre_px[:, None] - points[None], axis=-1)
    assert len(found.centre_px) == 70
    np.testing.assert_array_equal(np.sort(distance.argmin(axis=1)), np.arange(70))
    assert distance.min(axis=1).max() < 0.5


def overflowing():
    return grid_px(rows=11, columns=13, pitch=(50.0, 40.0), corner=(20.0, 10.0))


def test_a_regular_pattern_that_fills_the_view_gives_an_assumption():
    assert UNDETECTABLE_SHIFT in sensor_of(overflowing()).assumptions


@pytest.mark.parametrize("warnings", ["rim", "gap", "print", "area", "contrast"])
def test_a_detectable_shift_gives_no_assumption(warnings):
    points = grid_px() if warnings == "rim" else overflowing()
    chance = np.random.default_rng(5)
    if warnings == "gap":
        points = np.delete(points, 70, axis=0)
    elif warnings == "print":
        points = points + chance.normal(0.0, 1.0, points.shape)
    still = merge_rest_dots(noisy(points))
    unlike = 1.0 + 0.08 * chance.standard_normal(len(still.centre_px))
    if warnings == "area":
        still = replace(still, area_px2=still.area_px2 * unlike)
    elif warnings == "contrast":
        still = replace(still, contrast=still.contrast * unlike)
    sensor = sensor_from_dots(still, name="any", width_px=WIDTH, height_px=HEIGHT, polarity="dark")
    assert UNDETECTABLE_SHIFT not in sensor.assumptions


@pytest.mark.parametrize("pitch_mm", [0.0, 1e300, (4.0, 1e-300), float("nan")])
def test_a_pitch_without_a_size_is_refused(pitch_mm) -> None:
    with pytest.raises(SensorError, match="a pitch is a length from 1e-09 to 1e"):
        sensor_from_rest((), name="x", pitch_mm=pitch_mm)


def test_dots_that_the_border_of_the_region_cuts_do_not_change_the_pose():
    """Their centres are displaced by pixels."""
    sensor = demo_sensor()
    layout = sensor.layout
    assert layout is not None
    place_px = project(sensor.camera, layout.rest_mm)
    bottom_px = place_px[450, 1] + 5.0
    dots = place_px[(place_px > [200.0, 100.0]).all(axis=1) & (place_px < [600.0, bottom_px]).all(axis=1)]
    dots[dots[:, 1] > bottom_px - 12.0, 1] -= 3.0
    found = register_dots(sensor, dots, roi_px=Roi(200, 100, 400, round(bottom_px) - 100))
    np.testing.assert_allclose(found.camera.rotation_vector, sensor.camera.rotation_vector, atol=1e-4)
