"""The untouched sheet before a known camera: pose, layout, noise, and what is warnings."""

import re
from dataclasses import replace
from itertools import islice

import cv2
import numpy as np
import pytest

from manytouch.calibration.outline.clamp_line import describe, force_change
from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.rest.pose import adapt_pose, fit_pose, pose_std_by_lens
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.rest.rest_report import describe as describe_rest
from manytouch.cli import main
from manytouch.errors import LayoutError, SensorError
from manytouch.geometry.camera import onto_plane, project
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.scene.deformation import flat
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.tracking import COMPRESSED_VIDEO
from manytouch.values import Sheet
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor

TURN = np.array([0.05, -0.03, 0.02])
SHIFT = np.array([2.0, -1.5, 121.0])


def tilted_sensor(missing: int = 0):
    sensor = demo_sensor(1280)
    is_missing = np.zeros(len(sensor.layout.rest_mm), dtype=bool)
    is_missing[100 : 100 + 7 * missing : 7] = True
    return replace(
        sensor,
        camera=replace(sensor.camera, rotation_vector=TURN, translation_mm=SHIFT),
        layout=replace(sensor.layout, is_missing=is_missing),
    )


def frames_of(sensor, count: int = 5):
    scene = SolidScene(
        name="rest", time_s=np.array([0.0, 5.0]), states=(flat((120.0, 80.0)),) * 2, duration_s=5.0
    )
    simulator = Simulator(sensor=sensor, scene=scene)
    return [simulator.frame(index) for index in range(count)]


@pytest.fixture(scope="module")
def tilted_frames():
    return frames_of(tilted_sensor(missing=5))


@pytest.fixture(scope="module")
def rested(tilted_frames):
    return calibrate_rest(camera_only(tilted_sensor()), tilted_frames, pitch_mm=4.0)


def camera_only(sensor):
    nowhere = {"rotation_vector": np.zeros(3), "translation_mm": np.array([0.0, 0.0, 1.0])}
    return replace(sensor, camera=replace(sensor.camera, **nowhere), layout=None, sheet=None)


def test_pose_and_layout_are_found_from_the_camera_and_the_pitch(rested):
    camera, layout = rested.sensor.camera, rested.sensor.layout
    assert camera.rotation_vector == pytest.approx(TURN, abs=5e-4)
    assert camera.translation_mm == pytest.approx(SHIFT, abs=0.05)
    assert layout.shape == (20, 30)
    assert np.flatnonzero(layout.is_missing).tolist() == [100, 107, 114, 121, 128]
    assert layout.radius_mm[0] == pytest.approx(1.0, abs=0.05)
    assert rested.rms_px < 0.05
    assert 0.002 < rested.noise_px < 0.05


def test_a_polarity_that_the_file_leaves_open_is_determined(tilted_frames):
    given = tilted_sensor()
    found = calibrate_rest(replace(given, layout=replace(given.layout, polarity="auto")), tilted_frames)
    assert found.sensor.layout.polarity == given.layout.polarity
    assert found.sensor.camera.translation_mm == pytest.approx(SHIFT, abs=0.05)


def test_a_layout_that_is_known_keeps_its_numbers_and_gets_the_pose(tilted_frames):
    near = tilted_sensor()
    near = replace(near, camera=replace(near.camera, translation_mm=SHIFT + np.array([0.4, -0.3, 2.0])))
    found = calibrate_rest(near, tilted_frames)
    assert found.sensor.camera.translation_mm == pytest.approx(SHIFT, abs=0.05)
    assert found.sensor.layout.rest_mm == pytest.approx(near.layout.rest_mm)
    assert "5 markers were not seen and are treated as missing" in found.warnings
    with_four = replace(
        near.layout, is_missing=np.isin(np.arange(len(near.layout.rest_mm)), [100, 107, 114, 121])
    )
    found = calibrate_rest(replace(near, layout=with_four), tilted_frames)
    assert "1 marker was not seen and is treated as missing" in found.warnings


def test_predicted_deviations_match_the_errors_of_the_pose():
    sensor = tilted_sensor()
    place = project(sensor.camera, sensor.layout.rest_mm)
    chance = np.random.default_rng(2)
    errors = []
    for _ in range(20):
        camera, std = fit_pose(
            sensor.camera, sensor.layout.rest_mm, place + chance.normal(0.0, 0.3, place.shape)
        )
        wrong = np.concatenate([camera.rotation_vector - TURN, camera.translation_mm - SHIFT])
        errors.append(wrong / std)
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.3


