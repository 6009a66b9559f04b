"""Motion of the whole view: exact, and not affected by presses."""

import numpy as np
import pytest

from manytouch.estimation.perimeter.rigid_motion import RigidMotion, RigidMotionEstimator

ROWS, COLUMNS = 9, 14
PLACE = np.stack(np.meshgrid(np.arange(COLUMNS) * 4.0 - 26.0, np.arange(ROWS) * 5.0 - 20.0), axis=-1).reshape(
    -1, 2
)
VIEW = RigidMotionEstimator()
HYPOTHESES = VIEW.hypotheses(PLACE)
ALL = np.ones(len(PLACE), dtype=np.bool_)
MOTION = RigidMotion(shift_mm=np.array([1.7, -0.9]), angle_rad=0.01)


def press(centre: tuple[float, float], depth: float, radius: float) -> np.ndarray:
    offset = PLACE - centre
    return depth * offset * np.exp(-(offset**2).sum(axis=1) / (2 * radius**2))[:, None]


def test_a_shift_and_a_turn_are_found():
    found = VIEW(PLACE, MOTION.displacement(PLACE), ALL, 1e-6, HYPOTHESES)
    np.testing.assert_allclose(found.shift_mm, MOTION.shift_mm, atol=2e-3)
    assert found.angle_rad == pytest.approx(MOTION.angle_rad, abs=1e-4)


@pytest.mark.parametrize("radius", [4.0, 8.0])
def test_presses_hardly_change_the_motion(radius: float):
    moved = MOTION.displacement(PLACE) + press((-5.0, 3.0), 0.2, radius) + press((14.0, -6.0), 0.1, 4.0)
    found = VIEW(PLACE, moved, ALL, 0.01, HYPOTHESES)
    left = np.abs(found.displacement(PLACE) - MOTION.displacement(PLACE)).max()
    assert left < 0.12 * np.abs(moved - MOTION.displacement(PLACE)).max()


def test_a_finger_that_drags_most_of_the_sheet_is_not_a_motion():
    """Half of the markers go along with a finger by 2 mm; those at the border stay."""
    inside = (np.abs(PLACE) < [18.0, 15.0]).all(axis=1)
    moved = np.where(inside[:, None], [2.0, 0.5], 0.0) * np.exp(-(PLACE**2).sum(axis=1) / 2000.0)[:, None]
    found = VIEW(PLACE, moved, ALL, 0.01, HYPOTHESES)
    assert np.linalg.norm(found.shift_mm) < 0.1


def test_the_order_of_the_markers_and_unseen_ones_do_not_matter():
    random = np.random.default_rng(1)
    moved = MOTION.displacement(PLACE) + random.normal(0, 0.01, PLACE.shape)
    is_seen = random.random(len(PLACE)) > 0.2
    moved[~is_seen] = np.nan
    found = VIEW(PLACE, moved, is_seen, 0.01, HYPOTHESES)
    np.testing.assert_allclose(found.shift_mm, MOTION.shift_mm, atol=0.01)
    order = random.permutation(len(PLACE))
    again = VIEW(PLACE[order], moved[order], is_seen[order], 0.01, VIEW.hypotheses(PLACE[order]))
    np.testing.assert_allclose(again.shift_mm, found.shift_mm, atol=0.01)


def test_without_seen_markers_the_motion_is_zero():
    found = VIEW(PLACE, np.full_like(PLACE, np.nan), ~ALL, 0.01, HYPOTHESES)
    assert found.shift_mm.tolist() == [0.0, 0.0]
