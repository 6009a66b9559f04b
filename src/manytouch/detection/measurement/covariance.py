"""Noise and unevenness of light estimated from all dots of an image, and the covariance of each, compiled.

Shot noise grows with the level; its slope is fitted to the variances of backgrounds and cores of the dots.
The usual unevenness of light follows from the slopes of all cores; the slope of one core is shrunk towards
zero by its noise. See docs/derivations/detection.md.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import REORDER, inlined_kernel, kernel, no_type_check, u64
from manytouch.detection.light_slopes import (
    shrink_trend,
    squares_of_slopes,
    trend_slopes,
    usual_slope,
)
from manytouch.detection.measurement.records import (
    AREA,
    COLUMNS,
    CONTRAST,
    CUT,
    CXX,
    CXY,
    CYY,
    EDGE,
    MOST_LOW,
    DotStatistics,
    MeasuredDot,
    X,
    Y,
)
from manytouch.detection.measurement.sampling_pattern import core_radius

# Square of the threshold over the variance of a pixel from which on the noise that passes it is less than a
# hundredth of that of the edge.
NEGLIGIBLE = 6.25


class NoiseModel(NamedTuple):
    """Assumptions on noise and light.

    Attributes:
        least_variance: smallest variance of a pixel.
        clearance_px: least distance of core and edge of a dot with a steep slope.
        outlier: times the mean variance; 64 plain pixels seldom exceed it.
        outlier_of_one: the same limit for a single squared residual.
        texture: ratio to the usual variance above which a background is textured.
        floor_px, floor_px4: deviation that square pixels leave without noise, floor + floor_px4 / r^3,
            measured on rendered discs of radius r = 1.5 to 11 px, blurred by 0.3 to 0.8 px. More blurred ones
            have more.
    """

    least_variance: float = 0.09
    clearance_px: float = 1.9
    outlier: float = 1.6
    outlier_of_one: float = 9.0
    texture: float = 2.0
    floor_px: float = 0.0018
    floor_px4: float = 0.05


class PixelNoise(NamedTuple):
    """Variance of a pixel as a linear function of its level.

    Attributes:
        background, core: variance at the mean levels of backgrounds and cores.
        level: mean level of the backgrounds.
        growth: variance per grey level.
    """

    background: float
    core: float
    level: float
    growth: float


MODEL = NoiseModel()


@inlined_kernel()
@no_type_check
def store_dot(dot: MeasuredDot, row: int, statistics: DotStatistics) -> None:
    """Stores what `add_noise` needs of a dot."""
    fit, sums = dot.fit, dot.moments
    dx, dy, count = sums.x / sums.total, sums.y / sums.total, sums.edges
    statistics.edge_xx[row] = sums.edge_xx - 2.0 * dx * sums.edge_x + count * dx * dx
    statistics.edge_yy[row] = sums.edge_yy - 2.0 * dy * sums.edge_y + count * dy * dy
    statistics.edge_xy[row] = sums.edge_xy - dx * sums.edge_y - dy * sums.edge_x + count * dx * dy
    statistics.window[row] = 0.25 * math.pi * dot.reach2 * dot.reach2
    gain = 1.0 / (1.0 - 2.0 * fit.low)
    statistics.low[row] = fit.low
    statistics.scale[row], statistics.area[row] = gain / (fit.contrast * sums.total), sums.total
    statistics.background[row], statistics.contrast[row] = fit.background, fit.contrast
    statistics.contrast_x[row], statistics.contrast_y[row] = fit.contrast_x, fit.contrast_y
    statistics.background_x[row], statistics.background_y[row] = fit.background_x, fit.background_y
    statistics.background_variance[row] = fit.background_variance
    statistics.background_spread[row] = fit.background_spread
    statistics.core_spread[row], statistics.core_variance[row] = fit.core_spread, fit.core_variance


@inlined_kernel()
@no_type_check
def store_nothing(row: int, statistics: DotStatistics, out: Float64[np.ndarray, "n 9"]) -> None:
    """As `store_dot` and `store_position`, where there is no dot."""
    for column in range(COLUMNS):
        out[row, column] = np.nan
    statistics.contrast[row] = statistics.contrast_x[row] = statistics.contrast_y[row] = 0.0
    statistics.background[row] = statistics.background_spread[row] = statistics.core_spread[row] = 0.0
    statistics.background_x[row] = statistics.background_y[row] = 0.0
    statistics.background_variance[row] = statistics.core_variance[row] = -1.0
    statistics.low[row] = MOST_LOW


@inlined_kernel()
@no_type_check
def store_position(
    dot: MeasuredDot, radius: float, size: tuple[int, int], row: int, out: Float64[np.ndarray, "n 9"]
) -> None:
    """Stores the columns of a dot, without the part of the covariance that comes from noise.

    `size` is the width and height of the image.
    """
    sums, total = dot.moments, dot.moments.total
    least = MODEL.floor_px + MODEL.floor_px4 / (radius * radius * radius)
    out[row, CXX] = out[row, CYY] = least * least
    out[row, CXY] = 0.0
    x, y = dot.x + sums.x / total, dot.y + sums.y / total
    out[row, X], out[row, Y] = x, y
    out[row, AREA], out[row, CONTRAST] = total, dot.fit.contrast
    # from 15 to 85 %, of a normal point spread: quantile of 85 % over that of 1 - low, within 1 %; where the
    # edge fills the window, its width does not depend on the threshold. The power was chosen on discs of 3 to
    # 8 px with a blur of 0.5 to 2 px (ADR 153)
    low, filled = dot.fit.low, sums.edges / (math.pi * dot.reach2)
    share = 1.0364 / (2.127 - 10.81 * low + 23.64 * low * low)
    share += (1.0 - share) * min(filled, 1.0) ** 6
    out[row, EDGE] = share * sums.edges / (2.0 * math.sqrt(math.pi * total))
    out[row, CUT] = 0.0
    margin = min(x, size[0] - 1.0 - x, y, size[1] - 1.0 - y) + 0.5
    if margin < 1.15 * radius:
        # what is missing of a disc of the expected size; its centroid is that much too far inside
        lacking = min(max(1.0 - total / (math.pi * radius * radius), 0.0), 1.0)
        depth = min(max(1.15 - margin / radius, 0.0), 1.0)
        out[row, CUT] = max(lacking, 0.3 * depth)
        inflation = (0.85 * radius * out[row, CUT]) ** 2
        out[row, CXX] += inflation
        out[row, CYY] += inflation


@inlined_kernel()
@no_type_check
def _tail(z: float) -> float:
    """E[max(n - z, 0)^2] of a standard normal n: noise that passes the soft threshold."""
    if z > 6.0:
        return 0.0
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return (1.0 + z * z) * 0.5 * math.erfc(z / math.sqrt(2.0)) - z * density


@kernel(fastmath=REORDER)
@no_type_check
def _sum_within(
    variance: Float64[np.ndarray, " n"],
    statistics: DotStatistics,
    level: float,
    limit: float,
    limit_of_one: float,
) -> tuple[float, float, float]:
    """Number of the variances within their limit, and sums of them and of their grey levels."""
    background, contrast, spread = statistics.background, statistics.contrast, statistics.core_spread
    number = total = grey = 0.0
    for i in range(u64(len(variance))):
        most = limit if spread[i] > 0.0 else limit_of_one
        is_usual = 0.0 <= variance[i] <= most
        number += 1.0 if is_usual else 0.0
        total += variance[i] if is_usual else 0.0
        grey += background[i] + level * contrast[i] if is_usual else 0.0
    return number, total, grey


@kernel()
@no_type_check
def _usual_variance(
    variance: Float64[np.ndarray, " n"], statistics: DotStatistics, level: float, outlier_of_one: float
) -> tuple[float, float]:
    """Mean variance without outliers and its mean grey level; -1 if none is known.

    `level` is 0 for variances of backgrounds and 1 for those of cores.
    """
    limit, mean, grey = np.inf, -1.0, 0.0
    for _ in range(3):
        number, total, total_grey = _sum_within(
            variance, statistics, level, MODEL.outlier * limit, outlier_of_one * limit
        )
        if number == 0.0:
            break
        mean, grey = total / number, total_grey / number
        limit = mean
    return mean, grey


@kernel()
@no_type_check
def pixel_noise(statistics: DotStatistics, is_light: bool) -> PixelNoise:
    """Noise of a pixel; `is_light` states whether a dot's core gets more light than its background."""
    background, background_level = _usual_variance(
        statistics.background_variance, statistics, 0.0, MODEL.outlier
    )
    core, core_level = _usual_variance(statistics.core_variance, statistics, 1.0, MODEL.outlier_of_one)
    background = max(background, MODEL.least_variance)
    core = background if core < 0.0 else max(core, MODEL.least_variance)
    if (core < background) == is_light:
        # noise does not fall with light: the pixels of one of them are clipped, and its noise means nothing
        core = background = max(core, background)
    growth = (core - background) / max(core_level - background_level, 1.0)
    return PixelNoise(background, core, background_level, growth)


