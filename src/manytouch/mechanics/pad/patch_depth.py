"""The depth of an unbounded layer under a rigid ball, a rigid flat face or a ring, from force and width."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.special import gamma, jv, roots_legendre

from manytouch.compilation import kernel, no_type_check
from manytouch.mechanics.pad.layer import point_depth

_WIDTHS = (0.1, 0.28, 0.42, 0.55, 0.8, 1.05, 1.5)
_BALL = (0.5, 0.52, 0.585, 0.67, 0.845, 0.97, 1.13)
_FACE = (-0.497, -0.474, -0.414, -0.347, -0.238, -0.147, -0.034)
"""Roots of the second moment of a pressure, in thicknesses, and exponents e of (1 - r^2)^e: those that have
the mean of r^4 of the pressure under a frictionless ball on the layer, and those that have the root of that
under a frictionless disc of the same radius. On a half-space they are 1/2 and -1/2. They are those for a
Poisson's ratio of .48; from .45 to .495 they differ by less than .04 up to a root of .8."""
_REACH = 12.0  # of the table, in thicknesses; the depth there is 1e-4 of that at one
_STEP = 0.02  # the same of its distances
_RADII = 16  # of the quadrature over a patch
_ANGLES = 32  # the same, over half a turn; within .3 % for patches ten times as long as wide
_WAVES, _LARGEST = 1500, 300.0  # wave numbers times the radius of a disc, for its correlation with itself


class PatchDepthTable(NamedTuple):
    """A layer and the pressures under a ball, a flat face and a ring on it, for compiled functions.

    Attributes:
        by_distance: (n,) `layer.point_depth` at each distance, 1/E.
        step: of the distances, mm.
        width: (w,) roots of the second moments, mm.
        reach: (3, w) squared radius of a disc with each pressure over its second moment along an axis.
        place, weight: (3, w, q) distances over the radius of the disc, and the weights of `by_distance`
            there.
    """

    by_distance: Float64[np.ndarray, " n"]
    step: float
    width: Float64[np.ndarray, " w"]
    reach: Float64[np.ndarray, "3 w"]
    place: Float64[np.ndarray, "3 w q"]
    weight: Float64[np.ndarray, "3 w q"]


def patch_depth_table(thickness_mm: float, poisson: float) -> PatchDepthTable:
    """The table of a layer."""
    distance_mm = thickness_mm * np.arange(0.0, _REACH + _STEP, _STEP)
    ball, face = np.array(_BALL), np.array(_FACE)
    node, share = roots_legendre(_RADII)
    one, two = 0.5 * (node + 1.0), node + 1.0  # places on one disc are up to two radii apart
    centre = 0.5 * share * (ball[:, None] + 1.0) / np.pi * (1.0 - one**2) ** ball[:, None]
    work = share * np.stack([_with_itself(exponent, two) for exponent in _FACE])
    ring = np.full_like(centre, 1.0 / (2.0 * np.pi * _RADII))
    return PatchDepthTable(
        by_distance=point_depth(distance_mm, thickness_mm, poisson),
        step=_STEP * thickness_mm,
        width=thickness_mm * np.array(_WIDTHS),
        reach=np.stack([2.0 * (ball + 2.0), 2.0 * (face + 2.0), np.full_like(face, 2.0)]),
        place=np.stack([np.broadcast_to(each, ring.shape) for each in (one, two, np.ones(_RADII))]),
        weight=np.stack([centre, work, ring]),
    )


def _with_itself(exponent: float, place: Float64[np.ndarray, " q"]) -> Float64[np.ndarray, " q"]:
    """Correlation with itself of (1 - r^2)^e with unit force, on a disc of radius 1, at distances (q,)."""
    order = exponent + 1.0
    k = (np.arange(_WAVES) + 0.5) * _LARGEST / _WAVES
    transform = gamma(order + 1.0) * (2.0 / k) ** order * jv(order, k)
    return np.asarray(jv(0, np.outer(place, k)) @ (transform**2 * k) * (_LARGEST / _WAVES) / (2.0 * np.pi))


@kernel()
@no_type_check
def patch_depth(xx: float, yx: float, yy: float, kind: int, table: PatchDepthTable) -> float:
    """The depth times E per unit normal force on an elliptic patch, 1/mm.

    Of a ball and a ring it is that of the centre; of a flat face the work of the pressure over its force,
    which is its depth (E. Betti 1872). The ellipse has the pressures of a disc with the same area.

    Args:
        xx, yx, yy: triangular root of the second moment of the pressure, mm.
        kind: 0 for a ball, 1 for a flat face, 2 for a ring.
        table: the layer.
    """
    mean = 0.5 * (xx * xx + yx * yx + yy * yy)
    apart = min(np.hypot(0.5 * (xx * xx - yx * yx - yy * yy), xx * yx), (1.0 - 1e-6) * mean)
    at = np.interp(np.sqrt(abs(xx * yy)), table.width, np.arange(len(table.width)))
    first = min(int(at), len(table.width) - 2)
    narrow = _elliptic_depth(mean, apart, kind, first, table)
    return narrow + (at - first) * (_elliptic_depth(mean, apart, kind, first + 1, table) - narrow)


@kernel()
@no_type_check
def _elliptic_depth(mean: float, apart: float, kind: int, width: int, table: PatchDepthTable) -> float:
    """The same with one of the pressures of the table, in polar coordinates.

    The principal second moments are `mean` plus and minus `apart`, mm^2.
    """
    total = 0.0
    for i in range(_ANGLES):
        turn = np.cos(2.0 * np.pi * (i + 0.5) / _ANGLES)
        radius = np.sqrt(table.reach[kind, width] * (mean + apart * turn))
        along = 0.0
        for k in range(table.place.shape[2]):
            at = table.place[kind, width, k] * radius / table.step
            first = int(at)
            if first + 1 < len(table.by_distance):
                share = at - first
                value = (1.0 - share) * table.by_distance[first] + share * table.by_distance[first + 1]
                along += table.weight[kind, width, k] * value
        total += along / radius
    return total * 2.0 * np.pi / _ANGLES
