"""ContactBodies on their ways."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.simulation.scene.motion import (
    Body,
    Trajectory,
    concatenate_trajectories,
    held_presses,
    keyframe_times,
    loading,
    press_trajectory,
)

PRESS = press_trajectory(1.0, 3.0, from_mm=(2.0, -1.0), to_mm=(8.0, 3.0), depth_mm=4.0, ramp_s=0.5)
BALL = Sphere(radius_mm=6.0)


def test_a_press_goes_down_on_and_up() -> None:
    places, turns = PRESS.at(np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 9.0]))
    assert places[[1, 3, 5, 6], 2].tolist() == [0.0, 4.0, 4.0, 0.0]
    assert places[[0, 7], 2].max() < 0.0
    assert places[2, 2] == pytest.approx(2.0)
    assert places[4] == pytest.approx([5.0, 1.0, 4.0])
    assert places[:4, :2].tolist() == [[2.0, -1.0]] * 4
    assert places[5:, :2].tolist() == [[8.0, 3.0]] * 3
    assert not turns.any()


def test_it_rests_at_every_waypoint() -> None:
    for time_s in PRESS.time_s:
        near, _ = PRESS.at(np.array([time_s - 1e-4, time_s + 1e-4]))
        assert np.abs(near[1] - near[0]).max() < 1e-4


@pytest.mark.parametrize(("turn", "count"), [((0.0, 0.0, 0.1), 2), ((0.1, 0.0, 0.0), 1)])
def test_a_press_that_turns_about_the_normal_is_held_and_one_that_rolls_is_not(turn, count: int) -> None:
    turning = press_trajectory(1.0, 3.0, from_mm=(2.0, -1.0), depth_mm=1.0, ramp_s=0.5, turn_to=turn)
    still = press_trajectory(3.0, 5.0, from_mm=(4.0, 1.0), depth_mm=1.0, ramp_s=0.5)
    found = held_presses((Body(indenter=BALL, trajectory=still), Body(indenter=BALL, trajectory=turning)))
    assert [(one.time_s, one.x_mm, one.y_mm) for one in found] == [(2.0, 2.0, -1.0), (4.0, 4.0, 1.0)][-count:]


def test_ramps_must_fit_and_ways_must_follow_each_other() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        press_trajectory(1.0, 2.0, from_mm=(0.0, 0.0), depth_mm=1.0, ramp_s=0.6)
    with pytest.raises(ValueError, match="overlap"):
        concatenate_trajectories([PRESS, PRESS])
    soon = press_trajectory(3.15, 4.0, from_mm=(0.0, 0.0), depth_mm=1.0, ramp_s=0.2)
    with pytest.raises(
        ValueError, match=r"more than 0\.2 s between the end_s of one and the start_s of the next"
    ):
        concatenate_trajectories([PRESS, soon])
    later = press_trajectory(4.0, 5.0, from_mm=(0.0, 0.0), depth_mm=1.0, ramp_s=0.2)
    assert concatenate_trajectories([PRESS, later]).at(np.array([4.5]))[0][0, 2] == 1.0


def test_keyframes_are_close_where_something_moves_and_nowhere_else() -> None:
    bodies = (Body(indenter=BALL, trajectory=PRESS),)
    for step_mm in (0.5, 1.0):
        time_s = keyframe_times(bodies, 5.0, step_mm=step_mm)
        assert (time_s[0], time_s[-1]) == (0.0, 5.0)
        assert set(np.round(time_s, 9)) >= {1.0, 1.5, 2.5, 3.0}
        line = np.linspace(0.0, 5.0, 5001)
        places = PRESS.at(line)[0]
        travelled_mm = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
        pressing = (time_s[:-1] >= 1.0) & (time_s[1:] <= 3.0)
        steps_mm = np.diff(np.interp(time_s, line, travelled_mm))[pressing]
        assert 0.6 * step_mm < steps_mm.max() < step_mm + 1e-3
    assert not ((time_s > 0.0) & (time_s < 1.0)).any()
    assert keyframe_times((), 5.0, step_mm=1.0).tolist() == [0.0, 5.0]


def test_a_body_that_rolls_does_not_slip() -> None:
    """The point that touches first stands still while a ball turns by a small angle."""
    turn = np.array([0.0, 0.02, 0.0])
    way = Trajectory(
        time_s=np.array([0.0, 1.0]),
        place_mm=np.array([[0.0, 0.0, 1.0], [0.02 * 6.0, 0.0, 1.0]]),
        rotation_vector=np.stack([np.zeros(3), turn]),
    )
    body = Body(indenter=BALL, trajectory=way, pivot_mm=6.0)
    touch = loading((body,), np.array([0.0, 1.0]), thickness_mm=3.0).touches[0]
    assert touch.position_mm[0].tolist() == [0.0, 0.0, 2.0]
    middle_mm = touch.position_mm + Rotation.from_rotvec(touch.rotation_vector.copy()).apply([0.0, 0.0, 6.0])
    assert middle_mm == pytest.approx(np.array([[0.0, 0.0, 8.0], [0.12, 0.0, 8.0]]), abs=1e-4)
    assert touch.position_mm[1] == pytest.approx(touch.position_mm[0], abs=2e-3)


def test_steps_are_the_keyframes() -> None:
    time_s = np.array([0.0, 1.5, 3.0])
    body = Body(indenter=BALL, trajectory=PRESS, friction=0.3)
    touch = loading((body,), time_s, thickness_mm=3.0).touches[0]
    assert touch.friction == 0.3
    assert touch.position_mm[1].tolist() == [2.0, -1.0, -1.0]
    assert touch.position_mm[0, 2] > 3.0
