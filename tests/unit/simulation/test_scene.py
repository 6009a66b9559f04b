"""Scenes: when and where what presses."""

import numpy as np
import pytest

from manytouch.simulation.scene import SCENES, Press, Scene, fingers

TIMES_S = np.arange(300) / 30


def test_fingers_leaves_its_first_second_alone_and_gathers_five() -> None:
    counts = np.array([len(fingers().loads(time_s)) for time_s in TIMES_S])
    assert counts[:31].max() == 0
    assert counts[-15:].max() == 0
    assert counts.max() == 5
    assert (counts >= 4).sum() > 60
    assert (np.diff(counts) != 0).sum() >= 12


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("seed", [0, 5])
def test_contacts_stay_apart_and_off_the_rim(name: str, seed: int) -> None:
    scene = SCENES[name](seed)
    assert scene.name == name
    for time_s in TIMES_S:
        centre_mm = np.array([load.centre_mm for load in scene.loads(time_s).values()]).reshape(-1, 2)
        assert (np.abs(centre_mm) < [48, 28]).all()
        distance = np.linalg.norm(centre_mm[:, None] - centre_mm[None], axis=-1) + 1e3 * np.eye(
            len(centre_mm)
        )
        assert distance.min(initial=1e3) > 24


def test_seeds_make_scenes() -> None:
    assert fingers(3).loads(2.5) == pytest.approx(fingers(3).loads(2.5)) or repr(fingers(3)) == repr(
        fingers(3)
    )
    assert repr(fingers(3).presses) != repr(fingers(4).presses)


def test_press_rises_slides_and_falls() -> None:
    press = Press(start_s=1.0, end_s=3.0, from_mm=(0.0, 0.0), to_mm=(10.0, -4.0), force_N=2.0, ramp_s=0.5)
    assert press.load(1.0) is None
    assert press.load(3.0) is None
    rising, middle, falling = (press.load(time_s) for time_s in (1.25, 2.0, 2.75))
    assert rising is not None
    assert middle is not None
    assert falling is not None
    assert (rising.force_N, middle.force_N, falling.force_N) == pytest.approx((1.0, 2.0, 1.0))
    assert rising.centre_mm == (0.0, 0.0)
    assert middle.centre_mm == pytest.approx((5.0, -2.0))
    assert falling.centre_mm == pytest.approx((10.0, -4.0))


def test_scenes_repeat_and_end() -> None:
    scene = fingers()
    longer = scene.lasting(24.0)
    assert longer.duration_s == 24.0
    assert [press.start_s for press in longer.presses] == sorted(press.start_s for press in longer.presses)
    again = longer.loads(16.9)
    assert {id_ - len(scene.presses) for id_ in again} == set(scene.loads(6.9))
    assert len(scene.lasting(1.5).presses) == 1
    assert Scene(name="x", duration_s=2.0, presses=()).lasting(7.0).presses == ()
