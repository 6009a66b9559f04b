"""A contact slips when it moves and its shear no longer grows."""

import numpy as np
import pytest

from contacts import contact_with
from manytouch.estimation.slip_detector import SlipDetector, SlipState
from manytouch.values import Contact, Contacts, Phase

DETECT = SlipDetector()


def contact(x_mm: float, shear: float, *, id_: int = 3, phase: Phase = Phase.MOVE) -> Contact:
    return contact_with(
        id=id_,
        phase=phase,
        centre_mm=np.array([x_mm, 0.0]),
        area_mm2=10.0,
        normal_force_over_E_mm2=1.0,
        shear_over_E_mm2=(0.6 * shear, 0.8 * shear),
    )


def flags(course: list[tuple[float, float]], *, fps: float = 30.0) -> list[bool | None]:
    state, slips = SlipState(), []
    for x_mm, shear in course:
        touching = Contacts(contacts=(contact(x_mm, shear),))
        state, contacts = DETECT(state, touching, 4.0, elapsed_s=1.0 / fps)
        slips.append(contacts.contacts[0].slip)
    return slips


def test_a_drag_sticks_while_it_rests_and_slips_once_it_moves_at_full_shear() -> None:
    sticking = [(0.0, 0.1 * k) for k in range(5)]
    sliding = [(0.6 * k, 0.4) for k in range(1, 6)]
    assert flags(sticking + sliding) == [None] + [False] * 4 + [True] * 5


@pytest.mark.parametrize("fps", [15.0, 30.0, 120.0])
@pytest.mark.parametrize(("speed_mm_per_s", "slips"), [(2.0, False), (8.0, True)])
def test_the_speed_of_a_contact_that_slips_does_not_depend_on_the_frame_rate(
    fps: float, speed_mm_per_s: float, slips: bool
) -> None:
    sliding = [(speed_mm_per_s * k / fps, 0.4) for k in range(round(fps))]
    assert flags(sliding, fps=fps)[-1] is slips


def test_rolling_without_shear_and_easing_off_are_no_slip() -> None:
    assert not any(flags([(0.6 * k, 0.02) for k in range(8)]))
    assert not any(flags([(0.0, 0.5)] + [(0.6 * k, 0.2) for k in range(1, 6)]))


@pytest.mark.parametrize(
    ("course", "last"),
    [
        ([(0.0, 0.4), (0.6, 0.4)], True),
        ([(0.0, 0.4)] * 2, False),
        ([(0.0, 0.4)], None),
        ([(0.0, np.nan)], None),
    ],
)
def test_a_contact_that_ends_keeps_its_last_flag(
    course: list[tuple[float, float]], last: bool | None
) -> None:
    state = SlipState()
    for x_mm, shear in course:
        now = Contacts(contacts=(contact(x_mm, shear),))
        state, touching = DETECT(state, now, 4.0, elapsed_s=0.03)
    assert touching.contacts[0].slip is last
    ended = Contacts(contacts=(contact(0.6, 0.4, phase=Phase.END),))
    state, contacts = DETECT(state, ended, 4.0, elapsed_s=0.03)
    assert contacts.contacts[0].slip is last
    assert not state.ratio
    assert not state.is_slipping


def test_a_contact_that_ends_without_a_flag_before_has_none() -> None:
    ended = Contacts(contacts=(contact(0.0, 0.5, phase=Phase.END),))
    state, contacts = DETECT(SlipState(), ended, 4.0, elapsed_s=0.03)
    assert contacts.contacts[0].slip is None
    assert not state.ratio