@inlined_kernel()
@no_type_check
def _is_clear(xx: float, xy: float, yy: float, area: float, radius: float) -> bool:
    """Whether the core is free of the dot's edge, however the dot was squeezed."""
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    off = math.sqrt(half * half + xy * xy)
    # the half axes of an ellipse are as the roots of its moments
    least = math.sqrt(area / math.pi * math.sqrt(max(middle - off, 0.0) / (middle + off)))
    return least > core_radius(radius) + MODEL.clearance_px


@inlined_kernel()
@no_type_check
def _passed_noise(
    statistics: DotStatistics, i: int, background_variance: float, core_variance: float
) -> float:
    """Noise of background and core, from their variances, that passes the soft threshold, px^4."""
    threshold = statistics.low[i] * statistics.contrast[i]
    if threshold * threshold >= NEGLIGIBLE * max(background_variance, core_variance):
        return 0.0
    trace = statistics.edge_xx[i] + statistics.edge_yy[i]
    outside = max(statistics.window[i] - 0.5 * trace, 0.0)
    inside = statistics.area[i] * statistics.area[i] / (4.0 * math.pi) - 0.25 * trace
    inside = min(max(inside, 0.0), outside)
    passed = (outside - inside) * background_variance * _tail(threshold / math.sqrt(background_variance))
    passed += inside * core_variance * _tail(threshold / math.sqrt(core_variance))
    return float(passed)