def stated_pose(off_deg=0.0, **stds):
    """The camera of the tilted sensor, stated about x and z otherwise than it is, and markers at rest."""
    sensor = tilted_sensor()
    turn = np.deg2rad(off_deg) * np.array([1.0, 0.0, -1.0])
    camera = replace(sensor.camera, rotation_vector=TURN + turn, **stds)
    return camera, sensor.layout.rest_mm, project(sensor.camera, sensor.layout.rest_mm)


@pytest.mark.parametrize("off_deg", [0.2, -2.0])
def test_a_stated_pose_is_adapted_to_the_markers_at_rest(off_deg):
    camera, rest_mm, place_px = stated_pose(off_deg)
    print_px = np.random.default_rng(3).normal(0.0, 0.3, place_px.shape)
    found = adapt_pose(camera, rest_mm, place_px + print_px)
    assert found.rotation_vector == pytest.approx(TURN, abs=np.deg2rad(0.05))
    wrong = np.abs(found.rotation_vector - TURN) / found.rotation_vector_std
    assert (wrong < 3.0).all()
    assert found.rotation_vector_std.max() < np.deg2rad(0.1)


def test_markers_on_one_line_turn_the_camera_by_no_revolutions():
    camera, rest_mm, place_px = stated_pose(2.0)
    on_line = rest_mm[:, 1] == rest_mm[0, 1]
    print_px = np.random.default_rng(3).normal(0.0, 30.0, (int(on_line.sum()), 2))
    found = adapt_pose(camera, rest_mm[on_line], place_px[on_line] + print_px)
    assert np.linalg.norm(found.rotation_vector - camera.rotation_vector) < 2.0 * np.pi


def test_the_markers_count_less_where_they_do_not_fit_the_sheet():
    camera, rest_mm, place_px = stated_pose(0.2)
    sag_mm = np.prod(np.cos(np.pi * rest_mm[:, :2] / [130.0, 90.0]), axis=1) * rest_mm[:, 0] / 60.0
    sagging = project(tilted_sensor().camera, rest_mm + 2.0 * sag_mm[:, None] * [0.0, 0.0, 1.0])
    flat, bent = (adapt_pose(camera, rest_mm, seen) for seen in (place_px, sagging))
    assert (bent.rotation_vector_std[:2] > 1.5 * flat.rotation_vector_std[:2]).all()


def test_a_number_that_is_exact_is_not_adapted():
    camera, rest_mm, place_px = stated_pose(
        0.2, rotation_vector_std=np.array([0.0, 0.01, 0.0]), translation_std_mm=np.zeros(3)
    )
    found = adapt_pose(camera, rest_mm, place_px)
    assert (found.rotation_vector[[0, 2]] == camera.rotation_vector[[0, 2]]).all()
    assert (found.translation_mm == camera.translation_mm).all()
    exact = replace(camera, rotation_vector_std=np.zeros(3))
    assert adapt_pose(exact, rest_mm, place_px) is exact


def test_a_recording_adapts_the_pose_of_a_sheet_but_not_that_of_a_pad(tilted_frames):
    sensor = tilted_sensor()
    turned = replace(sensor.camera, rotation_vector=TURN + np.deg2rad([0.3, -0.3, 0.2]))
    near = replace(sensor, camera=turned)
    assert register_rest(near, tilted_frames).camera.rotation_vector == pytest.approx(TURN, abs=3e-4)
    pad = replace(near.sheet, boundary="bonded", marker_depth_mm=0.5, pretension_N_per_mm=None)
    assert register_rest(replace(near, sheet=pad), tilted_frames).camera is turned
    assert not any("inclined" in sentence for sentence in register_rest(near, tilted_frames).assumptions)
    far = replace(near, camera=replace(turned, rotation_vector=TURN + np.deg2rad([1.2, 1.6, 0.0])))
    said = register_rest(far, tilted_frames).assumptions[-1]
    assert "The camera is inclined by 2.0 degrees against the pose in the sensor file" in said


