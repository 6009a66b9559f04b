"""Slopes of the light over an image, and how much those of single dots depart from them; compiled.

Light changes smoothly over an image: a quadratic through the levels of all backgrounds, or of all cores, has
slopes that are much more certain than those of the pixels around one dot. How far real slopes depart from
them is estimated from all dots. The contrast of printed dots varies; where few dots show its slopes, these
are uncertain, and shrunk. See docs/derivations/detection.md.
"""

import math

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import REORDER, kernel, no_type_check, u64

TERMS = 6  # of a quadratic in x and y
FEWEST_DOTS = 2 * TERMS
MOST_DOTS = 256  # about; of more, every few are used
USUAL = 3.0  # deviations from the quadratic, beyond which a dot is left out
EVEN_SLOPE, EVEN_DOTS = 0.03, 0.05
"""Assumed change of light over the radius of a dot, over its contrast, and its weight in dots."""
STEEP = 9.0  # times the mean square of a slope; noise exceeds it once in 8000 dots

# u^i v^j for i + j <= 4 are numbered by their degree, then by j; which of them is the product of two terms of
# the quadratic, for the upper triangle of the normal equations
_PRODUCTS = (0, 1, 2, 3, 4, 5, 3, 4, 6, 7, 8, 5, 7, 8, 9, 10, 11, 12, 12, 13, 14)


@kernel()
@no_type_check
def _solve(system: Float64[np.ndarray, "t t+1+t"]) -> bool:
    """Gauss-Jordan elimination: the positive definite left half becomes 1, the right the solutions.

    Returns whether the equations have one.
    """
    for k in range(TERMS):
        pivot = system[k, k]
        if not pivot > 1e-9:
            return False
        system[k] /= pivot
        for row in range(TERMS):
            if row != k:
                system[row] -= system[row, k] * system[k]
    return True


@kernel(fastmath=REORDER)
@no_type_check
def _sum_normal_equations(
    points: Float64[np.ndarray, "4 n"], limit: float, sums: Float64[np.ndarray, "21"]
) -> None:  # fmt: skip
    """Sums of u^i v^j for i + j <= 4, then of value u^i v^j for i + j <= 2, of the dots within the limit."""
    u, v, value, residual = points[0], points[1], points[2], points[3]
    s00 = s10 = s01 = s20 = s11 = s02 = s30 = s21 = s12 = s03 = s40 = s31 = s22 = s13 = s04 = 0.0
    z00 = z10 = z01 = z20 = z11 = z02 = 0.0
    for i in range(u64(len(u))):
        w = 1.0 if abs(residual[i]) <= limit else 0.0
        x, y = w * u[i], w * v[i]
        xx, xy, yy = x * u[i], x * v[i], y * v[i]
        z = w * value[i]
        s00 += w
        s10 += x
        s01 += y
        s20 += xx
        s11 += xy
        s02 += yy
        s30 += xx * u[i]
        s21 += xx * v[i]
        s12 += yy * u[i]
        s03 += yy * v[i]
        s40 += xx * u[i] * u[i]
        s31 += xx * u[i] * v[i]
        s22 += xx * v[i] * v[i]
        s13 += yy * u[i] * v[i]
        s04 += yy * v[i] * v[i]
        z00 += z
        z10 += z * u[i]
        z01 += z * v[i]
        z20 += z * u[i] * u[i]
        z11 += z * u[i] * v[i]
        z02 += z * v[i] * v[i]
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = s00, s10, s01, s20, s11, s02
    sums[6], sums[7], sums[8], sums[9] = s30, s21, s12, s03
    sums[10], sums[11], sums[12], sums[13], sums[14] = s40, s31, s22, s13, s04
    sums[15], sums[16], sums[17], sums[18], sums[19], sums[20] = z00, z10, z01, z20, z11, z02


