"""The simulated sensor: the truth is what the picture shows."""

import gc
import weakref
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

from manytouch.geometry.camera import project
from manytouch.geometry.refraction import project_through_window
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.simulation.render.discs import Look
from manytouch.simulation.render.dot_ellipses import polygon_ellipses
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.sources.simulated import simulated_source
from manytouch.values import Phase

BUSY = 210


@cache
def fingers() -> Simulator:
    return simulated_source("fingers").simulator


def test_demo_sensor_scales_with_its_picture() -> None:
    large, small = demo_sensor().camera, demo_sensor(1280).camera
    assert (large.width_px, large.height_px, large.cx_px, large.cy_px) == (2560, 1440, 1279.5, 719.5)
    assert (small.width_px, small.height_px) == (1280, 720)
    points = np.array([[40.0, -30.0, 0.0], [0.0, 0.0, -2.0]])
    assert project(small, points) + 0.5 == pytest.approx((project(large, points) + 0.5) / 2)


def test_truth_is_where_the_picture_shows_the_dots() -> None:
    plain = replace(fingers(), look=Look(ground=0.0, dot=255.0))
    image = plain.frame(BUSY).image
    assert image is not None
    truth = plain.truth(BUSY)
    assert truth.grid.is_seen.all()
    for marker in range(0, 600, 37):
        x, y = np.rint(truth.grid.position_px[marker]).astype(int)
        window = image[y - 15 : y + 16, x - 15 : x + 16].astype(float)
        rows, columns = np.indices(window.shape)
        found = np.array([(columns * window).sum(), (rows * window).sum()]) / window.sum() + [x - 15, y - 15]
        assert found == pytest.approx(truth.grid.position_px[marker], abs=0.01)


