"""Cubic B-splines on open uniform knots, along one axis."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.values.arrays import read_only

DEGREE = 3

Along = Float64[np.ndarray, " n"]


@lru_cache(maxsize=256)
def knots(length: float, elements: int) -> Float64[np.ndarray, " k"]:
    """Knots over [0, length]: uniform, the ends four times."""
    inner = np.linspace(0.0, length, elements + 1)
    return read_only(np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, length)]))


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
    c0, c1, c2, c3 = np.moveaxis(_polynomials(elements)[first], 1, 0)
    per_mm = elements / length
    s = ((held - knot[first + DEGREE]) * per_mm)[:, None]
    table = np.empty((len(held), 4, DEGREE + 1))
    table[:, 0] = c0 + s * (c1 + s * (c2 + s * c3))
    table[:, 1] = (c1 + s * (2.0 * c2 + 3.0 * s * c3)) * per_mm
    table[:, 2] = (2.0 * c2 + 6.0 * s * c3) * per_mm**2
    table[:, 3] = 6.0 * c3 * per_mm**3
    return first, table


@lru_cache(maxsize=256)
def _polynomials(elements: int) -> Float64[np.ndarray, "elements 4 4"]:
    """Coefficients of 1, s, s^2, s^3 of the four functions in each element, where s runs from 0 to 1."""
    from scipy.interpolate import BSpline

    splines = BSpline(knots(float(elements), elements), np.eye(elements + DEGREE), DEGREE)
    middle, element = np.arange(elements) + 0.5, np.arange(elements)[:, None]
    chosen = element + np.arange(DEGREE + 1)
    d0, d1, d2, d3 = (splines(middle, order)[element, chosen] for order in range(DEGREE + 1))
    s = -0.5  # from the middle of an element, where the derivatives are those of one polynomial, to its start
    return read_only(
        np.stack(
            [
                d0 + s * (d1 + s * (d2 / 2.0 + s * d3 / 6.0)),
                d1 + s * (d2 + s * d3 / 2.0),
                (d2 + s * d3) / 2.0,
                d3 / 6.0,
            ],
            axis=1,
        )
    )
