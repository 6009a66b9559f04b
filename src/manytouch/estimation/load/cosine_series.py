"""Cosine series over a rectangle, and the best linear estimate of their coefficients."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.linalg import cho_factor, cho_solve

from manytouch.values.arrays import Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CosineSeries:
    """Products of cosines over a rectangle, each with its own scale.

    Attributes:
        low: (2,) corner of the rectangle.
        wave_x, wave_y: (k,), (l,) wave numbers along x and y.
        scale: (k * l,) factor of each product.
    """

    low: np.ndarray
    wave_x: np.ndarray
    wave_y: np.ndarray
    scale: np.ndarray

    @property
    def square(self) -> np.ndarray:
        """(k * l,) squared wave numbers."""
        return np.asarray((self.wave_x[:, None] ** 2 + self.wave_y**2).ravel())

    def __call__(self, point: Points2, order_x: int = 0, order_y: int = 0) -> Float64[np.ndarray, "n q"]:
        """(n, q) scaled products, or their derivatives, at points (n, 2)."""
        return np.asarray(
            cosine_products(point - self.low, self.wave_x, self.wave_y, order_x, order_y) * self.scale
        )


_BLOCK = 512  # markers per block, which limits the memory


def best_linear_estimate(
    design: Callable[[slice], np.ndarray], error: Scalars, smooth: Float64[np.ndarray, " q"]
) -> tuple[np.ndarray, Float64[np.ndarray, "q q"]]:
    """Best linear estimator of the first coefficients of a Gaussian process, and its noise covariance.

    Observations are A c plus errors of covariance E, where the coefficients c have variance 1, so the best
    estimate of c is (1 + A^T E^-1 A)^-1 A^T E^-1 times the observations (C. E. Rasmussen, C. K. I. Williams
    2006, equation 2.8). The matrix to invert has as many rows as there are coefficients.

    Args:
        design: returns (p, n, r) for a slice of n markers: the rows of A for the p observations of each
            marker; of the r coefficients the first q are estimated.
        error: (m,) standard deviation of the observations of each marker.
        smooth: (q,) smoothing factors. They are applied twice: the loads have the size of fingertips, and
            the estimate is smoothed to that size.

    Returns:
        (q, p m) estimator, in single precision, for the first observations of all markers, then the second;
        and (q, q) covariance of the estimate for observations of variance 1.
    """
    count, kept = len(error), len(smooth)
    gram: np.ndarray | float = 0.0
    for at in _blocks(count):
        scaled = design(at) / error[at, None]
        parts, total = len(scaled), scaled.shape[2]
        scaled = scaled.reshape(-1, total)
        gram = gram + scaled.T @ scaled
    gram = np.asarray(gram)
    gram[np.diag_indices_from(gram)] += 1.0
    factor = cho_factor(gram, lower=True, overwrite_a=True, check_finite=False)
    solved = smooth[:, None] ** 2 * cho_solve(factor, np.eye(total, kept), check_finite=False).T
    estimate = np.empty((kept, parts, count), dtype=np.float32)
    spread = np.zeros((kept, kept))
    for at in _blocks(count):
        scaled = (design(at) / error[at, None] ** 2).reshape(-1, total)
        some = solved @ scaled.T
        spread += some @ some.T
        estimate[:, :, at] = some.reshape(kept, parts, -1)
    return estimate.reshape(kept, parts * count), spread


def cosine_products(
    place: Points2, wave_x: np.ndarray, wave_y: np.ndarray, order_x: int = 0, order_y: int = 0
) -> Float64[np.ndarray, "n q"]:
    """(n, q) products of the cosines along x and y at points (n, 2), or of their derivatives."""
    return products_at(cosines(place[:, 0], wave_x, order_x), cosines(place[:, 1], wave_y, order_y))


def products_at(along_x: np.ndarray, along_y: np.ndarray) -> Float64[np.ndarray, "n q"]:
    """All cosine_products of (n, k) and (n, l) functions at the same points, (n, k * l)."""
    return np.asarray((along_x[:, :, None] * along_y[:, None, :]).reshape(len(along_x), -1))


def wave_numbers(size: np.ndarray, pitch: np.ndarray, finest: float) -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers along x and y of the cosines down to the finest wavelength, in pitches."""
    counts = _counts(size, pitch, finest)
    return np.arange(counts[0]) * np.pi / size[0], np.arange(counts[1]) * np.pi / size[1]


def finest_affordable_wavelength(size: np.ndarray, pitch: np.ndarray, finest: float, most: int) -> float:
    """`finest`, in pitches, or the next coarser wavelength with at most `most` products."""
    while np.prod(_counts(size, pitch, finest)) > max(most, 4):
        finest *= 1.01
    return finest


def cosines(place: np.ndarray, wave: np.ndarray, order: int) -> np.ndarray:
    """(n, k) cosines of norm 1 on their interval, with zero slope at its ends, or their derivatives."""
    size = np.pi / wave[1]
    norm = np.where(wave == 0.0, 1.0, np.sqrt(2.0)) / np.sqrt(size)
    return np.asarray(norm * wave**order * np.cos(place[:, None] * wave + 0.5 * np.pi * order))


def _counts(size: np.ndarray, pitch: np.ndarray, finest: float) -> np.ndarray:
    return np.asarray(np.ceil(2.0 * size / (finest * pitch)).astype(int) + 1)


def _blocks(count: int) -> Iterator[slice]:
    return (slice(start, min(start + _BLOCK, count)) for start in range(0, count, _BLOCK))