class _Trend(NamedTuple):
    """Slopes of background and core of all dots, relative to those of the light over the image.

    Attributes:
        is_known: whether there are dots enough for the light over the image; else it counts as even, and
            slopes are not shrunk.
        contrast: (3, n) slopes of the contrast over the image, grey levels per px, and their variance.
        background, core: (2, n) slopes minus those of the light.
        of_background, of_core: (2, n) memory for `squares_of_slopes`.
    """

    is_known: bool
    contrast: Float64[np.ndarray, "3 n"]
    background: Float64[np.ndarray, "2 n"]
    core: Float64[np.ndarray, "2 n"]
    of_background: Float64[np.ndarray, "2 n"]
    of_core: Float64[np.ndarray, "2 n"]


@kernel()
@no_type_check
def _trend(statistics: DotStatistics, x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " n"]) -> _Trend:
    """Slopes without their squares, which are still to be computed."""
    memory = np.empty((12, len(x)))
    light, contrast, core, scratch = memory[0:3], memory[3:6], memory[6:8], memory[8:12]
    is_known = trend_slopes(x, y, statistics.background, scratch, light)
    is_known = trend_slopes(x, y, statistics.contrast, scratch, contrast) and is_known
    if is_known:
        shrink_trend(contrast)
    else:
        light[:] = 0.0
        contrast[:] = 0.0
    background = light[:2]
    for i in range(len(x)):
        background[0, i] = statistics.background_x[i] - light[0, i]
        background[1, i] = statistics.background_y[i] - light[1, i]
        core[0, i] = background[0, i] + statistics.contrast_x[i] - contrast[0, i]
        core[1, i] = background[1, i] + statistics.contrast_y[i] - contrast[1, i]
    return _Trend(is_known, contrast, background, core, scratch[0:2], scratch[2:4])


