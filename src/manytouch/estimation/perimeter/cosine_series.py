"""Series of cosines over a rectangle, and the best estimate of their coefficients from what is observed."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.linalg import cho_factor, cho_solve

from manytouch.values.arrays import Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Series:
    """Products of cosines over a rectangle, each of its own size.

    Attributes:
        low: (2,) corner of the rectangle.
        wave_x, wave_y: (k,), (l,) wave numbers.
        scale: (k * l,) size of each product.
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
        """The products, or derivatives of them, at points (n, 2)."""
        return np.asarray(products(point - self.low, self.wave_x, self.wave_y, order_x, order_y) * self.scale)


_BLOCK = 512  # markers at once, so that what is worked out for all of them needs little memory


def best_estimate(
    design: Callable[[slice], np.ndarray], error: Scalars, smooth: Float64[np.ndarray, " q"]
) -> tuple[np.ndarray, Float64[np.ndarray, "q q"]]:
    """Best linear estimate of the first modes of a Gaussian process, and its covariance for noise of 1.

    Observations are A c plus errors of variance E, c modes of variance 1, so the best estimate of c is
    (1 + A^T E^-1 A)^-1 A^T E^-1 times the observations (C. E. Rasmussen, C. K. I. Williams 2006, equation
    2.8). It is as large as the modes are many, and sums over markers need not be kept.

    Args:
        design: of some markers, (p, n, r): A for each of the p observations of each of the n markers; of the
            r modes the first q are of interest.
        error: (m,) standard deviation of the observations of each marker.
        smooth: (q,) by which the series is smoothed twice: once since its loads hold fingertips, and once
            since it is smoothed like one when it is read.

    Returns:
        (q, p m) estimate from the first observation of all markers, then the second, in single precision,
        and (q, q).
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


def products(
    place: Points2, wave_x: np.ndarray, wave_y: np.ndarray, order_x: int = 0, order_y: int = 0
) -> Float64[np.ndarray, "n q"]:
    """Products of the cosines along x and y, or of their derivatives."""
    return outer(cosines(place[:, 0], wave_x, order_x), cosines(place[:, 1], wave_y, order_y))


def outer(along_x: np.ndarray, along_y: np.ndarray) -> Float64[np.ndarray, "n q"]:
    """All products of (n, k) and (n, l) functions at the same points, (n, k * l)."""
    return np.asarray((along_x[:, :, None] * along_y[:, None, :]).reshape(len(along_x), -1))


def waves(size: np.ndarray, pitch: np.ndarray, finest: float) -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers along x and y of the cosines down to the finest wavelength, in pitches."""
    counts = _counts(size, pitch, finest)
    return np.arange(counts[0]) * np.pi / size[0], np.arange(counts[1]) * np.pi / size[1]


def affordable(size: np.ndarray, pitch: np.ndarray, finest: float, most: int) -> float:
    """The finest wavelength, in pitches, or the next coarser of which there are at most so many products."""
    while np.prod(_counts(size, pitch, finest)) > max(most, 4):
        finest *= 1.01
    return finest


def cosines(place: np.ndarray, wave: np.ndarray, order: int) -> np.ndarray:
    """(n, k) cosines of norm 1 on the interval of which they are the free modes, or their derivatives."""
    size = np.pi / wave[1]
    norm = np.where(wave == 0.0, 1.0, np.sqrt(2.0)) / np.sqrt(size)
    return np.asarray(norm * wave**order * np.cos(place[:, None] * wave + 0.5 * np.pi * order))


def _counts(size: np.ndarray, pitch: np.ndarray, finest: float) -> np.ndarray:
    return np.asarray(np.ceil(2.0 * size / (finest * pitch)).astype(int) + 1)


def _blocks(count: int) -> Iterator[slice]:
    return (slice(start, min(start + _BLOCK, count)) for start in range(0, count, _BLOCK))
