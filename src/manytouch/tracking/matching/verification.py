"""Kernels that drop dots which the displacements of neighbouring nodes contradict: false matches and folds.

A node's displacement must agree with the prediction from its neighbours: by a quadratic fit or, where some
are not known, by lines of the lattice and a robust affine fit, within what the roughness of the field allows.
Where the field is too rough for that, the marker must have moved since the last frame as its neighbours did.
So a part that is wrong by one pitch loses the ring of nodes around it.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from math import sqrt
from typing import NamedTuple

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.tracking.matching.affine_fit import (
    NO_FIT,
    AffineFit,
    fit_affine,
    least_stretch,
    rms_residual,
)
from manytouch.tracking.matching.records import Assignment, DotGrid, GraphArrays, MatchingState, Workspace
from manytouch.tracking.matching.spatial_hash import nearest_free_dot


class VerificationParameters(NamedTuple):
    """How far a displacement may be from its prediction. Distances are in local spacings.

    The tolerance of a prediction is `..._base` plus `..._factor` times the RMS residual of the affine fit.

    Attributes:
        mean_difference, largest_difference: a node is not examined further if the displacements of adjacent
            nodes differ from its own by less than this, in the mean and for each of them.
        motion_difference: nor is a marker that moved since the last frame as its neighbours did in the mean,
            within this tolerance.
        interpolation_base, interpolation_factor: tolerance of the quadratic fit to all neighbours.
        line_base, line_factor: tolerance of extrapolations along lines of the lattice.
        affine_base, affine_factor: tolerance of the affine fit.
        largest: all tolerances are at most this times the least stretch of the pattern.
        least_neighbours: with fewer known neighbours, a dot is dropped unless the frame is calm.
        sparse_count: with fewer known neighbours, the affine fit has the largest tolerance.
        replaceable: a dot is dropped if a dot of no node is nearer to the robust affine fit than this share
            of its own distance from it.
        fold_ratio: a triangle of nodes whose area over that at rest is smaller has turned over or collapsed.
        rounds: how often the worst dots are dropped, at most.
    """

    mean_difference: float = 0.05
    largest_difference: float = 0.2
    motion_difference: float = 0.1
    interpolation_base: float = 0.08
    interpolation_factor: float = 1.0
    line_base: float = 0.12
    line_factor: float = 1.0
    affine_base: float = 0.1
    affine_factor: float = 2.5
    largest: float = 0.42
    least_neighbours: int = 3
    sparse_count: int = 6
    replaceable: float = 0.6
    fold_ratio: float = 0.04
    rounds: int = 8


VERIFICATION = VerificationParameters()
_LEAST_ADJACENT = 3  # for a mean over adjacent nodes


@inlined_kernel()
@no_type_check
def _is_smooth(k: int, graph: GraphArrays, assignment: Assignment, noise_px: float) -> bool:
    """Whether the displacements of the adjacent nodes hardly differ from that of node k."""
    neighbour, dot, displacement = graph.neighbour, assignment.dot, assignment.displacement_px
    mean = VERIFICATION.mean_difference * graph.spacing_px[k] + noise_px
    most = VERIFICATION.largest_difference * graph.spacing_px[k] + noise_px
    x = y = worst = 0.0
    count = 0
    for j in range(graph.start[k], graph.adjacent_end[k]):
        n = neighbour[j]
        if dot[n] >= 0:
            dx, dy = displacement[n, 0] - displacement[k, 0], displacement[n, 1] - displacement[k, 1]
            x += dx
            y += dy
            worst = max(worst, dx * dx + dy * dy)
            count += 1
    return not (count < _LEAST_ADJACENT or x * x + y * y >= (mean * count) ** 2 or worst >= most * most)


@inlined_kernel()
@no_type_check
def _moved_with_neighbours(
    k: int, graph: GraphArrays, state: MatchingState, assignment: Assignment, tolerance_px: float
) -> bool:
    """Whether a marker seen in the last frame moved since then as the adjacent ones did on average."""
    rest, neighbour, last, unseen = graph.rest_px, graph.neighbour, state.position_px, state.frames_unseen
    dot, displacement = assignment.dot, assignment.displacement_px
    if k >= len(last) or unseen[k] > 0:
        return False
    own_x = rest[k, 0] + displacement[k, 0] - last[k, 0]
    own_y = rest[k, 1] + displacement[k, 1] - last[k, 1]
    x = y = 0.0
    count = 0
    for j in range(graph.start[k], graph.adjacent_end[k]):
        n = neighbour[j]
        if n < len(last) and dot[n] >= 0 and unseen[n] == 0:
            x += rest[n, 0] + displacement[n, 0] - last[n, 0] - own_x
            y += rest[n, 1] + displacement[n, 1] - last[n, 1] - own_y
            count += 1
    return count >= _LEAST_ADJACENT and x * x + y * y < (tolerance_px * count) ** 2


@inlined_kernel()
@no_type_check
def line_error(k: int, graph: GraphArrays, assignment: Assignment, squared: np.ndarray) -> float:
    """Distance of a displacement from quadratics and cubics along the lines of the lattice, px.

    The lower median of the distances from all that are known; 0 where there is none. `squared` (6,) is
    workspace.
    """
    opposite, dot, moved = graph.opposite, assignment.dot, assignment.displacement_px
    lines = 0
    for axis in range(2):
        known = 0
        for direction in range(2 * axis, 2 * axis + 2):
            a = opposite[k, direction]
            b = opposite[a, direction] if a >= 0 else -1
            if a < 0 or b < 0 or dot[a] < 0 or dot[b] < 0:
                continue
            known += 1
            c = opposite[b, direction]
            if c >= 0 and dot[c] >= 0:
                x = 3.0 * (moved[a, 0] - moved[b, 0]) + moved[c, 0] - moved[k, 0]
                y = 3.0 * (moved[a, 1] - moved[b, 1]) + moved[c, 1] - moved[k, 1]
                squared[lines] = x * x + y * y
                lines += 1
        if known == 2:
            a, b = opposite[k, 2 * axis], opposite[k, 2 * axis + 1]
            c, d = opposite[a, 2 * axis], opposite[b, 2 * axis + 1]
            x = (4.0 * (moved[a, 0] + moved[b, 0]) - moved[c, 0] - moved[d, 0]) / 6.0 - moved[k, 0]
            y = (4.0 * (moved[a, 1] + moved[b, 1]) - moved[c, 1] - moved[d, 1]) / 6.0 - moved[k, 1]
            squared[lines] = x * x + y * y
            lines += 1
    for i in range(lines):
        below = 0
        for j in range(lines):
            below += squared[j] < squared[i] or (squared[j] == squared[i] and j < i)
        if below == (lines - 1) // 2:
            return sqrt(squared[i])
    return 0.0


@inlined_kernel()
@no_type_check
def interpolation_error(k: int, graph: GraphArrays, assignment: Assignment) -> float:
    """Distance of a displacement from its interpolation between all neighbours, px; inf: one is not known."""
    neighbour, interpolation = graph.neighbour, graph.interpolation
    dot, displacement = assignment.dot, assignment.displacement_px
    x, y = -displacement[k, 0], -displacement[k, 1]
    for j in range(graph.start[k], graph.start[k + 1]):
        if interpolation[j] != 0.0:
            n = neighbour[j]
            if dot[n] < 0:
                return np.inf
            x += interpolation[j] * displacement[n, 0]
            y += interpolation[j] * displacement[n, 1]
    return sqrt(x * x + y * y)


@inlined_kernel()
@no_type_check
def _affine_error(k: int, assignment: Assignment, fit: AffineFit) -> float:
    displacement = assignment.displacement_px
    return sqrt((fit.shift_x - displacement[k, 0]) ** 2 + (fit.shift_y - displacement[k, 1]) ** 2)


@inlined_kernel()
@no_type_check
def _error_ratio(
    k: int,
    graph: GraphArrays,
    state: MatchingState,
    assignment: Assignment,
    noise_px: float,
    is_calm: bool,
    lines: np.ndarray,
) -> float:
    """Distance of a node's displacement from its prediction over the tolerance; above 1 is too far."""
    spacing = graph.spacing_px[k]
    motion_px = VERIFICATION.motion_difference * spacing + noise_px
    if state.is_consecutive and _moved_with_neighbours(k, graph, state, assignment, motion_px):
        return 0.0
    interpolated = np.inf
    if graph.is_interpolated[k]:
        interpolated = interpolation_error(k, graph, assignment)
        if interpolated < VERIFICATION.interpolation_base * spacing + noise_px:
            return 0.0
    fit, used = fit_affine(k, graph, assignment, NO_FIT, False)
    if used < VERIFICATION.least_neighbours:
        return 0.0 if is_calm else 2.0
    rms = rms_residual(k, graph, assignment, fit, False)
    most = VERIFICATION.largest * least_stretch(fit) * spacing
    if interpolated < np.inf:
        allowed = VERIFICATION.interpolation_base * spacing + VERIFICATION.interpolation_factor * rms
        return float(interpolated / min(most, allowed + noise_px))
    allowed = VERIFICATION.line_base * spacing + VERIFICATION.line_factor * rms
    by_line = line_error(k, graph, assignment, lines) / min(most, allowed + noise_px)
    off = _affine_error(k, assignment, fit)
    if used < VERIFICATION.sparse_count:
        return float(max(by_line, off / most))
    allowed = VERIFICATION.affine_base * spacing + VERIFICATION.affine_factor * rms
    if off > min(most, allowed + noise_px):
        for _ in range(2):
            fit, _ = fit_affine(k, graph, assignment, fit, True)
        rms = rms_residual(k, graph, assignment, fit, True)
        allowed = VERIFICATION.affine_base * spacing + VERIFICATION.affine_factor * rms
        off = _affine_error(k, assignment, fit)
    return float(max(by_line, off / min(most, allowed + noise_px)))