def test_the_truth_of_a_frame_has_the_dots_of_its_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are drawn once: a viewer that compares needs the truth of each frame after its picture."""
    drawn = []

    def observed(corner_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        drawn.append(len(corner_px))
        return polygon_ellipses(corner_px)

    monkeypatch.setattr("manytouch.simulation.simulator.polygon_ellipses", observed)
    watched = replace(fingers(), look=fingers().look)
    watched.frame(BUSY)
    seen_px = watched.truth(BUSY).grid.position_px
    assert len(drawn) == 1
    assert np.abs(seen_px - watched.truth(0).grid.position_px).max() > 5.0, "another frame has others"
    assert len(drawn) == 2


class WatchedScene(SolidScene):
    """A scene whose end can be seen: without slots, it has weak references."""


def test_a_simulator_ends_with_its_last_reference() -> None:
    """A suite makes hundreds of them, with large scenes."""
    known = fingers().scene
    assert isinstance(known, SolidScene)
    given = {each.name: getattr(known, each.name) for each in fields(known) if each.init}
    scene = WatchedScene(**given)
    simulator, seen = replace(fingers(), scene=scene), weakref.ref(scene)
    simulator.truth(BUSY)
    gc.disable()
    try:
        del simulator, scene
        assert seen() is None
    finally:
        gc.enable()


TURNED, DRAGGED = 48, 40
WAY_MM = np.array([0.2, 0.15])


@cache
def pad() -> Simulator:
    return simulated_source("pad", width_px=640).simulator


def test_dots_of_a_pad_are_seen_through_its_window() -> None:
    """Dark dots of the solved pad: centroids of the picture against the truth."""
    plain = replace(pad(), look=Look(ground=255.0, dot=0.0))
    for index in (0, TURNED):
        image, truth = plain.frame(index).image, plain.truth(index)
        assert image is not None
        assert truth.grid.is_seen.all()
        for marker in range(0, 63, 5):
            x, y = np.rint(truth.grid.position_px[marker]).astype(int)
            window = 255.0 - image[y - 15 : y + 16, x - 15 : x + 16].astype(float)
            rows, columns = np.indices(window.shape)
            found = np.array([(columns * window).sum(), (rows * window).sum()]) / window.sum() + [
                x - 15,
                y - 15,
            ]
            assert found == pytest.approx(truth.grid.position_px[marker], abs=0.02)
    assert pad().sensor.sheet is not None
    assert pad().sensor.layout is not None
    rest_mm = pad().sensor.layout.rest_mm
    dot_mm = rest_mm + pad().scene.motion_of(np.ascontiguousarray(rest_mm[:, :2]))(TURNED / 30)
    seen_px = project_through_window(pad().sensor.camera, pad().sensor.sheet, dot_mm)
    np.testing.assert_allclose(seen_px, truth.grid.position_px, atol=0.3)
    assert np.abs(project(pad().sensor.camera, dot_mm) - seen_px).max() > 15.0


def test_truth_of_a_pad_refers_to_its_contact_face() -> None:
    ball, punch = pad().truth(TURNED).contacts.touching
    assert 0.75 < ball.depth_mm < 0.8  # of the body 0.8, less what the penalty lets it enter
    assert 0.6 * ball.depth_mm < -pad().truth(TURNED).surface.displacement_mm[:, 2].min() < ball.depth_mm
    assert ball.force_N[0] > 0.1  # dragged along x, and turned
    assert ball.torque_Nmm > 0.05
    assert punch.force_N[2] < 0.0
    assert ball.centre_mm == pytest.approx([-3.0, -1.0], abs=0.2)
    around_px = pad().truth(TURNED).grid.position_px[[20, 21, 29, 30]]  # at (-4, -2) mm to (-2, 0) mm
    assert ball.centre_px == pytest.approx(around_px.mean(axis=0), abs=8.0)


def test_the_contact_face_of_a_pad_moves_with_what_sticks_to_it() -> None:
    """A ball that goes by (0.2, 0.15) mm takes the face with it; the markers below lag by a third."""
    truth = pad().truth(DRAGGED)
    (ball,) = truth.contacts.touching
    sensor = pad().sensor
    assert sensor.sheet is not None
    assert sensor.sheet.marker_depth_mm is not None
    assert sensor.layout is not None
    rest_mm = sensor.layout.rest_mm
    under = np.linalg.norm(rest_mm[:, :2] - ball.centre_mm, axis=1) < 1.5
    assert under.sum() == 4
    moved_mm = truth.surface.displacement_mm[under]
    assert moved_mm[:, :2].mean(axis=0) == pytest.approx(WAY_MM, abs=0.005)
    dot_mm = pad().scene.motion_of(np.ascontiguousarray(rest_mm[under, :2]))(DRAGGED / 30)
    assert np.linalg.norm(dot_mm[:, :2].mean(axis=0)) < 0.8 * np.linalg.norm(WAY_MM)
    np.testing.assert_allclose(truth.surface.position_mm, rest_mm + truth.surface.displacement_mm)
    there_mm = np.array([*(ball.centre_mm + WAY_MM), sensor.sheet.marker_depth_mm - ball.depth_mm])
    shown_px = project_through_window(sensor.camera, sensor.sheet, there_mm[None])[0]
    assert ball.centre_px == pytest.approx(shown_px, abs=0.1)  # it moved by 4 px


def test_contacts_of_a_pad_press_it_and_end() -> None:
    """The ball stands at the face at 2 s while the punch raises it; the punch leaves at 2.8 s."""
    lives: dict[int, list[tuple[int, Phase]]] = {}
    for index in range(pad().frame_count):
        for contact in pad().truth(index).contacts.contacts:
            lives.setdefault(contact.id, []).append((index, contact.phase))
            assert -contact.force_N[2] > 0.005
    ends = {id_: life[-1] for id_, life in lives.items()}
    assert ends == {0: (60, Phase.END), 1: (84, Phase.END)}
    for life in lives.values():
        first, last = life[0][0], life[-1][0]
        assert [index for index, _ in life] == list(range(first, last + 1))
        assert [phase for _, phase in life[:-1]] == [Phase.START, *[Phase.MOVE] * (len(life) - 2)]


def test_nothing_moves_at_rest() -> None:
    truth = fingers().truth(30)
    assert truth.contacts.contacts == ()
    assert np.abs(truth.surface.displacement_mm).max() == 0
    image = fingers().frame(30).image
    assert image is not None
    assert image.shape == (720, 1280)


def test_truth_has_forces_depths_and_places() -> None:
    truth = fingers().truth(BUSY)
    there = fingers().scene.contacts(BUSY / 30)
    assert [contact.id for contact in truth.contacts.touching] == sorted(there)
    assert len(there) == 4
    for contact in truth.contacts.touching:
        assert contact.force_N.tolist() == there[contact.id].force_N.tolist()
        assert contact.centre_mm.tolist() == there[contact.id].centre_mm.tolist()
        rest_mm = truth.surface.position_mm - truth.surface.displacement_mm
        near = np.linalg.norm(rest_mm[:, :2] - contact.centre_mm, axis=1) < 5.0
        deepest = -truth.surface.displacement_mm[near, 2].min()
        assert deepest <= contact.depth_mm + 1e-6 < deepest + 0.3
        nearest = np.argmin(np.linalg.norm(rest_mm[:, :2] - contact.centre_mm, axis=1))
        assert np.linalg.norm(contact.centre_px - truth.grid.position_px[nearest]) < 36 / np.sqrt(2) * 1.1


def test_phases_start_move_and_end_once() -> None:
    lives: dict[int, list[Phase]] = {}
    last_force = {}
    slow = replace(fingers(), fps=15.0)
    for index in range(slow.frame_count):
        for contact in slow.truth(index).contacts.contacts:
            lives.setdefault(contact.id, []).append(contact.phase)
            if contact.phase is Phase.END:
                assert contact.force_N[2] == last_force[contact.id]
            last_force[contact.id] = contact.force_N[2]
    assert sorted(lives) == list(range(9))
    for phases in lives.values():
        assert phases == [Phase.START, *[Phase.MOVE] * (len(phases) - 2), Phase.END]


def test_frames_repeat_with_the_seed_and_differ_in_noise() -> None:
    again = simulated_source("fingers").simulator
    assert np.array_equal(fingers().frame(7).image, again.frame(7).image)
    assert not np.array_equal(fingers().frame(7).image, fingers().frame(8).image)
    other = simulated_source("fingers", seed=1).simulator
    assert not np.array_equal(fingers().frame(7).image, other.frame(7).image)


def test_missing_markers_are_neither_shown_nor_seen() -> None:
    sensor = demo_sensor(1280)
    assert sensor.layout is not None
    missing = np.zeros(600, dtype=bool)
    missing[[31, 400]] = True
    gappy = replace(
        fingers(), sensor=replace(sensor, layout=replace(sensor.layout, is_missing=missing)), faults=None
    )
    whole_px = np.rint(fingers().truth(5).grid.position_px[31]).astype(int)
    grid = gappy.truth(5).grid
    assert np.array_equal(grid.is_seen, ~missing)
    assert np.isnan(grid.position_px[missing]).all()
    image, whole = gappy.frame(5).image, fingers().frame(5).image
    assert image is not None
    assert whole is not None
    assert image[whole_px[1], whole_px[0]] < 80
    assert whole[whole_px[1], whole_px[0]] > 120


def test_only_what_the_camera_sees_is_seen() -> None:
    sensor = demo_sensor(1280)
    camera = replace(sensor.camera, translation_mm=np.array([20.0, 0.0, 116.3]))
    grid = replace(fingers(), sensor=replace(sensor, camera=camera)).truth(4).grid
    assert 0 < grid.is_seen.sum() < 600
    assert np.isfinite(grid.position_px).all(axis=1).tolist() == grid.is_seen.tolist()


def test_a_sensor_without_layout_or_sheet_is_refused() -> None:
    with pytest.raises(ValueError, match="sheet"):
        replace(fingers(), sensor=replace(demo_sensor(), sheet=None))
    with pytest.raises(ValueError, match="layout"):
        replace(fingers(), sensor=replace(demo_sensor(), layout=None))
