"""Kernels for the relative appearance of dots: area and contrast over the mean of the adjacent dots', less 1.

It is relative to the adjacent dots of the same frame; in this module `appearance` is short for it. Prints are
uneven, and it hardly changes with light or stretch. So a marker has a usual one, by which dots are identified
where the lattice does not do so: weakly one dot, reliably hundreds. It decides whether all identities of a
frame are shifted by whole pitches, not which marker one dot is. NaN: too few adjacent dots are known.

The kernels have in common `dot`, (N,): for each node of the graph the index of its dot, below 0 if it has
none. The first m nodes are the markers, the others exterior nodes.
"""

# ruff: noqa: PLR0917 - compiled functions take positional arguments

from typing import NamedTuple

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.tracking.matching.records import DotArrays, GraphArrays

QUANTITIES = 2
"""Area and contrast."""


class AppearanceParameters(NamedTuple):
    """How appearance is compared.

    Attributes:
        least_adjacent: known adjacent dots that a relative appearance requires.
        largest_difference: larger differences count as this much.
        shift_samples: nodes on which shifts are compared, about.
        check_samples: markers on which a frame's difference from the usual appearance is measured, about.
        least_std: of a difference.
        mean_to_std: standard deviation over mean absolute value of normal differences.
        largest_square: squared difference in standard deviations; larger ones count as this much.
        dependence: so many differences count as one, since adjacent nodes share dots.
    """

    least_adjacent: int = 3
    largest_difference: float = 0.5
    shift_samples: int = 600
    check_samples: int = 300
    least_std: float = 0.003
    mean_to_std: float = 1.2533
    largest_square: float = 9.0
    dependence: float = 8.0


APPEARANCE = AppearanceParameters()


@inlined_kernel()
@no_type_check
def sample_step(count: int, samples: int) -> int:
    """Step between sampled nodes: odd, so that samples do not line up with the rows of most layouts."""
    return count // samples | 1


@kernel()
@no_type_check
def measure_appearance(
    count: int, step: int, dot: np.ndarray, dots: DotArrays, graph: GraphArrays, out: np.ndarray
) -> None:
    """Writes the relative area and contrast of the nodes 0, `step`, 2 `step`, ... below `count`.

    Args:
        count, step: which nodes are measured.
        dot: (N,).
        dots: of the frame.
        graph: whose nodes are adjacent.
        out: (N, 2) or (count, 2); NaN where it is not known. Rows of nodes that are not measured stay as they
            are, which is undefined in a new array.
    """
    area, contrast, neighbour = dots.area_px2, dots.contrast, graph.neighbour
    for k in range(0, count, step):
        out[k, 0] = out[k, 1] = np.nan
        if dot[k] < 0:
            continue
        area_sum = contrast_sum = 0.0
        number = 0
        for j in range(graph.start[k], graph.adjacent_end[k]):
            i = dot[neighbour[j]]
            if i >= 0:
                area_sum += area[i]
                contrast_sum += contrast[i]
                number += 1
        if number >= APPEARANCE.least_adjacent and area_sum > 0.0 and contrast_sum > 0.0:
            out[k, 0] = area[dot[k]] * number / area_sum - 1.0
            out[k, 1] = contrast[dot[k]] * number / contrast_sum - 1.0


@kernel()
@no_type_check
def measure_difference(
    dot: np.ndarray,
    dots: DotArrays,
    graph: GraphArrays,
    usual: np.ndarray,
    workspace: np.ndarray,
    out: np.ndarray,
) -> None:
    """Writes the mean difference of sampled markers from their usual appearance.

    Args:
        dot: (N,).
        dots: of the frame.
        graph: of the markers.
        usual: (m, 2) usual appearance.
        workspace: (N, 2), overwritten.
        out: (2,) of area and contrast; NaN where nothing can be compared.
    """
    markers = len(usual)
    step = sample_step(markers, APPEARANCE.check_samples)
    measure_appearance(markers, step, dot, dots, graph, workspace)
    for quantity in range(QUANTITIES):
        total = 0.0
        number = 0
        for k in range(0, markers, step):
            difference = abs(workspace[k, quantity] - usual[k, quantity])
            if not np.isnan(difference):
                total += min(difference, APPEARANCE.largest_difference)
                number += 1
        out[quantity] = total / number if number else np.nan


@inlined_kernel()
@no_type_check
def running_mean(mean: float, value: float, rate: float) -> float:
    """An exponential running mean after another value; unknown (NaN) means and values are passed over."""
    if np.isnan(value):
        return mean
    return value if np.isnan(mean) else mean + rate * (value - mean)


@kernel()
@no_type_check
def update_appearance(
    dot: np.ndarray,
    dots: DotArrays,
    graph: GraphArrays,
    usual: np.ndarray,
    rate: float,
    out: np.ndarray,
) -> None:
    """Writes the usual appearance of all markers after a frame, which is a running mean.

    Args:
        dot: (N,).
        dots: of the frame.
        graph: of the markers.
        usual: (m, 2) before the frame.
        rate: weight of the frame, 0 to 1.
        out: (m, 2) after it.
    """
    dots, graph = DotArrays(*dots), GraphArrays(*graph)
    measure_appearance(len(usual), 1, dot, dots, graph, out)
    for k in range(len(usual)):
        for quantity in range(QUANTITIES):
            out[k, quantity] = running_mean(usual[k, quantity], out[k, quantity], rate)


@kernel()
@no_type_check
def add_appearance_cost(
    measured: np.ndarray,
    shifted: np.ndarray,
    usual: np.ndarray,
    usual_difference: np.ndarray,
    cost: np.ndarray,
) -> None:
    """Adds to the cost (s,) of each shift how much its appearance differs from the usual one, in nats.

    The standard deviation is at least the usual one, and what the best shift leaves.

    Args:
        measured: (N, 2) appearance of the sampled nodes in this frame; other rows are not read.
        shifted: (s, N) of `GraphArrays`.
        usual: (m, 2) usual appearance.
        usual_difference: (2,) mean difference from it in other frames.
        cost: (s,) increased.
    """
    nodes, markers = shifted.shape[1], len(usual)
    step = sample_step(nodes, APPEARANCE.shift_samples)
    difference = np.empty((len(shifted), (nodes - 1) // step + 1))
    for quantity in range(QUANTITIES):
        if np.isnan(usual_difference[quantity]):
            continue
        least = np.inf
        for s in range(len(shifted)):
            total = 0.0
            number = 0
            for c in range(difference.shape[1]):
                k = c * step
                t = shifted[s, k]
                difference[s, c] = np.nan
                if 0 <= t < markers:
                    difference[s, c] = abs(measured[k, quantity] - usual[t, quantity])
                if not np.isnan(difference[s, c]):
                    total += min(difference[s, c], APPEARANCE.largest_difference)
                    number += 1
            least = min(least, total / number) if number else least
        std = max(APPEARANCE.least_std, APPEARANCE.mean_to_std * max(usual_difference[quantity], least))
        unshifted = compared = 0.0
        for s in range(len(shifted)):
            square = 0.0
            number = 0
            for c in range(difference.shape[1]):
                if not np.isnan(difference[s, c]):
                    square += min((difference[s, c] / std) ** 2, APPEARANCE.largest_square)
                    number += 1
            if s == 0 and number:
                unshifted, compared = square / number, float(number)
            if number:
                cost[s] += 0.5 * compared / APPEARANCE.dependence * (square / number - unshifted)