@inlined_kernel()
@no_type_check
def _choose_worst(count: int, graph: GraphArrays, error_ratio: np.ndarray, chosen: np.ndarray) -> int:
    """Writes the nodes above 1 that no adjacent node exceeds; returns how many."""
    number = 0
    for k in range(count):
        if error_ratio[k] <= 1.0:
            continue
        is_worst = True
        for j in range(graph.start[k], graph.adjacent_end[k]):
            n = graph.neighbour[j]
            is_larger = n < count and error_ratio[n] > error_ratio[k]
            if is_larger or (n < count and error_ratio[n] == error_ratio[k] and n < k):
                is_worst = False
        if is_worst:
            chosen[number] = k
            number += 1
    return number


@kernel()
@no_type_check
def verify(
    count: int,
    graph: GraphArrays,
    state: MatchingState,
    assignment: Assignment,
    noise_px: float,
    is_calm: bool,
    workspace: Workspace,
) -> int:
    """Drops dots of the first `count` nodes that neighbours contradict, the worst of a neighbourhood first.

    Writes `workspace.error_ratio`. Returns how many were dropped.
    """
    dot, _, is_used = assignment
    start, neighbour = graph.start, graph.neighbour
    ratio, is_changed, chosen = workspace.error_ratio, workspace.flag, workspace.queue
    lines = np.empty(6)
    dropped = 0
    is_changed[:count] = True
    for _ in range(VERIFICATION.rounds):
        worst = 0.0
        for k in range(count):
            if is_changed[k]:
                ratio[k] = 0.0
                is_changed[k] = dot[k] >= 0 and not _is_smooth(k, graph, assignment, noise_px)
        for k in range(count):
            if is_changed[k]:
                is_changed[k] = False
                ratio[k] = _error_ratio(k, graph, state, assignment, noise_px, is_calm, lines)
            worst = max(worst, ratio[k])
        if worst <= 1.0:
            break
        number = _choose_worst(count, graph, ratio, chosen)
        for c in range(number):
            k = chosen[c]
            is_used[dot[k]] = False
            dot[k] = -1
            ratio[k] = 0.0
            for j in range(start[k], start[k + 1]):
                if neighbour[j] < count:
                    is_changed[neighbour[j]] = True
        dropped += number
    return dropped