def test_the_deviations_of_the_pose_contain_those_of_the_lens():
    sensor = tilted_sensor()
    place, rest_mm = project(sensor.camera, sensor.layout.rest_mm), sensor.layout.rest_mm
    lens_std = np.array([3e-3, 0.0, 4e-4, 4e-4, 0.0])
    lens = replace(
        sensor.camera,
        fx_std_px=8.0,
        fy_std_px=8.0,
        cx_std_px=5.0,
        cy_std_px=5.0,
        distortion_std=lens_std,
    )
    chance = np.random.default_rng(3)
    errors = []
    for _ in range(20):
        focal, x_px, y_px = chance.normal(0.0, [8.0, 5.0, 5.0])
        given = replace(
            lens,
            fx_px=lens.fx_px + focal,
            fy_px=lens.fy_px + focal,
            cx_px=lens.cx_px + x_px,
            cy_px=lens.cy_px + y_px,
            distortion=lens.distortion + chance.normal(0.0, lens_std),
        )
        camera, _ = fit_pose(given, rest_mm, place)
        wrong = np.concatenate([camera.rotation_vector - TURN, camera.translation_mm - SHIFT])
        errors.append(wrong / pose_std_by_lens(lens, rest_mm))
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.3
    none = dict.fromkeys(("fx_std_px", "fy_std_px", "cx_std_px", "cy_std_px"), 0.0)
    exact = replace(lens, **none, distortion_std=0.0 * lens_std)
    np.testing.assert_allclose(pose_std_by_lens(exact, rest_mm), 0.0, atol=1e-12)


def test_the_deviations_of_the_pose_are_written(rested, tmp_path):
    save_sensor(rested.sensor, tmp_path / "rested.toml")
    camera = load_sensor(tmp_path / "rested.toml").camera
    np.testing.assert_array_equal(camera.rotation_vector_std, rested.pose_std[:3])
    np.testing.assert_array_equal(camera.translation_std_mm, rested.pose_std[3:])
    # the focal length is known to 0.3 % where the file does not state more, and so is the distance
    assert camera.translation_std_mm[2] == pytest.approx(0.003 * SHIFT[2], rel=0.05)
    assert 0.0 < camera.rotation_vector_std.max() < np.deg2rad(0.2)


def test_the_pose_is_found_through_a_fisheye_lens():
    sensor = tilted_sensor()
    lens = replace(sensor.camera, model="fisheye", distortion=np.array([0.08, -0.03, 0.01, 0.0]))
    found = calibrate_rest(
        camera_only(replace(sensor, camera=lens)), frames_of(replace(sensor, camera=lens)), pitch_mm=4.0
    )
    camera, layout = found.sensor.camera, found.sensor.layout
    assert camera.model == "fisheye"
    assert camera.rotation_vector == pytest.approx(TURN, abs=5e-4)
    assert camera.translation_mm == pytest.approx(SHIFT, abs=0.05)
    assert layout.shape == (20, 30)
    assert found.rms_px < 0.05


def test_a_wrong_scale_is_odd(tilted_frames):
    found = calibrate_rest(tilted_sensor(), tilted_frames, pitch_mm=4.4)
    assert any("9 % farther than in the sensor file" in sentence for sentence in found.warnings), (
        found.warnings
    )
    assert found.sensor.camera.translation_mm[2] == pytest.approx(1.1 * SHIFT[2], rel=2e-3)


def test_unequal_pitches_given_as_equal_leave_a_residual(tilted_frames):
    given = tilted_sensor()
    rest_mm = given.layout.rest_mm * [1.0, 1.06, 1.0]
    found = calibrate_rest(replace(given, layout=replace(given.layout, rest_mm=rest_mm)), tilted_frames)
    assert any("off a flat lattice" in sentence for sentence in found.warnings)


def test_markers_outside_the_clamp_are_odd(tilted_frames):
    small = Sheet(size_mm=np.array([100.0, 80.0]), thickness_mm=3.0)
    found = calibrate_rest(tilted_sensor(), tilted_frames, sheet=small)
    assert any("lie outside the outline of 100 x 80 mm" in sentence for sentence in found.warnings)
    assert found.sensor.sheet is small


def test_dots_out_of_focus_are_odd(rested, tilted_frames):
    blurred = [replace(frame, image=cv2.GaussianBlur(frame.image, (0, 0), 3.5)) for frame in tilted_frames]
    soft = calibrate_rest(camera_only(tilted_sensor()), blurred, pitch_mm=4.0)
    assert not any("out of focus" in sentence for sentence in rested.warnings)
    (sentence,) = [sentence for sentence in soft.warnings if "out of focus" in sentence]
    width = float(re.search(r"edges are ([\d.]+) px wide", sentence).group(1))
    # a straight step under a Gaussian rises from 15 to 85 % within 2.07 deviations, a disc's a little sooner
    assert width == pytest.approx(2.07 * 3.5, rel=0.25)


def test_compressed_video_is_a_warning_and_adds_to_the_noise(rested, tilted_frames):
    held = [tilted_frames[0]]
    for frame in tilted_frames[1:]:
        image = frame.image.copy()
        image[:, :640] = held[-1].image[:, :640]
        held.append(replace(frame, image=image))
    found = calibrate_rest(camera_only(tilted_sensor()), held, pitch_mm=4.0)
    assert COMPRESSED_VIDEO in found.warnings
    assert COMPRESSED_VIDEO not in rested.warnings
    assert 0.05 < found.noise_px < 0.1
    assert found.sensor.centre_noise_px == found.noise_px


