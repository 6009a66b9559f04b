"""One contact or two, from nodal forces of loads that are known exactly."""

import numpy as np
import pytest

from manytouch.estimation.force_clusters import ForceClusters
from manytouch.estimation.split import SplitByMoments
from spline_loads import LATTICE, pressed

CLUSTER, SPLIT = ForceClusters(merge=0.3), SplitByMoments()
NOBODY = np.zeros((0, 2))


def parts(force: np.ndarray, held_mm: np.ndarray = NOBODY):
    return SPLIT(LATTICE, force, CLUSTER(LATTICE, force), held_mm)


@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("angle", [0.0, 0.6, np.pi / 2])
def test_two_narrow_presses_are_told_apart(share: float, angle: float) -> None:
    way = 4.5 * np.array([np.cos(angle), np.sin(angle)])
    force = pressed((*(way + 1.0), 1.0, 1.0), (*(1.0 - way), 1.0, share))
    assert len(CLUSTER(LATTICE, force)) == 1
    found = parts(force)
    assert len(found) == 2
    ends = found.centre_mm if share < 1.0 else found.centre_mm[np.argsort(-found.centre_mm @ way)]
    np.testing.assert_allclose(ends, [way + 1.0, 1.0 - way], atol=0.5)
    # what is trimmed of the weaker one goes to the stronger one
    np.testing.assert_allclose(np.sort(found.normal_mm2), np.sort([1.0, share]), atol=0.05)
    assert set(np.unique(found.label)) == {-1, 0, 1}


def test_one_press_stays_one_however_wide() -> None:
    for radius in (1.0, 4.0, 7.0):
        assert len(parts(pressed((3.0, 2.0, radius, 1.0)))) == 1


def test_a_finger_that_lies_flat_stays_one() -> None:
    bar = pressed(*((x, 0.0, 3.0, 0.1) for x in np.linspace(-6.0, 6.0, 13)))
    assert len(CLUSTER(LATTICE, bar)) == 1
    assert len(parts(bar)) == 1


def test_a_faint_part_is_no_contact() -> None:
    assert len(parts(pressed((-4.0, 0.0, 1.0, 1.0), (4.0, 0.0, 1.0, 0.06)))) == 1


def test_two_that_were_there_are_let_go_later_than_they_are_found() -> None:
    force = pressed((-2.3, 0.0, 1.0, 1.0), (2.3, 0.0, 1.0, 1.0))
    assert len(parts(force)) == 1
    assert len(parts(force, np.array([[-2.3, 0.0], [2.3, 0.0]]))) == 2
    assert len(parts(force, np.array([[-2.3, 0.0], [30.0, 0.0]]))) == 1


def test_others_keep_what_they_have() -> None:
    force = pressed((-20.0, -10.0, 2.0, 3.0), (8.0, 8.0, 1.0, 1.0), (16.0, 8.0, 1.0, 1.0))
    before, after = CLUSTER(LATTICE, force), parts(force)
    assert (len(before), len(after)) == (2, 3)
    np.testing.assert_allclose(after.centre_mm[0], before.centre_mm[0])
    assert after.normal_mm2.sum() == pytest.approx(before.normal_mm2.sum())
