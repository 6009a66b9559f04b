"""Contact of the coarse sheet with balls, compiled.

As `shell.body_kernels.contact_energy`, but for balls only, with nine points per cell instead of four, since
cells are larger, and with a stiffness of the face for each ball. The distance to a ball is computed in place.
"""

# ruff: noqa: PLR0915, PLR0917 - compiled functions, called with positional arguments

import math
from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.shell.body_kernels import Bed, BodyLoads
from manytouch.simulation.shell.kernels import ElasticBuffers

POINTS = 3
"""Points of a cell along each axis at which the contact is evaluated."""
MARGIN_MM = 1.0
"""Farthest sideways motion of a point of the sheet that a ball touches: cells whose undeformed place is
farther from the ball than its radius and this are skipped."""


class Balls(NamedTuple):
    """Balls that press, in the sheet frame.

    Attributes:
        centre_mm: (n, 3), z from the middle surface at rest.
        radius_mm: (n,).
        stiffness_MPa_per_mm: (n,) of the touched face under each.
    """

    centre_mm: np.ndarray
    radius_mm: np.ndarray
    stiffness_MPa_per_mm: np.ndarray


@kernel()
@no_type_check
def ball_contact_energy(
    value: np.ndarray,
    spacing: np.ndarray,
    bed: Bed,
    balls: Balls,
    buffers: ElasticBuffers,
    out: np.ndarray,
    loads: BodyLoads,
) -> float:
    """Energy of the contact with balls in N mm; positions and derivatives in the sheet frame.

    Args:
        value: (5, a, b) displacements in mm and tilts.
        spacing: (2,) of the grid along x and y, mm.
        bed: of the touched face; its stiffness is not used.
        balls: that press.
        buffers: of `elastic`, whose derivatives by the fibres are added to.
        out: (5, a, b), whose derivatives by displacement, N, are added to.
        loads: filled; there are `POINTS` places for each cell along each axis.
    """
    fibre, by_fibre, half = buffers.fibre, buffers.by_fibre, bed.half_mm
    columns, rows = value.shape[1] - 1, value.shape[2] - 1
    low_x, low_y = -0.5 * columns * spacing[0], -0.5 * rows * spacing[1]
    weight = spacing[0] * spacing[1] / POINTS**2
    resultant, body_at, normal_N = loads.resultant, loads.body_at, loads.normal_N
    resultant[:] = 0.0
    body_at[:] = -1
    normal_N[:] = 0.0
    total = 0.0
    for ball in range(balls.radius_mm.shape[0]):
        x, y, z = balls.centre_mm[ball, 0], balls.centre_mm[ball, 1], balls.centre_mm[ball, 2]
        radius, stiffness = balls.radius_mm[ball], balls.stiffness_MPa_per_mm[ball]
        reach = radius + MARGIN_MM
        first_i = max(int((x - reach - low_x) / spacing[0]), 0)
        last_i = min(int((x + reach - low_x) / spacing[0]) + 1, columns)
        first_j = max(int((y - reach - low_y) / spacing[1]), 0)
        last_j = min(int((y + reach - low_y) / spacing[1]) + 1, rows)
        for i in range(first_i, last_i):
            for j in range(first_j, last_j):
                for point in range(POINTS * POINTS):
                    a, b = point // POINTS, point % POINTS
                    s, r = (a + 0.5) / POINTS, (b + 0.5) / POINTS
                    w0, w1, w2, w3 = (1 - s) * (1 - r), (1 - s) * r, s * (1 - r), s * r
                    rest_x, rest_y = low_x + (i + s) * spacing[0], low_y + (j + r) * spacing[1]
                    dx = rest_x - x + w0 * (value[0, i, j] + half * fibre[0, i, j])
                    dy = rest_y - y + w0 * (value[1, i, j] + half * fibre[1, i, j])
                    dz = -z + w0 * (value[2, i, j] + half * fibre[2, i, j])
                    dx += w1 * (value[0, i, j + 1] + half * fibre[0, i, j + 1])
                    dy += w1 * (value[1, i, j + 1] + half * fibre[1, i, j + 1])
                    dz += w1 * (value[2, i, j + 1] + half * fibre[2, i, j + 1])
                    dx += w2 * (value[0, i + 1, j] + half * fibre[0, i + 1, j])
                    dy += w2 * (value[1, i + 1, j] + half * fibre[1, i + 1, j])
                    dz += w2 * (value[2, i + 1, j] + half * fibre[2, i + 1, j])
                    dx += w3 * (value[0, i + 1, j + 1] + half * fibre[0, i + 1, j + 1])
                    dy += w3 * (value[1, i + 1, j + 1] + half * fibre[1, i + 1, j + 1])
                    dz += w3 * (value[2, i + 1, j + 1] + half * fibre[2, i + 1, j + 1])
                    square = dx * dx + dy * dy + dz * dz
                    if square >= radius * radius:
                        continue
                    distance = math.sqrt(square)
                    depth = radius - distance
                    total += 0.5 * stiffness * weight * depth * depth
                    factor = -stiffness * weight * depth / max(distance, 1e-9)
                    push = (factor * -dx, factor * -dy, factor * -dz)
                    for k in range(3):
                        resultant[ball, k] += push[k]
                        out[k, i, j] -= w0 * push[k]
                        out[k, i, j + 1] -= w1 * push[k]
                        out[k, i + 1, j] -= w2 * push[k]
                        out[k, i + 1, j + 1] -= w3 * push[k]
                        by_fibre[k, i, j] -= w0 * half * push[k]
                        by_fibre[k, i, j + 1] -= w1 * half * push[k]
                        by_fibre[k, i + 1, j] -= w2 * half * push[k]
                        by_fibre[k, i + 1, j + 1] -= w3 * half * push[k]
                    here_x, here_y = x + dx, y + dy
                    resultant[ball, 3] += here_x * push[1] - here_y * push[0]
                    resultant[ball, 4] += rest_x * push[2]
                    resultant[ball, 5] += rest_y * push[2]
                    resultant[ball, 6] += weight
                    body_at[POINTS * i + a, POINTS * j + b] = ball
                    normal_N[POINTS * i + a, POINTS * j + b] = -push[2]
    return total
