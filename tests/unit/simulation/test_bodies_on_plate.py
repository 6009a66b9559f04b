"""Bodies on the linear plate."""

import numpy as np
import pytest

from manytouch.simulation.bodies_on_plate import BodiesOnPlate, patch_radius_mm
from manytouch.simulation.fem.indenters import RoundPunch, Sphere, SquarePunch
from manytouch.simulation.mechanics import PlateMechanics, Pressing
from manytouch.simulation.motion import Body, pressed_way
from manytouch.simulation.sensor import demo_sensor

SHEET = demo_sensor().sheet
assert SHEET is not None


def scene(*presses: tuple[float, float, float]) -> BodiesOnPlate:
    assert SHEET is not None
    bodies = tuple(
        Body(
            indenter=Sphere(radius_mm=6.0),
            way=pressed_way(0.5, 2.5, from_mm=(x, y), depth_mm=depth_mm, ramp_s=0.5),
        )
        for x, y, depth_mm in presses
    )
    return BodiesOnPlate(name="x", seed=0, duration_s=3.0, round_s=3.0, sheet=SHEET, bodies=bodies)


def test_patches_are_as_wide_as_the_body_near_its_point() -> None:
    assert patch_radius_mm(Sphere(radius_mm=6.0)) == pytest.approx(np.sqrt(11.0), abs=0.05)
    assert patch_radius_mm(RoundPunch(radius_mm=4.0)) == pytest.approx(4.0, abs=0.05)
    assert patch_radius_mm(SquarePunch(side_mm=(6.0, 8.0))) == pytest.approx(np.sqrt(48 / np.pi), abs=0.05)


def test_the_sheet_is_as_deep_as_every_body_that_presses() -> None:
    pressed = scene((-30.0, 5.0, 3.0), (20.0, -10.0, 2.0))
    assert isinstance(pressed, Pressing)
    assert SHEET is not None
    place_mm = np.array([[-30.0, 5.0], [20.0, -10.0]])
    depth_mm = -PlateMechanics(sheet=SHEET, scene=pressed).watch(place_mm)(1.5)[:, 2]
    assert depth_mm == pytest.approx([3.0, 2.0], abs=1e-6)
    assert sorted(pressed.loads(1.5)) == [2, 3]
    assert pressed.loads(0.2) == {}
    assert pressed.loads(2.8) == {}


def test_a_body_in_a_deeper_hollow_does_not_pull() -> None:
    pressed = scene((0.0, 0.0, 4.0), (9.0, 0.0, 0.4))
    assert len(pressed.loads(1.5)) == 1
    assert min(load.force_N for load in pressed.loads(1.5).values()) > 0.0


def test_every_touch_has_an_id_of_its_own() -> None:
    pressed = scene((-30.0, 5.0, 3.0)).lasting(9.0)
    ids = [set(pressed.loads(time_s)) for time_s in (1.5, 4.5, 7.5)]
    assert all(len(found) == 1 for found in ids)
    assert len(set.union(*ids)) == 3