@kernel()
@no_type_check
def add_noise(
    statistics: DotStatistics,
    radius: Float64[np.ndarray, " n"],
    is_light: bool,
    fine_noise: float,
    out: Float64[np.ndarray, "n 9"],
) -> None:
    """Adds to the measured dots what noise and the slopes of the light do to centres and covariances.

    Args:
        statistics: of all dots.
        radius: expected radii, px.
        is_light: whether a dot's core gets more light than its background.
        fine_noise: standard deviation of neighbouring pixels, grey levels, without smooth shading.
        out: measured dots; centres and covariances are changed.
    """
    noise = pixel_noise(statistics, is_light)
    fine_variance = max(fine_noise * fine_noise, MODEL.least_variance)
    trend = _trend(statistics, out[:, X], out[:, Y])
    unit = np.empty(len(out))
    for i in range(len(out)):
        unit[i] = radius[i] / statistics.contrast[i]
    usual_variance = min(noise.background, fine_variance)
    squares_of_slopes(
        trend.background, statistics.background_spread, unit, usual_variance, trend.of_background
    )
    squares_of_slopes(trend.core, statistics.core_spread, unit, noise.core, trend.of_core)
    even_background, steep_background = usual_slope(trend.of_background[0], trend.of_background[1])
    even_core, steep_core = usual_slope(trend.of_core[0], trend.of_core[1])
    for i in range(len(out)):
        if np.isnan(out[i, X]):
            continue
        contrast, scale = statistics.contrast[i], statistics.scale[i]
        xx, xy, yy = statistics.edge_xx[i], statistics.edge_xy[i], statistics.edge_yy[i]
        background_variance = noise.background + noise.growth * (statistics.background[i] - noise.level)
        background_variance = max(background_variance, MODEL.least_variance)
        core_variance = max(background_variance + noise.growth * contrast, MODEL.least_variance)
        # smooth shading in the ring moves its plane, but always alike
        slope_variance = min(background_variance, fine_variance)
        own = statistics.background_variance[i]
        if own > MODEL.texture * background_variance:
            core_variance += own - background_variance
            background_variance = slope_variance = own
        spread, core_spread = statistics.background_spread[i], statistics.core_spread[i]
        of_background = 2.0 * slope_variance / spread if spread > 0.0 else 0.0
        share, square = 1.0 / (unit[i] * unit[i]), trend.of_background[0, i]
        is_kept = not trend.is_known or square > steep_background
        kept = 1.0 if is_kept else share * even_background / (share * even_background + of_background)
        lost_x, lost_y = (1.0 - kept) * trend.background[0, i], (1.0 - kept) * trend.background[1, i]
        tilt = kept * of_background
        if core_spread > 0.0:
            of_core = 2.0 * core_variance / core_spread
            is_kept = not trend.is_known or (
                trend.of_core[0, i] > steep_core and _is_clear(xx, xy, yy, statistics.area[i], radius[i])
            )
            kept = 1.0 if is_kept else share * even_core / (share * even_core + of_core)
            lost_x += (1.0 - kept) * trend.core[0, i]
            lost_y += (1.0 - kept) * trend.core[1, i]
            tilt = 0.25 * (tilt + kept * of_core)
        else:
            # without a plane of its own, the dot was taken to be parallel to its background
            lost_x, lost_y = 2.0 * lost_x - trend.contrast[0, i], 2.0 * lost_y - trend.contrast[1, i]
            tilt += 0.25 * trend.contrast[2, i]
        out[i, X] += 0.5 * scale * (xx * lost_x + xy * lost_y)
        out[i, Y] += 0.5 * scale * (xy * lost_x + yy * lost_y)
        passed = _passed_noise(statistics, i, background_variance, core_variance)
        edge = 0.5 * (background_variance + core_variance)
        scale *= scale
        out[i, CXX] += scale * (edge * xx + passed + tilt * (xx * xx + xy * xy))
        out[i, CXY] += scale * (edge * xy + tilt * xy * (xx + yy))
        out[i, CYY] += scale * (edge * yy + passed + tilt * (yy * yy + xy * xy))
