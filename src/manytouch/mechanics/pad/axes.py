"""Integrals of the functions of a pad along each axis: B-splines in the plane, polynomials through it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.spline import basis
from manytouch.geometry.spline.patch import SplinePatch

DEGREE_Z = 5
"""Degree of the polynomials through the thickness."""
_QUADRATURE = 5  # Gauss points per element


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Axis:
    """Integrals along one axis: of values, of slopes, and of slopes (rows) with values (columns)."""

    value: Float64[np.ndarray, "k k"]
    slope: Float64[np.ndarray, "k k"]
    mixed: Float64[np.ndarray, "k k"]


def spline_axis(patch: SplinePatch, axis: int) -> Axis:
    """Integrals of the B-splines along x (0) or y (1)."""
    length, elements = patch.size_mm[axis], patch.elements[axis]
    place, weight = np.polynomial.legendre.leggauss(_QUADRATURE)
    size_mm = length / elements
    at_mm = ((np.arange(elements)[:, None] + 0.5 + 0.5 * place) * size_mm).ravel()
    first, table = basis.values(length, elements, at_mm)
    value, slope = (np.zeros((len(at_mm), elements + basis.DEGREE)) for _ in range(2))
    chosen = first[:, None] + np.arange(basis.DEGREE + 1)
    np.put_along_axis(value, chosen, table[:, 0], axis=1)
    np.put_along_axis(slope, chosen, table[:, 1], axis=1)
    return _products(value, slope, np.tile(0.5 * size_mm * weight, elements))


def depth_axis(thickness_mm: float) -> Axis:
    """Integrals of the polynomials through the thickness."""
    place, weight = np.polynomial.legendre.leggauss(DEGREE_Z + 1)
    value, slope = polynomials(0.5 * (place + 1.0))
    return _products(value, slope / thickness_mm, 0.5 * thickness_mm * weight)


def _products(value: np.ndarray, slope: np.ndarray, weight: np.ndarray) -> Axis:
    return Axis(
        value=value.T @ (weight[:, None] * value),
        slope=slope.T @ (weight[:, None] * slope),
        mixed=slope.T @ (weight[:, None] * value),
    )


def polynomials(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k, DEGREE_Z) values at shares of the thickness above the bonded face, and slopes by the share.

    Integrated Legendre polynomials: only the first one is not 0 on the contact face.
    """
    legendre = [
        np.polynomial.legendre.Legendre.basis(degree, domain=(0.0, 1.0)) for degree in range(DEGREE_Z)
    ]
    value = np.stack([each.integ(lbnd=0.0)(share) for each in legendre], axis=-1)
    return value, np.stack([each(share) for each in legendre], axis=-1)


def lame_constants(poisson: float) -> tuple[float, float]:
    """Lame's constants lambda and mu over Young's modulus; `poisson` is below 1/2.

    Raises:
        ZeroDivisionError: a Poisson's ratio of 1/2.
    """
    return poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), 0.5 / (1.0 + poisson)
