"""The choice of a shift, against plain numpy."""

import numpy as np
import pytest

from manytouch.tracking.lattice_graph import EXTERIOR_HIDDEN, PRESENT
from manytouch.tracking.matching.growth import fill_displacements
from manytouch.tracking.matching.records import MatchingState
from manytouch.tracking.matching.shift_ambiguity import (
    SHIFT,
    approximate_median,
    choose_shift,
    is_rigid_jump,
)


def make_state(scene, position_px, *, is_consecutive):
    markers, kind = scene.graph.marker_count, scene.graph.arrays.kind
    return MatchingState(
        position_px=position_px,
        frames_unseen=np.zeros(markers, dtype=np.int64),
        presence=np.where(kind == PRESENT, 0.95, 0.003),
        seen_count=markers,
        roughness=0.0,
        is_consecutive=is_consecutive,
        is_ambiguous=False,
        appearance=np.full((markers, 2), np.nan),
        appearance_difference=np.full(2, np.nan),
    )


def reference_costs(scene, dot, position, state, noise):
    """Costs (s,) of occupancy and of roughness, and median motions (s,), of each shift."""
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    has_dot, bounds = dot >= 0, graph.bounds_px
    is_shown = ((position > bounds[:2]) & (position < bounds[2:])).all(axis=1)
    counted = is_shown & (graph.kind == PRESENT)
    visible = (counted & has_dot).sum() / max(state.presence[counted].sum(), 1.0)
    visible = min(1.0, max(SHIFT.least_visible, visible))
    is_hidden = graph.kind == EXTERIOR_HIDDEN
    full = np.where(is_hidden, SHIFT.hidden_cost, -np.log(state.presence))
    empty = np.where(is_hidden, SHIFT.hidden_cost, -np.log(1.0 - state.presence * visible))
    beyond = np.where(is_hidden, SHIFT.hidden_cost, -np.log(SHIFT.clutter))
    occupancy, roughness, motion, bends = [], [], [], []
    for shifted in graph.shifted:
        on = shifted >= 0
        cost = np.where(on, full[shifted], beyond)[has_dot].sum()
        occupancy.append(cost + empty[shifted[~has_dot & on & is_shown]].sum())
        moved = has_dot & on & (shifted < markers)
        off = np.linalg.norm(position[moved] - state.position_px[shifted[moved]], axis=1)
        motion.append(np.median(off / graph.spacing_px[moved]) if moved.any() else np.inf)
        bend = []
        for k in np.flatnonzero(has_dot & on):
            pairs = zip(
                graph.opposite[k].reshape(2, 2), graph.opposite[shifted[k]].reshape(2, 2), strict=True
            )
            for (a, b), (ta, tb) in pairs:
                if min(a, b, ta, tb) >= 0 and min(dot[a], dot[b]) >= 0:
                    now = position[a] + position[b] - 2.0 * position[k]
                    rest = graph.rest_px[ta] + graph.rest_px[tb] - 2.0 * graph.rest_px[shifted[k]]
                    bend.append(np.linalg.norm(now - rest) / graph.spacing_px[k])
        bends.append(bend)
    least = max(SHIFT.least_roughness, noise / graph.spacing_px[0])
    for bend in bends:
        enough = len(bend) >= len(bends[0]) // 2
        value = np.median(bend) if enough else np.median(bends[0])
        roughness.append(len(bends[0]) / SHIFT.dependence * np.log(least + value))
    return np.array(occupancy), np.array(roughness), np.array(motion)


@pytest.mark.parametrize("shift", [0, 2, 9])
def test_the_chosen_shift_has_the_least_cost(scene, shift):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    assignment = scene.assignment(0.9)
    # Identities are wrong by the shift: the node that each dot belongs to becomes another.
    back = np.full(len(assignment.dot), -1)
    on = graph.shifted[shift] >= 0
    back[on] = assignment.dot[graph.shifted[shift][on]]
    assignment.dot[:] = back
    known = back >= 0
    assignment.displacement_px[known] = scene.dots.centre_px[back[known]] - graph.rest_px[known]
    fill_displacements(len(back), graph, assignment, scene.workspace)
    position = graph.rest_px + assignment.displacement_px
    true_px = scene.dots.centre_px[scene.true_dot[:markers]]
    state = make_state(scene, true_px, is_consecutive=True)
    choice = choose_shift(scene.dots, assignment.dot, position, graph, state, 0.02)
    occupancy, roughness, motion = reference_costs(scene, assignment.dot, position, state, 0.02)
    rate = SHIFT.slow_motion_cost if motion[0] < SHIFT.slow_motion else SHIFT.motion_cost
    total = occupancy + roughness + rate * np.minimum(motion, SHIFT.largest_motion)
    assert choice.shift == np.argmin(total) == shift
    others = np.arange(len(total)) != choice.shift
    # The kernel's median lies anywhere between the two middle values.
    measured = (occupancy + roughness)[others] - (occupancy + roughness)[choice.shift]
    assert choice.margin == pytest.approx(measured.min(), abs=0.3)
    rough = roughness[others] - roughness[choice.shift]
    assert choice.measured_margin == pytest.approx(rough.min(), abs=0.3)
    assert choice.motion == pytest.approx(motion[choice.shift], abs=1e-3)


@pytest.mark.parametrize("shift", [0, 4])
def test_a_rigid_jump_is_one_by_some_shift_only(scene, shift):
    graph, markers = scene.graph.arrays, scene.graph.marker_count
    chance = np.random.default_rng(3)
    last = graph.rest_px[:markers] + chance.normal(0.0, 4.0, (markers, 2))
    dot = np.full(len(graph.rest_px), -1)
    target = graph.shifted[shift]
    dot[:markers] = np.where((target[:markers] >= 0) & (target[:markers] < markers), target[:markers], -1)
    centre = last + np.array([7.0, -3.0])  # dot i is marker i, moved rigidly
    unseen = np.zeros(markers, dtype=np.int64)
    assert is_rigid_jump(centre, dot, graph.shifted, last, unseen, 0.02) == (shift != 0)
    scattered = centre + chance.normal(0.0, 8.0, centre.shape)
    assert not is_rigid_jump(scattered, dot, graph.shifted, last, unseen, 0.02)


@pytest.mark.parametrize("number", [1, 2, 7, 500])
def test_the_approximate_median_is_near_the_median(number: int) -> None:
    chance = np.random.default_rng(number)
    value = (1e-6 * chance.lognormal(0.0, 3.0, number)).astype(np.float32)
    ordered = np.sort(value)
    least, most = ordered[(number - 1) // 2], ordered[number // 2]
    assert least * (1 - 1e-3) <= approximate_median(value) <= most * (1 + 1e-3)


def test_the_median_of_zeros_is_zero() -> None:
    assert approximate_median(np.zeros(5, np.float32)) == 0.0
    assert approximate_median(np.array([0.0, 0.0, 3.0], np.float32)) == 0.0
