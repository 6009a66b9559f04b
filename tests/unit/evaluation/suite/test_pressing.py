"""Cases as loadings of the solid: depths, forces in a ratio, and drag, on small coarse sheets."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from manytouch.evaluation.suite.cases import RAMP_FRAMES, REST_FRAMES, Case, Touch, pressure_share
from manytouch.evaluation.suite.pressing import DRAG_MM, Pressed, sheet_model, solve_presses

pytest.importorskip("skfem")

ONE = Case(
    group="nominal",
    name="small",
    seed=5,
    looked_at=True,
    touches=(Touch(at_mm=(3.0, -2.0), radius_mm=5.0, strength=1.5),),
    deepest_mm=1.5,
    size_mm=(32.0, 24.0),
)
PAIR = replace(
    ONE,
    group="separation",
    touches=tuple(Touch(at_mm=(x, 1.0), radius_mm=4.0, strength=s) for x, s in ((-5.0, 1.0), (5.0, 0.3))),
    strength_is="force",
    deepest_mm=1.2,
)


@cache
def steps(case: Case) -> list[Pressed]:
    return list(solve_presses(case, element_mm=4.0))


def forces_N(step: Pressed) -> np.ndarray:
    return np.array([contact.normal_force_N for contact in step.state.contacts])


def depths_mm(step: Pressed) -> np.ndarray:
    return np.array([3.0 - touch.position_mm[0, 2] for touch in step.loading.touches])


def test_every_frame_of_the_ramp_is_an_equilibrium_with_the_ball_as_deep_as_the_case_requires() -> None:
    found = steps(ONE)
    assert [step.state.status for step in found] == ["ok"] * RAMP_FRAMES
    required = [1.5 * pressure_share(REST_FRAMES + step) for step in range(RAMP_FRAMES)]
    assert np.concatenate([depths_mm(step) for step in found]) == pytest.approx(required)
    assert (np.diff([forces_N(step)[0] for step in found]) > 0).all()
    assert found[-1].state.contacts[0].centre_mm == pytest.approx([3.0, -2.0], abs=0.5)


def test_the_solid_has_the_sheet_of_the_case() -> None:
    model = sheet_model(replace(ONE, thickness_mm=2.0, young_MPa=1.0, pretension_N_per_mm=0.1))
    assert (model.size_mm, model.thickness_mm, model.material.young_MPa) == ((32.0, 24.0), 2.0, 1.0)
    assert (model.pretension_N_per_mm, model.element_mm) == (0.1, 2.0)


def test_forces_stand_in_their_ratio_all_along() -> None:
    for step in steps(PAIR):
        strong_N, weak_N = forces_N(step)
        assert weak_N == pytest.approx(0.3 * strong_N, rel=0.02)
    deep_mm, other_mm = depths_mm(steps(PAIR)[-1])
    assert deep_mm == pytest.approx(1.2)
    assert 0.0 < other_mm < deep_mm


def test_a_ball_with_friction_is_dragged_and_slips_at_the_end() -> None:
    slippery = replace(ONE, friction=0.3, seed=6)
    last = steps(slippery)[-1]
    moved_mm = last.loading.touches[0].position_mm[0, :2] - np.array([3.0, -2.0])
    assert np.linalg.norm(moved_mm) == pytest.approx(DRAG_MM)
    force_N = last.state.contacts[0].force_N
    assert force_N[:2] @ moved_mm / DRAG_MM > 0.2 * -force_N[2]
    assert np.linalg.norm(force_N[:2]) < 0.45 * -force_N[2]  # friction, and the slope of the sheet
