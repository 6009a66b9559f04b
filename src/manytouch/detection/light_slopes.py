"""Slopes of the light over an image, and how much those of single dots depart from them; compiled.

Light changes smoothly over an image: a quadratic through the levels of all backgrounds, or of all cores, has
slopes that are much more certain than those of the pixels around one dot. How far real slopes depart from
them is estimated from all dots. See docs/derivations/detection.md.
"""

import math

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import REORDER, kernel, no_type_check, u64

TERMS = 6  # of a quadratic in x and y
FEWEST_DOTS = 2 * TERMS
USUAL = 3.0  # deviations from the quadratic, beyond which a dot is left out
EVEN_SLOPE, EVEN_DOTS = 0.03, 0.05
"""Assumed change of light over the radius of a dot, over its contrast, and its weight in dots."""
STEEP = 9.0  # times the mean square of a slope; noise exceeds it once in 8000 dots

# u^i v^j for i + j <= 4 are numbered by their degree, then by j; which of them is the product of two terms of
# the quadratic, for the upper triangle of the normal equations
_PRODUCTS = (0, 1, 2, 3, 4, 5, 3, 4, 6, 7, 8, 5, 7, 8, 9, 10, 11, 12, 12, 13, 14)


@kernel()
@no_type_check
def _solve(matrix: Float64[np.ndarray, "t t1"], terms: int) -> bool:
    """Gauss-Jordan elimination of a symmetric positive definite system; the solution is the last column."""
    for k in range(terms):
        pivot = matrix[k, k]
        if not pivot > 1e-9:
            return False
        for column in range(k, terms + 1):
            matrix[k, column] /= pivot
        for row in range(terms):
            factor = matrix[row, k]
            if row != k and factor != 0.0:
                for column in range(k, terms + 1):
                    matrix[row, column] -= factor * matrix[k, column]
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
def trend_slopes(
    x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " n"], value: Float64[np.ndarray, " n"],
    scratch: Float64[np.ndarray, "4 n"], slope: Float64[np.ndarray, "2 n"],
) -> bool:  # fmt: skip
    """Slopes along x and y, at each position, of a robust quadratic through the values.

    Args:
        x, y: (n,) positions, px; NaN: no dot.
        value: (n,) grey levels there.
        scratch: (4, n) memory.
        slope: (2, n) is overwritten, per px.

    Returns:
        Whether there are dots enough; else the slopes are 0.
    """
    count = 0
    mean_x = mean_y = spread = 0.0
    for i in range(len(x)):
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
    u, v, residual = points[0], points[1], points[3]
    for i in range(count):
        u[i] -= mean_x
        v[i] -= mean_y
        residual[i] = 0.0
        spread += u[i] * u[i] + v[i] * v[i]
    size = math.sqrt(spread / count)
    for i in range(count):
        u[i] /= size
        v[i] /= size
    matrix, sums, c = np.empty((TERMS, TERMS + 1)), np.empty(21), np.zeros(TERMS)
    limit = np.inf
    for _ in range(3):
        _sum_normal_equations(points, limit, sums)
        number = sums[0]
        if number < FEWEST_DOTS:
            return False
        at = 0
        for row in range(TERMS):
            for column in range(row, TERMS):
                matrix[row, column] = matrix[column, row] = sums[_PRODUCTS[at]] / number
                at += 1
            matrix[row, TERMS] = sums[15 + row] / number
        if not _solve(matrix, TERMS):
            return False
        c[:] = matrix[:, TERMS]
        total = _subtract_quadratic(points, c, limit)
        limit = USUAL * math.sqrt(total / number)
    for i in range(len(x)):
        if not np.isnan(x[i]):
            a, b = (x[i] - mean_x) / size, (y[i] - mean_y) / size
            slope[0, i] = (c[1] + 2.0 * c[3] * a + c[4] * b) / size
            slope[1, i] = (c[2] + c[4] * a + 2.0 * c[5] * b) / size
    return True


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
