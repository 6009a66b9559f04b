"""Contact of the live sheet with rigid bodies, compiled; derivation in docs/derivations/live-sheet.md."""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

from typing import NamedTuple

import numpy as np

from manytouch.compilation import kernel, no_type_check
from manytouch.simulation.fem.contact import distance
from manytouch.simulation.shell.kernels import ElasticBuffers


class BodyArrays(NamedTuple):
    """Rigid bodies that press.

    Attributes:
        kind, numbers: (n,), (n, k) kinds and parameters of the shapes, see `distance.signed_distance`.
        position_mm: (n, 3) of their lowest points in the sheet frame, z from the middle surface at rest.
        rotation: (n, 3, 3) sheet_from_body.
        reach_mm: (n,) from `position_mm` to the furthest point that can touch.
    """

    kind: np.ndarray
    numbers: np.ndarray
    position_mm: np.ndarray
    rotation: np.ndarray
    reach_mm: np.ndarray


class Bed(NamedTuple):
    """Springs between the touched face and the bodies.

    Attributes:
        half_mm: half of the sheet's thickness.
        stiffness_MPa_per_mm: pressure over penetration.
    """

    half_mm: float
    stiffness_MPa_per_mm: float


class BodyLoads(NamedTuple):
    """What the bodies do to the sheet.

    Attributes:
        resultant: (n, 7) in the sheet frame: force on the sheet (3), N, z < 0 for a press; its torque about
            the z axis through the centre of the sheet, N mm; sums of its z component times undeformed x and
            y, N mm; undeformed area in contact, mm^2.
        body_at: (a', b') number of the body at each contact point, two along each side of a cell; -1 for
            none.
        normal_N: (a', b') its normal force there, positive for a press; 0 without a body.
    """

    resultant: np.ndarray
    body_at: np.ndarray
    normal_N: np.ndarray


@kernel()
@no_type_check
def _cells(position: float, reach: float, spacing: float, count: int) -> tuple[int, int]:
    """First and one beyond the last of the cells along an axis that a body can touch."""
    start = -0.5 * spacing * count
    first = max(int((position - reach - start) / spacing), 0)
    return first, min(int((position + reach - start) / spacing) + 1, count)


@kernel()
@no_type_check
def _to_body_frame(place: np.ndarray, position: np.ndarray, rotation: np.ndarray, local: np.ndarray) -> float:
    """Fill local (3,) with a place in the frame of a body; return its squared distance from the origin.

    The distance is infinite where the place is not above the lowest point of the body.
    """
    for k in range(3):
        local[k] = 0.0
        for m in range(3):
            local[k] += rotation[m, k] * (place[m] - position[m])
    if local[2] <= 0.0:
        return np.inf
    return float(local[0] ** 2 + local[1] ** 2 + local[2] ** 2)


class _Point(NamedTuple):
    """A contact point in a cell of the grid: first node (i, j), shape functions (4,), quarter.

    The quarter is 2 for the upper half along x, plus 1 for the upper half along y.
    """

    i: int
    j: int
    quarter: int
    shape: np.ndarray


@kernel()
@no_type_check
def _face_point(
    point: _Point, value: np.ndarray, fibre: np.ndarray, spacing: np.ndarray, half: float, here: np.ndarray
) -> tuple[float, float]:
    """Fill the present place (3,) of a contact point of the touched face; return undeformed x and y, mm."""
    i, j, shape = point.i, point.j, point.shape
    s, r = 0.25 + 0.5 * (point.quarter // 2), 0.25 + 0.5 * (point.quarter % 2)
    shape[0], shape[1], shape[2], shape[3] = (1 - s) * (1 - r), (1 - s) * r, s * (1 - r), s * r
    here[0] = (i + s - 0.5 * (value.shape[1] - 1)) * spacing[0]
    here[1] = (j + r - 0.5 * (value.shape[2] - 1)) * spacing[1]
    here[2] = 0.0
    rest_x, rest_y = here[0], here[1]
    for node in range(4):
        at_i, at_j = i + node // 2, j + node % 2
        for k in range(3):
            here[k] += shape[node] * (value[k, at_i, at_j] + half * fibre[k, at_i, at_j])
    return rest_x, rest_y


@kernel()
@no_type_check
def contact_energy(
    value: np.ndarray,
    spacing: np.ndarray,
    bed: Bed,
    bodies: BodyArrays,
    buffers: ElasticBuffers,
    out: np.ndarray,
    loads: BodyLoads,
) -> float:
    """Energy of the contact in N mm, evaluated at four points of each cell of the touched face.

    Args:
        value: (5, a, b) displacements in mm and tilts.
        spacing: (2,) of the grid, mm.
        bed: of the touched face.
        bodies: that press.
        buffers: of `elastic`, whose derivatives by the fibres are added to.
        out: (5, a, b), whose derivatives by displacement are added to.
        loads: filled.
    """
    fibre, by_fibre, half, stiffness = buffers.fibre, buffers.by_fibre, bed.half_mm, bed.stiffness_MPa_per_mm
    weight = 0.25 * spacing[0] * spacing[1]
    normal, curvature = np.empty(3), np.empty((3, 3))
    here, local, push, shape = np.empty(3), np.empty(3), np.empty(3), np.empty(4)
    loads.resultant[:] = 0.0
    loads.body_at[:] = -1
    loads.normal_N[:] = 0.0
    total = 0.0
    for body in range(bodies.kind.shape[0]):
        position, rotation, reach = bodies.position_mm[body], bodies.rotation[body], bodies.reach_mm[body]
        resultant = loads.resultant[body]
        first_i, last_i = _cells(position[0], reach, spacing[0], value.shape[1] - 1)
        first_j, last_j = _cells(position[1], reach, spacing[1], value.shape[2] - 1)
        for place in range(4 * max(last_i - first_i, 0) * max(last_j - first_j, 0)):
            cell, quarter = place // 4, place % 4
            i, j = first_i + cell // (last_j - first_j), first_j + cell % (last_j - first_j)
            rest_x, rest_y = _face_point(_Point(i, j, quarter, shape), value, fibre, spacing, half, here)
            if _to_body_frame(here, position, rotation, local) > reach**2:
                continue
            depth = distance.signed_distance(
                bodies.kind[body], bodies.numbers[body], local, normal, curvature
            )
            if depth >= 0.0:
                continue
            total += 0.5 * stiffness * weight * depth * depth
            for k in range(3):
                push[k] = 0.0
                for m in range(3):
                    push[k] -= rotation[k, m] * normal[m] * stiffness * weight * depth
                resultant[k] += push[k]
                for node in range(4):
                    at_i, at_j = i + node // 2, j + node % 2
                    out[k, at_i, at_j] -= shape[node] * push[k]
                    by_fibre[k, at_i, at_j] -= shape[node] * half * push[k]
            loads.body_at[2 * i + quarter // 2, 2 * j + quarter % 2] = body
            loads.normal_N[2 * i + quarter // 2, 2 * j + quarter % 2] = -push[2]
            resultant[3] += here[0] * push[1] - here[1] * push[0]
            resultant[4] += rest_x * push[2]
            resultant[5] += rest_y * push[2]
            resultant[6] += weight
    return total