@kernel()
@no_type_check
def drop_replaceable(
    grid: DotGrid, count: int, graph: GraphArrays, assignment: Assignment, noise_px: float
) -> int:
    """Drops dots of the first `count` nodes where a dot of no node is much nearer to the prediction.

    The prediction is a robust affine fit to the neighbours. Where many dots are missing, a false dot can be
    accepted at the end of a prediction from few neighbours, and then contradicts those that come later.
    Returns how many were dropped.
    """
    dot, _, is_used = assignment
    dropped = 0
    for k in range(count):
        if dot[k] < 0 or _is_smooth(k, graph, assignment, noise_px):
            continue
        fit, used = fit_affine(k, graph, assignment, NO_FIT, False)
        if used < VERIFICATION.least_neighbours:
            continue
        for _ in range(2):
            fit, _ = fit_affine(k, graph, assignment, fit, True)
        off_px = _affine_error(k, assignment, fit)
        x, y = graph.rest_px[k, 0] + fit.shift_x, graph.rest_px[k, 1] + fit.shift_y
        if nearest_free_dot(grid, x, y, VERIFICATION.replaceable * off_px, is_used) >= 0:
            is_used[dot[k]] = False
            dot[k] = -1
            dropped += 1
    return dropped


@inlined_kernel()
@no_type_check
def _twice_area(point: np.ndarray, a: int, b: int, c: int) -> float:
    """Twice the signed area of the triangle of three of the points (n, 2)."""
    area = (point[b, 0] - point[a, 0]) * (point[c, 1] - point[a, 1]) - (point[b, 1] - point[a, 1]) * (
        point[c, 0] - point[a, 0]
    )
    return float(area)


@kernel()
@no_type_check
def drop_folded(
    centre_px: np.ndarray, graph: GraphArrays, assignment: Assignment, error_ratio: np.ndarray
) -> None:
    """Drops the corner with the largest error ratio (N,) of each triangle that turned over or collapsed."""
    dot, _, is_used = assignment
    triangle = graph.triangle
    for t in range(len(triangle)):
        a, b, c = triangle[t]
        if dot[a] < 0 or dot[b] < 0 or dot[c] < 0:
            continue
        now, at_rest = _twice_area(centre_px, dot[a], dot[b], dot[c]), _twice_area(graph.rest_px, a, b, c)
        if now < VERIFICATION.fold_ratio * at_rest:
            worst = a
            if error_ratio[b] > error_ratio[worst]:
                worst = b
            if error_ratio[c] > error_ratio[worst]:
                worst = c
            is_used[dot[worst]] = False
            dot[worst] = -1