@kernel(fastmath=REORDER)
@no_type_check
def _subtract_quadratic(
    points: Float64[np.ndarray, "4 n"], c: Float64[np.ndarray, "6"], limit: float
) -> float:  # fmt: skip
    """Writes the residuals of a quadratic.

    Returns the sum of the squares of those that were within the limit before.
    """
    u, v, value, residual = points[0], points[1], points[2], points[3]
    total = 0.0
    for i in range(u64(len(u))):
        was_usual = abs(residual[i]) <= limit
        fit = c[0] + c[1] * u[i] + c[2] * v[i] + c[3] * u[i] * u[i] + c[4] * u[i] * v[i] + c[5] * v[i] * v[i]
        residual[i] = value[i] - fit
        total += residual[i] * residual[i] if was_usual else 0.0
    return total


@kernel()
@no_type_check
def _fit_quadratic(points: Float64[np.ndarray, "4 n"], system: Float64[np.ndarray, "6 13"]) -> float:
    """Fits a robust quadratic: rows u, v (of size 1), value and residual; the last is scratch.

    Args:
        points: see above.
        system: its last columns get the coefficients and the inverse of the normal equations.

    Returns:
        Mean square of the residuals over their number; -1 if there are not enough dots.
    """
    sums, c = np.empty(21), np.zeros(TERMS)
    limit, mean = np.inf, 0.0
    points[3] = 0.0
    for _ in range(3):
        _sum_normal_equations(points, limit, sums)
        number = sums[0]
        if number < FEWEST_DOTS:
            return -1.0
        at = 0
        system[:] = 0.0
        for row in range(TERMS):
            for column in range(row, TERMS):
                system[row, column] = system[column, row] = sums[_PRODUCTS[at]] / number
                at += 1
            system[row, TERMS] = sums[15 + row] / number
            system[row, TERMS + 1 + row] = 1.0
        if not _solve(system):
            return -1.0
        c[:] = system[:, TERMS]
        mean = _subtract_quadratic(points, c, limit) / number
        limit = USUAL * math.sqrt(mean)
        mean /= number - TERMS
    return mean


