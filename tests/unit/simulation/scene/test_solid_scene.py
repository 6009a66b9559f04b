"""Solved states in time."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.simulation.scene.deformation import Deformation, contact_from_row, flat
from manytouch.simulation.scene.moving_sheet import MovingSheet
from manytouch.simulation.scene.solid_scene import SolidScene, monotone

TIME_S = np.array([0.0, 1.0, 1.5, 2.0, 3.0])
FORCE_N = np.array([[0.0, 0.0, 2.0, 1.0, 0.0], [0.0, 1.0, 0.0, 3.0, 0.0]])


def bent(number: int) -> Deformation:
    """A face that tilts about y and sinks, under two bodies."""
    rest = flat((8.0, 6.0))
    face_mm = rest.face_mm.copy()
    sink_mm = (0.0, 1.0, 3.0, 4.0, 0.0)[number]
    face_mm[:, :, 2] = -sink_mm - 0.1 * sink_mm * rest.x_mm[:, None]
    contacts = tuple(
        contact_from_row(np.array([0.0, 0.0, -force, 0.5, 2.0 * force, number, body, sink_mm]))
        if force
        else contact_from_row(np.array([0.0, 0.0, -0.0, np.nan, 0.0, np.nan, np.nan, np.nan]))
        for body, force in enumerate(FORCE_N[:, number])
    )
    return replace(rest, face_mm=face_mm, contacts=contacts)


SCENE = SolidScene(name="x", time_s=TIME_S, states=tuple(bent(number) for number in range(5)), duration_s=3.0)


def test_keyframes_are_met_and_nothing_overshoots() -> None:
    place_mm = np.array([[0.0, 0.0], [3.0, -2.0]])
    motion = SCENE.motion_of(place_mm)
    for time_s, state in zip(TIME_S[:-1], SCENE.states, strict=False):
        np.testing.assert_allclose(motion(float(time_s)), state.displacement_mm(place_mm), atol=1e-6)
    depth_mm = np.array([-motion(time_s)[0, 2] for time_s in np.linspace(0.0, 3.0, 301)[:-1]])
    assert (np.diff(depth_mm[:201]) >= -1e-6).all()
    assert (np.diff(depth_mm[200:]) <= 1e-6).all()
    assert depth_mm.max() == pytest.approx(4.0, abs=1e-5)


def test_cubics_are_exact_for_straight_lines_and_near_for_smooth_curves() -> None:
    time_s = np.linspace(0.0, 1.0, 11)
    line = np.column_stack([2.0 * time_s, -time_s])
    assert monotone(time_s, line, 0.43) == pytest.approx([0.86, -0.43])
    curve = np.sin(3.0 * time_s)
    errors = [monotone(time_s, curve, at) - np.sin(3.0 * at) for at in np.linspace(0.15, 0.4, 40)]
    assert np.abs(errors).max() < 3e-3
    assert np.abs(errors).max() > 1e-6


def test_each_touch_has_an_id_of_its_own_and_no_force_at_its_ends() -> None:
    assert isinstance(SCENE, MovingSheet)
    assert SCENE.touch_count == 3
    seen = {time_s: SCENE.contacts(time_s) for time_s in (0.0, 0.5, 1.0, 1.2, 1.7, 2.5, 2.999)}
    assert [sorted(contacts) for contacts in seen.values()] == [[], [0], [0], [0, 1], [1, 2], [1, 2], [1, 2]]
    assert SCENE.contacts(2.0)[1].normal_force_N == pytest.approx(1.0)
    assert SCENE.contacts(2.999)[2].normal_force_N < 1e-4
    assert seen[0.5][0].centre_mm.tolist() == [1.0, 1.0]
    assert 0.0 < seen[0.5][0].depth_mm < 1.0
    assert 0.0 < seen[0.5][0].normal_force_N < 1.0


def test_a_body_that_only_grazes_a_raised_face_does_not_touch() -> None:
    """It presses at 1 s and stands at the face until 2 s, while something else raises or lowers it."""
    rest = flat((8.0, 6.0))

    def states(depth_mm: float, force_N: float) -> tuple[Deformation, ...]:
        rows = [(0.0, np.nan), (2.0, 0.5), (force_N, depth_mm), (force_N, depth_mm), (0.0, np.nan)]
        return tuple(
            replace(rest, contacts=(contact_from_row(np.array([0, 0, -force, 0, 1, 0, 0, depth])),))
            for force, depth in rows
        )

    def touches(depth_mm: float, force_N: float) -> list[bool]:
        scene = replace(SCENE, states=states(depth_mm, force_N))
        return [bool(scene.contacts(time_s)) for time_s in (0.0, 1.0, 1.5, 1.75, 2.0, 2.5)]

    assert touches(-0.003, 0.002) == [False, True, False, False, False, False]
    assert touches(0.003, 0.002) == [False, True, True, True, True, True]
    assert touches(-0.003, 0.1) == [False, True, True, True, True, True]


def test_the_contact_face_of_a_pad_moves_by_itself() -> None:
    """It sinks twice as far as the plane of the markers; a contact that fades is as deep as it."""
    states = tuple(replace(state, contact_face_mm=np.float32(2.0) * state.face_mm) for state in SCENE.states)
    scene, place_mm = replace(SCENE, states=states), np.array([[1.0, 1.0], [3.0, -2.0]])
    for time_s in (0.3, 1.0, 1.7):
        markers_mm = scene.motion_of(place_mm)(time_s)
        np.testing.assert_array_equal(markers_mm, SCENE.motion_of(place_mm)(time_s))
        np.testing.assert_allclose(
            scene.contact_face_motion_of(place_mm)(time_s), 2.0 * markers_mm, atol=1e-6
        )
        np.testing.assert_array_equal(SCENE.contact_face_motion_of(place_mm)(time_s), markers_mm)
    assert SCENE.contacts(1.499)[0].depth_mm == pytest.approx(3.3, abs=0.01)  # of the face at (1, 1) mm
    assert scene.contacts(1.499)[0].depth_mm == pytest.approx(6.6, abs=0.01)


def test_it_can_be_repeated() -> None:
    longer = SCENE.with_duration(7.0)
    assert longer.duration_s == 7.0
    assert sorted(longer.contacts(4.0)) == [SCENE.touch_count]
    place_mm = np.array([[1.0, 1.0]])
    np.testing.assert_allclose(longer.motion_of(place_mm)(4.2), SCENE.motion_of(place_mm)(1.2), atol=1e-6)


def test_tips_off_the_face_stay_on_its_normal() -> None:
    """The face tilts by atan(0.4) about y; a tip 2 mm in front of it swings to +x and back up."""
    place_mm = np.array([[1.0, -1.0]])
    tip_mm = SCENE.motion_of(place_mm, 2.0)(2.0) - SCENE.motion_of(place_mm)(2.0)
    angle = np.arctan(0.4)
    expected = [-2.0 * np.sin(angle), 0.0, 2.0 * (1.0 - np.cos(angle))]
    np.testing.assert_allclose(tip_mm[0], expected, atol=1e-6)


def test_states_and_keyframes_must_match() -> None:
    with pytest.raises(ValueError, match="2 states for 5 keyframes"):
        replace(SCENE, states=SCENE.states[:2])
