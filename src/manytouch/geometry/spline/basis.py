"""Cubic B-splines on open uniform knots, along one axis."""

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import BSpline

DEGREE = 3

Along = Float64[np.ndarray, " n"]


def knots(length: float, elements: int) -> Float64[np.ndarray, " k"]:
    """Knots over [0, length]: uniform, the ends four times."""
    inner = np.linspace(0.0, length, elements + 1)
    return np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, length)])


def greville(length: float, elements: int) -> Float64[np.ndarray, " k"]:
    """Places of the coefficients: the spline whose coefficients are these places is the place itself."""
    knot = knots(length, elements)
    return np.asarray((knot[1:-3] + knot[2:-2] + knot[3:-1]) / DEGREE)


def integrals(length: float, elements: int) -> Float64[np.ndarray, " k"]:
    """Integral of each of the elements + 3 basis functions."""
    knot = knots(length, elements)
    return np.asarray((knot[4:] - knot[:-4]) / (DEGREE + 1))


def values(
    length: float, elements: int, place: Along
) -> tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, "n 4 4"]]:
    """First of the four functions that are not 0 at each place; their value and three derivatives.

    The third derivative at a knot is that of the element beyond it. Places outside [0, length] are moved
    to its ends.
    """
    held = np.clip(place, 0.0, length)
    knot = knots(length, elements)
    # The same comparison as in scipy: a division may round a place near a knot into the next element.
    first = np.clip(np.searchsorted(knot, held, side="right") - 1 - DEGREE, 0, elements - 1)
    splines = BSpline(knot, np.eye(elements + DEGREE), DEGREE)
    chosen = first[:, None] + np.arange(DEGREE + 1)
    table = [np.take_along_axis(splines(held, order), chosen, axis=1) for order in range(4)]
    return first, np.ascontiguousarray(np.stack(table, axis=1))