@kernel()
@no_type_check
def trend_slopes(
    x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " n"], value: Float64[np.ndarray, " n"],
    scratch: Float64[np.ndarray, "4 n"], slope: Float64[np.ndarray, "3 n"],
) -> bool:  # fmt: skip
    """Slopes along x and y, at each position, of a robust quadratic through the values.

    Args:
        x, y: (n,) positions, px; NaN: no dot.
        value: (n,) grey levels there.
        scratch: (4, n) memory.
        slope: (3, n) is overwritten: slopes per px, and their mean variance along an axis, from how far the
            values are from the quadratic.

    Returns:
        Whether there are dots enough; else the slopes are 0.
    """
    count, stride = 0, max(len(x) // MOST_DOTS, 1)
    mean_x = mean_y = spread = 0.0
    for i in range(0, len(x), stride):
        if not np.isnan(x[i]):
            scratch[0, count], scratch[1, count], scratch[2, count] = x[i], y[i], value[i]
            mean_x += x[i]
            mean_y += y[i]
            count += 1
    slope[:] = 0.0
    if count < FEWEST_DOTS:
        return False
    mean_x, mean_y = mean_x / count, mean_y / count
    points = scratch[:, :count]
    u, v = points[0], points[1]
    for i in range(count):
        u[i] -= mean_x
        v[i] -= mean_y
        spread += u[i] * u[i] + v[i] * v[i]
    size = math.sqrt(spread / count)
    for i in range(count):
        u[i] /= size
        v[i] /= size
    system = np.empty((TERMS, 2 * TERMS + 1))
    variance = _fit_quadratic(points, system)
    if variance < 0.0:
        return False
    c, inverse = system[:, TERMS], system[:, TERMS + 1 :]
    for i in range(len(x)):
        if not np.isnan(x[i]):
            a, b = (x[i] - mean_x) / size, (y[i] - mean_y) / size
            slope[0, i] = (c[1] + 2.0 * c[3] * a + c[4] * b) / size
            slope[1, i] = (c[2] + c[4] * a + 2.0 * c[5] * b) / size
            along_x = inverse[1, 1] + 4.0 * a * a * inverse[3, 3] + b * b * inverse[4, 4]
            along_x += 4.0 * a * inverse[1, 3] + 2.0 * b * inverse[1, 4] + 4.0 * a * b * inverse[3, 4]
            along_y = inverse[2, 2] + a * a * inverse[4, 4] + 4.0 * b * b * inverse[5, 5]
            along_y += 2.0 * a * inverse[2, 4] + 4.0 * b * inverse[2, 5] + 4.0 * a * b * inverse[4, 5]
            slope[2, i] = 0.5 * variance * (along_x + along_y) / (size * size)
    return True


@kernel()
@no_type_check
def shrink_trend(slope: Float64[np.ndarray, "3 n"]) -> None:
    """Shrinks slopes of `trend_slopes` towards 0 as far as they may be by chance.

    Six terms make all of them, so that by chance their squares are up to twice their variance. Their variance
    is shrunk less, as for slopes of which nothing is by chance: they may be real.
    """
    number = squares = variances = 0.0
    for i in range(slope.shape[1]):
        number += 1.0 if slope[2, i] > 0.0 else 0.0
        squares += 0.5 * (slope[0, i] * slope[0, i] + slope[1, i] * slope[1, i])
        variances += slope[2, i]
    number = max(number, 1.0)
    usual, most = max(squares - 2.0 * variances, 0.0) / number, squares / number
    for i in range(slope.shape[1]):
        variance = slope[2, i]
        if variance > 0.0:
            slope[0, i] *= usual / (usual + variance)
            slope[1, i] *= usual / (usual + variance)
            slope[2, i] *= most / (most + variance)


@kernel(fastmath=REORDER)
@no_type_check
def squares_of_slopes(
    slope: Float64[np.ndarray, "2 n"], spread: Float64[np.ndarray, " n"],
    unit: Float64[np.ndarray, " n"], variance: float, square: Float64[np.ndarray, "2 n"],
) -> None:  # fmt: skip
    """Mean squares (n,) of slopes along an axis, and those of their noise, in `unit` (n,).

    Both are written into `square`; the first is -1 where no slope is known, which is where `spread` is 0.
    """
    for i in range(u64(len(spread))):
        share, is_known = unit[i] * unit[i], spread[i] > 0.0
        mean = 0.5 * share * (slope[0, i] * slope[0, i] + slope[1, i] * slope[1, i])
        square[0, i] = mean if is_known else -1.0
        square[1, i] = 2.0 * share * variance / spread[i] if is_known else 0.0


@kernel(fastmath=REORDER)
@no_type_check
def _sum_slopes(
    square: Float64[np.ndarray, " n"], noise: Float64[np.ndarray, " n"], limit: float
) -> tuple[float, float, float]:
    """Number of the slopes within the limit, and sums of their squares and of the noise in these."""
    number = squares = total = 0.0
    for i in range(u64(len(square))):
        is_usual = 0.0 <= square[i] <= limit
        number += 1.0 if is_usual else 0.0
        squares += square[i] if is_usual else 0.0
        total += noise[i] if is_usual else 0.0
    return number, squares, total


@kernel()
@no_type_check
def usual_slope(square: Float64[np.ndarray, " n"], noise: Float64[np.ndarray, " n"]) -> tuple[float, float]:
    """Usual mean square of a slope without its noise, and that from which on one is steep."""
    prior = EVEN_DOTS * EVEN_SLOPE * EVEN_SLOPE
    limit, usual = np.inf, EVEN_SLOPE * EVEN_SLOPE
    for _ in range(3):
        number, squares, total = _sum_slopes(square, noise, limit)
        number, squares = number + EVEN_DOTS, squares + prior
        limit = STEEP * squares / number
        # by chance the squares exceed those of noise by this part: it is no slope
        usual = max(squares - (1.0 + 1.0 / math.sqrt(number)) * total, prior) / number
    return usual, limit