def test_pressed_frames_are_left_out_and_reported(rested, tilted_frames):
    def pressed(frame, by_px):
        image = frame.image.copy()
        image[200:420, 400:700] = np.roll(frame.image, by_px, axis=1)[200:420, 400:700]
        return replace(frame, image=image)

    first = list(tilted_frames)
    later = [pressed(frame, 2 + number) for number, frame in enumerate(first)]
    found = calibrate_rest(camera_only(tilted_sensor()), first + later, pitch_mm=4.0)
    assert (found.frames, found.frames_given, found.first_and_last) == (len(first), 2 * len(first), (0, 4))
    assert found.motion_px < 0.2
    np.testing.assert_allclose(found.sensor.layout.rest_px, rested.sensor.layout.rest_px, atol=0.02)
    line = next(describe_rest(found))
    assert "measured in 5 of the frames 0 to 4, in which they stay within 0." in line
    assert line.endswith("px; 5 of 10 frames were left out, because markers move in them")
    assert "left out" not in next(describe_rest(rested))
    assert not any("a marker moved" in sentence for sentence in found.warnings)


def test_a_marker_that_moves_meanwhile_is_odd(tilted_frames):
    moved = [
        replace(frame, image=np.roll(frame.image, number, axis=1))
        for number, frame in enumerate(tilted_frames)
    ]
    found = calibrate_rest(camera_only(tilted_sensor()), moved, pitch_mm=4.0)
    (sentence,) = [sentence for sentence in found.warnings if "a marker moved by" in sentence]
    assert float(re.search(r"moved by ([\d.]+) px", sentence).group(1)) == pytest.approx(4.0, abs=0.2)


def far_sensor():
    sensor = tilted_sensor()
    return replace(sensor, camera=replace(sensor.camera, translation_mm=SHIFT + np.array([0.0, 0.0, 14.0])))


@pytest.fixture(scope="module")
def far_frames():
    return frames_of(far_sensor(), count=4)


def mounted(frames, camera, size_mm, *, outside=0.3, middle_mm=(0.0, 0.0), sides=(1, 1, 1, 1), blur_px=0.8):
    """The frames with something darker or lighter where the sheet ends, and noise; no end at sides of 0."""
    x, y = 0.5 * np.array(size_mm)
    far = np.where(sides, [x, x, y, y], 400.0)
    height, width = frames[0].image.shape
    pixel = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    place = onto_plane(camera, pixel.astype(np.float64))[:, :2] - middle_mm
    inside_mm = np.minimum(far[::2] + place, far[1::2] - place).min(axis=1)
    share = np.clip(0.5 + inside_mm * camera.fx_px / camera.translation_mm[2], 0.0, 1.0).reshape(
        height, width
    )
    share = cv2.GaussianBlur(share, (0, 0), blur_px)
    chance = np.random.default_rng(4)
    found = []
    for frame in frames:
        grey = frame.image * (outside + (1 - outside) * share) + chance.normal(0.0, 2.0, frame.image.shape)
        found.append(replace(frame, image=np.clip(grey, 0, 255).round().astype(np.uint8)))
    return found


@pytest.mark.parametrize(
    "outside", [0.3, pytest.param(3.0, marks=pytest.mark.slow)], ids=["dark casing", "lit ledge"]
)
def test_the_clamp_line_is_found_where_the_sheet_is_seen_to_end(far_frames, outside):
    sensor = far_sensor()
    frames = mounted(far_frames, sensor.camera, (121.0, 83.0), outside=outside, middle_mm=(0.5, -0.4))
    found = calibrate_rest(camera_only(sensor), frames, pitch_mm=4.0)
    assert found.clamp.side_mm == pytest.approx([-60.0, 61.0, -41.9, 41.1], abs=0.1)
    if outside > 1.0:
        return
    taken = calibrate_rest(camera_only(sensor), frames, pitch_mm=4.0, thickness_mm=3.0).sensor
    assert taken.sheet.size_mm == pytest.approx([121.0, 83.0], abs=0.2)
    assert taken.sheet.thickness_mm == 3.0
    assert taken.layout.rest_mm.mean(axis=0) == pytest.approx([-0.5, 0.4, 0.0], abs=0.1)
    residual_rms_px = project(taken.camera, taken.layout.rest_mm) - taken.layout.rest_px
    assert np.nanmax(np.abs(residual_rms_px)) < 0.2


