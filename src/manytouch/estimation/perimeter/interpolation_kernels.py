"""Compiled loops that interpolate the displacements of markers that are not seen."""

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.estimation.perimeter.surface_inputs import InterpolationRule
from manytouch.values.arrays import Flags, Floats


@kernel()
@no_type_check
def _interpolate_one(
    m: int, rule: InterpolationRule, known: Flags, displacement: Floats, covariance: Floats
) -> None:
    """Sets marker m to the weighted mean of its known neighbours."""
    near, distance = rule.neighbour[m], rule.distance[m]
    total = x = y = 0.0
    for k in range(len(near)):
        n = near[k]
        if known[n]:
            weight = 1.0 / (distance[k] * distance[k])
            total += weight
            x += weight * displacement[n, 0]
            y += weight * displacement[n, 1]
    x, y = x / total, y / total
    xx = xy = yy = 0.0
    for k in range(len(near)):
        n = near[k]
        if known[n]:
            weight = 1.0 / (distance[k] * distance[k] * total)
            a, b = displacement[n, 0] - x, displacement[n, 1] - y
            xx += weight * (covariance[n, 0, 0] + rule.spread * a * a)
            xy += weight * (covariance[n, 0, 1] + rule.spread * a * b)
            yy += weight * (covariance[n, 1, 1] + rule.spread * b * b)
    displacement[m, 0], displacement[m, 1] = x, y
    covariance[m, 0, 0], covariance[m, 1, 1] = xx + rule.floor * rule.floor, yy + rule.floor * rule.floor
    covariance[m, 0, 1] = covariance[m, 1, 0] = xy


@kernel()
@no_type_check
def interpolate_unseen(
    displacement: Floats, covariance: Floats, is_seen: Flags, rule: InterpolationRule
) -> tuple[Floats, Floats]:
    """Displacements (m, 2) and covariances (m, 2, 2) of all markers; gaps are filled from the edge inward."""
    displacement, covariance, known = displacement.copy(), covariance.copy(), is_seen.copy()
    far = rule.unknown_std
    for m in range(len(displacement)):
        if not known[m]:
            displacement[m, 0] = displacement[m, 1] = covariance[m, 0, 1] = covariance[m, 1, 0] = 0.0
            covariance[m, 0, 0] = covariance[m, 1, 1] = far * far
    rim = np.empty(len(displacement), np.int64)
    for _ in range(rule.rounds):
        number = 0
        for m in range(len(displacement)):
            if not known[m]:
                for k in range(rule.neighbour.shape[1]):
                    if known[rule.neighbour[m, k]]:
                        rim[number] = m
                        number += 1
                        break
        if number == 0:
            break
        for m in rim[:number]:
            _interpolate_one(m, rule, known, displacement, covariance)
        for m in rim[:number]:
            known[m] = True
    return displacement, covariance
