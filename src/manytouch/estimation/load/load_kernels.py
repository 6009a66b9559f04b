"""Compiled sums of cosines at a few points of a load map."""

import numpy as np

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.values.arrays import Floats

MOST_CURVATURE = 0.25  # as of a peak that is two pitches wide; limits the covariance at a flat top


@inlined_kernel()
@no_type_check
def _cosines(place: float, wave: Floats, order: int, out: Floats) -> None:
    """Writes the functions (k,) of `cosine_series.cosines` at one place."""
    size = np.pi / wave[1]
    for k in range(len(wave)):
        norm = (1.0 if wave[k] == 0.0 else np.sqrt(2.0)) / np.sqrt(size)
        power = 1.0
        for _ in range(order):
            power *= wave[k]
        out[k] = norm * power * np.cos(place * wave[k] + 0.5 * np.pi * order)


@kernel()
@no_type_check
def products_at_points(place: Floats, wave_x: Floats, wave_y: Floats) -> Floats:
    """(n, k l) products of the cosines along x and y at points (n, 2)."""
    columns, rows = len(wave_x), len(wave_y)
    out = np.empty((len(place), columns * rows))
    along_x, along_y = np.empty(columns), np.empty(rows)
    for n in range(len(place)):
        _cosines(place[n, 0], wave_x, 0, along_x)
        _cosines(place[n, 1], wave_y, 0, along_y)
        for k in range(columns):
            for j in range(rows):
                out[n, k * rows + j] = along_x[k] * along_y[j]
    return out


@kernel()
@no_type_check
def slopes_at_points(
    place: Floats, wave_x: Floats, wave_y: Floats, coefficients: Floats
) -> tuple[Floats, Floats]:
    """Slopes of the products, and second derivatives of a series, at points (n, 2).

    Args:
        place: the points.
        wave_x, wave_y: (k,), (l,) wave numbers.
        coefficients: (k, l) of the series.

    Returns:
        (2 n, k l) slopes along x at all points, then along y; (n, 2, 2) second derivatives, each of those
        along an axis lowered by a quarter of the series, so that no peak is flat.
    """
    columns, rows, count = len(wave_x), len(wave_y), len(place)
    slope, bend = np.empty((2 * count, columns * rows)), np.empty((count, 2, 2))
    x, y = np.empty((3, columns)), np.empty((3, rows))
    for n in range(count):
        for order in range(3):
            _cosines(place[n, 0], wave_x, order, x[order])
            _cosines(place[n, 1], wave_y, order, y[order])
        value = along_x = along_y = twist = 0.0
        for k in range(columns):
            for j in range(rows):
                here = coefficients[k, j]
                slope[n, k * rows + j] = x[1, k] * y[0, j]
                slope[count + n, k * rows + j] = x[0, k] * y[1, j]
                value += here * x[0, k] * y[0, j]
                along_x += here * x[2, k] * y[0, j]
                along_y += here * x[0, k] * y[2, j]
                twist += here * x[1, k] * y[1, j]
        least = MOST_CURVATURE * abs(value)
        bend[n, 0, 0], bend[n, 1, 1] = along_x - least, along_y - least
        bend[n, 0, 1] = bend[n, 1, 0] = twist
    return slope, bend


@kernel()
@no_type_check
def covariances_of_maxima(slope: Floats, weighted: Floats, bend: Floats, variance: float) -> Floats:
    """(n, 2, 2) covariances of the places of maxima: H^-1 G H^-1.

    Args:
        slope: (2 n, q) from `slopes_at_points`.
        weighted: (2 n, q) the same times the covariance (q, q) of the coefficients, of any precision.
        bend: (n, 2, 2) second derivatives H.
        variance: factor of G, the covariance of the slopes of the noise.
    """
    count = len(bend)
    out = np.empty((count, 2, 2))
    for n in range(count):
        xx = xy = yy = 0.0
        for q in range(slope.shape[1]):
            xx += weighted[n, q] * slope[n, q]
            xy += weighted[n, q] * slope[count + n, q]
            yy += weighted[count + n, q] * slope[count + n, q]
        xx, xy, yy = variance * xx, variance * xy, variance * yy
        a, b, d = bend[n, 0, 0], bend[n, 0, 1], bend[n, 1, 1]
        each = 1.0 / (a * d - b * b)
        a, b, d = d * each, -b * each, a * each
        out[n, 0, 0] = a * (a * xx + b * xy) + b * (a * xy + b * yy)
        out[n, 1, 1] = b * (b * xx + d * xy) + d * (b * xy + d * yy)
        out[n, 0, 1] = out[n, 1, 0] = a * (b * xx + d * xy) + b * (b * xy + d * yy)
    return out