def test_a_clamp_line_that_differs_from_the_file_gives_a_warning(far_frames):
    sensor = far_sensor()
    frames = mounted(far_frames, sensor.camera, (120.0, 83.0))
    output = Sheet(size_mm=np.array([120.4, 80.0]), thickness_mm=3.0)
    found = calibrate_rest(sensor, frames, sheet=output)
    (sentence,) = [sentence for sentence in found.warnings if "illuminated sheet differs" in sentence]
    assert "top at -41.5 mm, bottom at 41.5 mm" in sentence
    assert "left" not in sentence
    assert found.sensor.sheet is output
    assert "ends at 120.0 x 83.0 mm in the image and at 120.4 x 80 mm in [sheet]" in describe(
        found.clamp, output
    )


def test_a_clamp_line_out_of_sight_is_taken_as_given(far_frames):
    sensor = far_sensor()
    frames = mounted(far_frames, sensor.camera, (120.0, 83.0), sides=(1, 1, 0, 1))
    found = calibrate_rest(sensor, frames)
    assert found.clamp.unseen == ("top",)
    assert found.clamp.side_mm[[0, 1, 3]] == pytest.approx([-60.0, 60.0, 41.5], abs=0.1)
    assert "not all sides (top missing), so [sheet] is used, 120 x 80 mm" in describe(
        found.clamp, sensor.sheet
    )
    with pytest.raises(
        SensorError, match=r"\(top missing\): give the outline of the sheet by --sheet-mm X,Y"
    ):
        calibrate_rest(camera_only(sensor), frames, pitch_mm=4.0, thickness_mm=3.0)
    nowhere = calibrate_rest(sensor, far_frames)
    assert nowhere.clamp.unseen == ("left", "right", "top", "bottom")
    assert not any("illuminated sheet" in sentence for sentence in nowhere.warnings)
    assert "visible on no side" in describe(nowhere.clamp, sensor.sheet)


def test_light_that_falls_off_is_no_clamp_line(far_frames):
    sensor = far_sensor()
    shaded = mounted(far_frames, sensor.camera, (124.0, 84.0), outside=0.5, blur_px=15.0)
    assert calibrate_rest(sensor, shaded).clamp.unseen == ("left", "right", "top", "bottom")


def test_a_clamp_line_that_lies_elsewhere_changes_forces_near_it():
    # Near a straight clamp the stiffness of a thin plate falls with the square of the distance: 1 mm of 10 is
    # 21 %. A thick one also shears, and this stiffness falls more slowly.
    sheet = Sheet(size_mm=np.array([120.0, 80.0]), thickness_mm=2.0, poisson=0.45)
    thin, thick = force_change(sheet), force_change(replace(sheet, thickness_mm=6.0))
    assert thin == pytest.approx(0.2, abs=0.04)
    assert 0.1 < thick < thin


def test_what_cannot_be_known_is_refused(tilted_frames):
    with pytest.raises(SensorError, match="give --pitch-mm"):
        calibrate_rest(camera_only(tilted_sensor()), tilted_frames)
    with pytest.raises(SensorError, match="calibrate it at this size"):
        calibrate_rest(camera_only(demo_sensor(640)), tilted_frames, pitch_mm=4.0)
    dark = [replace(frame, image=np.zeros_like(frame.image)) for frame in tilted_frames]
    with pytest.raises(LayoutError):
        calibrate_rest(camera_only(tilted_sensor()), dark, pitch_mm=4.0)


@pytest.mark.slow
def test_the_verb_writes_a_sensor_that_process_can_use(tmp_path, capsys):
    lens = tmp_path / "camera.toml"
    save_sensor(camera_only(next(iter([demo_sensor(1280)]))), lens)
    out = tmp_path / "sensor.toml"
    words = ["calibrate", "rest", "sim:rest", "--sensor", str(lens), "--pitch-mm", "4", "--out", str(out)]
    assert main([*words, "--sheet-mm", "120,80", "--thickness-mm", "3"]) == 0
    sensor = load_sensor(out)
    assert sensor.camera.translation_mm == pytest.approx([0.0, 0.0, 116.3], abs=0.05)
    assert sensor.sheet.size_mm.tolist() == [120.0, 80.0]
    assert sensor.centre_noise_px == pytest.approx(0.008, abs=0.006)
    output = capsys.readouterr().out
    assert "residual from a flat lattice" in output
    assert "clamp line: visible on no side, so [sheet] is used, 120 x 80 mm; an error of" in output
    assert main([*words, "--sheet-mm", "120,80"]) == 2
    assert "--sheet-mm requires --thickness-mm" in capsys.readouterr().err
    assert len(list(islice(tmp_path.iterdir(), 5))) == 2
