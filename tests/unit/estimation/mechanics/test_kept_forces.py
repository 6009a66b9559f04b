"""What a sheet keeps of an earlier press is no contact, and a light press is."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation import MechanicsEstimator
from manytouch.estimation.mechanics.kept_forces import KeptForces
from manytouch.values import Contacts, TrackedGrid
from manytouch.values.arrays import read_only
from pressed_sheet import disc_mm, pressed, slack_sensor

PLACE_MM = disc_mm(8.0, 4.0, 2.0)
FORCE_MM2 = 0.6
PRESS = [pressed(PLACE_MM, FORCE_MM2, seed) for seed in range(4)]
RELEASED = replace(MechanicsEstimator(), kept_forces=KeptForces(share=0.0))
"""An estimator for a sheet that comes back to its shape at once."""


def crept(share: float, seed: int) -> TrackedGrid:
    """The markers of the untouched sheet with a share of the displacements under the press."""
    rest, press = pressed(PLACE_MM, 0.0, seed), pressed(PLACE_MM, FORCE_MM2, 0)
    moved_px = press.position_px - pressed(PLACE_MM, 0.0, 0).position_px
    return replace(rest, position_px=read_only(rest.position_px + share * moved_px))


def estimates(grids: list[TrackedGrid], estimator: MechanicsEstimator | None = None) -> Iterator[Contacts]:
    estimator = estimator or MechanicsEstimator()
    state = estimator.start(slack_sensor())
    for grid in grids:
        state, _, contacts = estimator.step(state, grid)
        yield contacts


def counts(grids: list[TrackedGrid], estimator: MechanicsEstimator | None = None) -> list[int]:
    return [len(contacts.touching) for contacts in estimates(grids, estimator)]


def test_a_hollow_that_remains_for_a_while_is_no_contact() -> None:
    after = [crept(0.05 * np.exp(-frame / 15.0), seed=10 + frame) for frame in range(20)]
    assert counts(PRESS + after)[len(PRESS) + 2 :] == [0] * 18
    assert sum(counts(PRESS + after, RELEASED)[len(PRESS) + 2 :]) > 5


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_a_press_that_becomes_lighter_stays_a_contact(share: float) -> None:
    lighter = [pressed(PLACE_MM, share * FORCE_MM2, 20 + seed) for seed in range(8)]
    assert counts(PRESS + lighter) == [1] * 12


def test_a_light_press_beside_the_hollow_that_remains_is_a_contact() -> None:
    beside = [
        replace(
            grid,
            position_px=read_only(
                grid.position_px
                + pressed(disc_mm(-16.0, -8.0, 1.0), 0.02, 0).position_px
                - pressed(PLACE_MM, 0.0, 0).position_px
            ),
        )
        for grid in (crept(0.05, seed=10 + frame) for frame in range(6))
    ]
    *_, contacts = estimates(PRESS + beside)
    (contact,) = contacts.touching
    assert contact.centre_mm == pytest.approx([-16.0, -8.0], abs=1.0)


def test_a_light_press_where_a_strong_one_has_ended_is_a_contact_again() -> None:
    rest = [pressed(PLACE_MM, 0.0, 30 + seed) for seed in range(15)]
    light = [pressed(PLACE_MM, 0.03 * FORCE_MM2, 60 + seed) for seed in range(3)]
    assert counts(PRESS + rest + light)[-1] == 1
    at_once = counts(PRESS + light)
    assert at_once[-1] == 0


def test_the_force_of_a_press_that_becomes_lighter_is_less_certain() -> None:
    lighter = [pressed(PLACE_MM, 0.3 * FORCE_MM2, 20 + seed) for seed in range(4)]
    (*_, with_rest), (*_, without) = estimates(PRESS + lighter), estimates(PRESS + lighter, RELEASED)
    (one,), (other,) = with_rest.touching, without.touching
    added = one.std("normal_force") ** 2 - other.std("normal_force") ** 2
    young_MPa = slack_sensor().sheet.young_MPa  # type: ignore[union-attr]
    assert np.sqrt(added) == pytest.approx(0.03 * 0.7 * FORCE_MM2 * young_MPa, rel=0.1)


def test_what_may_remain_fades_and_follows_what_is_left() -> None:
    nodes, rule = MechanicsEstimator().start(slack_sensor()).model.nodes, KeptForces()
    press_mm2 = np.zeros(len(nodes.place_mm))
    press_mm2[len(press_mm2) // 2 + 3] = 1.0
    held = rule.after(nodes, np.zeros_like(press_mm2), press_mm2, elapsed_s=0.1)
    assert held.tolist() == press_mm2.tolist()
    creeping = rule.after(nodes, held, 0.05 * press_mm2, elapsed_s=0.1)
    assert creeping.max() == pytest.approx(np.exp(-0.1 / rule.fade_s))
    gone = rule.after(nodes, held, 0.0 * press_mm2, elapsed_s=0.1)
    assert gone.max() == pytest.approx(np.exp(-0.1 / rule.fade_s - 0.1 / rule.least_fade_s))
    for _ in range(100):
        gone = rule.after(nodes, gone, 0.0 * press_mm2, elapsed_s=0.1)
    assert rule.least_stds * rule.share * gone.sum() <= rule.growth * nodes.least_force_mm2


def test_what_may_remain_fades_as_fast_at_every_frame_rate() -> None:
    nodes, rule = MechanicsEstimator().start(slack_sensor()).model.nodes, KeptForces()
    press_mm2 = np.zeros(len(nodes.place_mm))
    press_mm2[len(press_mm2) // 2 + 3] = 1.0
    found = []
    for fps in (15, 120):
        kept_mm2 = press_mm2
        for _ in range(fps):
            kept_mm2 = rule.after(nodes, kept_mm2, 0.05 * press_mm2, elapsed_s=1.0 / fps)
        found.append(kept_mm2.max())
    assert found == pytest.approx([np.exp(-1.0 / rule.fade_s)] * 2)


def test_a_hollow_that_remains_is_no_contact_at_a_high_frame_rate() -> None:
    fps = 120.0
    after = [crept(0.05 * np.exp(-0.5 * frame / fps), seed=10 + frame) for frame in range(200)]
    timed = [replace(grid, timestamp_ns=round(1e9 * k / fps)) for k, grid in enumerate(PRESS + after)]
    assert not any(counts(timed)[len(PRESS) + 10 :])
