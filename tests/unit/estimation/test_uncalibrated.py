"""Contacts on a pad whose sensor is not known: nothing but how its dots move."""

import numpy as np
import pytest

from flat_sensor import flat_sensor, rectangle_px
from layouts import grid_at, rows_and_columns
from manytouch.estimation import PerimeterEstimator

PITCH_PX = 44.0
REST_PX = rectangle_px(5, 7, (PITCH_PX, PITCH_PX), (28.0, 32.0))
SENSOR = flat_sensor(
    REST_PX, width_px=320, height_px=240, pitch_px=PITCH_PX, row_column=rows_and_columns(5, 7)
)
NOISE_PX = 0.06
AREA_PX2 = np.full(len(REST_PX), 200.0)
ESTIMATE = PerimeterEstimator()
FREE = np.zeros_like(REST_PX)


def dragged(at_px: tuple[float, float], radius_px: float, most_px: float, squeeze: float = 0.1) -> np.ndarray:
    """(m, 2) displacement by a press that drags the gel, and squeezes it outward by a share of that."""
    offset = (REST_PX - at_px) / radius_px
    spread = np.exp(-0.5 * (offset**2).sum(axis=1, keepdims=True))
    return most_px * spread * (squeeze * offset + np.array([0.8, 0.5]))


def touches(moved_px: list[np.ndarray], noise_px: float = NOISE_PX, std_px: float = 0.1) -> list[set[int]]:
    """Identities of the contacts of each frame; two dots with glints are measured badly."""
    state, found = ESTIMATE.start(SENSOR), []
    for frame, moved in enumerate(moved_px):
        glint = np.zeros_like(REST_PX)
        glint[[9, 26]] = 0.6 * ((frame // 5) % 2)
        grid = grid_at(
            REST_PX + moved + glint, std_px=std_px, noise_px=noise_px, seed=frame, area_px2=AREA_PX2
        )
        state, _, contacts = ESTIMATE.step(state, grid)
        found.append({contact.id for contact in contacts.touching})
    return found


def test_a_broad_press_that_is_held_stays() -> None:
    """After a strong grip the hand lets up a little and stays for long."""
    press = dragged((130.0, 110.0), 70.0, 9.0)
    share = [0.0] * 15 + [0.5, 0.9, 1.0, 1.0, 0.8] + [0.6] * 150 + [0.0] * 30
    found = touches([each * press for each in share])
    assert all(found[20:170])
    assert len(set.union(*found[18:170])) == 1
    assert not any(found[:15])
    assert not any(found[173:])


def test_a_faint_touch_in_a_corner_is_found() -> None:
    press = dragged((300.0, 30.0), 50.0, 3.0)
    assert 2.5 < np.linalg.norm(press, axis=1).max() < 3.1
    found = touches([FREE] * 15 + [press] * 60 + [FREE] * 20)
    assert all(found[18:75])
    assert not any(found[:15])
    assert not any(found[78:])


def test_a_faint_touch_that_varies_is_one() -> None:
    """Its local motion alternates between .004 and .007 pitches."""
    press = dragged((300.0, 30.0), 50.0, 3.0)
    share = [0.0] * 15 + [0.6] * 10 + [0.2, 0.35] * 20 + [0.0] * 20
    found = touches([each * press for each in share], noise_px=0.01, std_px=0.02)
    assert all(found[18:65])
    assert len(set.union(*found)) == 1
    assert not any(found[:15])
    assert not any(found[68:])


def test_nothing_touches_a_pad_that_the_camera_moves_before() -> None:
    turn = 0.01 * (REST_PX - [160.0, 120.0])[:, ::-1] * [-1.0, 1.0] + 4.0
    assert not any(touches([share * turn for share in np.linspace(0.0, 1.0, 60)]))


def test_noise_is_not_a_touch() -> None:
    assert not any(touches([FREE] * 200, noise_px=0.1))


def test_what_a_soft_sheet_keeps_of_a_press_is_not_a_touch() -> None:
    press = dragged((130.0, 110.0), 70.0, 12.0)
    creep = 0.12 * np.exp(-np.arange(80) / 60.0)
    found = touches([FREE] * 15 + [press] * 30 + [share * press for share in creep])
    assert all(found[18:45])
    assert not any(found[48:])


def test_a_depth_that_is_not_known_is_empty() -> None:
    """A camera far away sees how dots move in the plane of the pad, and next to nothing of its depth."""
    state = ESTIMATE.start(SENSOR)
    press = dragged((150.0, 120.0), 50.0, 6.0, squeeze=1.0)
    for frame in range(8):
        grid = grid_at(REST_PX + (press if frame > 3 else FREE), std_px=0.1, noise_px=0.05, seed=frame)
        state, surface, contacts = ESTIMATE.step(state, grid)
    (contact,) = contacts.touching
    assert np.sqrt(surface.covariance_mm2[:, 2, 2]).max() > PITCH_PX
    assert np.isnan(contact.depth_mm)
    assert np.isnan(contact.std("depth"))


@pytest.mark.parametrize("at_px", [(345.0, 120.0), (150.0, 262.0), (350.0, -20.0)])
def test_a_press_at_the_rim_is_in_the_image_and_near_the_markers(at_px: tuple[float, float]) -> None:
    """What is beyond the outer markers is not measured; the model of the load extends over it."""
    press = dragged(at_px, 60.0, 9.0)
    state, count = ESTIMATE.start(SENSOR), 0
    for frame in range(30):
        area_px2 = AREA_PX2 * (1.0 + 0.05 * np.linalg.norm(press, axis=1)) ** (frame > 10)
        grid = grid_at(
            REST_PX + (press if frame > 10 else FREE),
            std_px=0.1,
            noise_px=0.05,
            seed=frame,
            area_px2=area_px2,
        )
        state, _, contacts = ESTIMATE.step(state, grid)
        for contact in contacts.touching:
            x_px, y_px = contact.centre_px
            assert -0.5 <= x_px <= 319.5
            assert -0.5 <= y_px <= 239.5
            rest_mm = SENSOR.layout.rest_mm[:, :2]
            assert (contact.centre_mm <= rest_mm.max(axis=0) + 0.51 * PITCH_PX).all()
            assert (contact.centre_mm >= rest_mm.min(axis=0) - 0.51 * PITCH_PX).all()
            count += 1
    assert count >= 10
