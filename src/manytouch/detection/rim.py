"""Centres of dots from their rims, of which other things hide the outline of a part; compiled.

Through a transparent skin dark things are seen next to dark dots. They become part of a dot where its centre
is the mean of its pixels. Its rim is still there on the other sides, and its radius is known: on rays from
the centre the brightness falls most at the rim, and a circle goes through most of these places.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import numpy as np
from jaxtyping import Float32, Float64, Shaped

from manytouch.compilation import REORDER, f32, inlined_kernel, kernel, no_type_check
from manytouch.values.arrays import Points2, Scalars

RAYS = 16
NEAREST, STEP, SAMPLES = 0.4, 0.125, 11
"""Where rays begin, and how far apart their samples are, over the radius."""
NEAR_RIM = 0.3
"""Deviation of the place of the rim from the radius, over it."""
ROUND = 0.08
"""Deviation of a rim from a circle, over the radius, from which on it counts less."""
RADIUS_WEIGHT = 2.0
"""Weight of the known radius, in rays. Compared were 0, 2 and 8 (ADR 163)."""
WINDOW = 2.2
"""Distance from the given position to the border of what is looked at, over the radius."""
WALKS, REPEATS = 3, 5
STILL = 0.05  # of the radius: a shorter walk is the last
LEAST_SHARE = 0.6
"""Least share of rays on the circle with which it is the dot."""
LEAST_RADIUS_PX = 2.5
"""Smaller dots have too few pixels for a rim."""

_ALONG_X = np.cos(2.0 * np.pi * np.arange(RAYS) / RAYS)
_ALONG_Y = np.sin(2.0 * np.pi * np.arange(RAYS) / RAYS)
_LIKELY = np.exp(-0.5 * ((NEAREST + STEP * np.arange(SAMPLES) - 1.0) / NEAR_RIM) ** 2)


@kernel(fastmath=REORDER)
@no_type_check
def _cut_out(
    rows: Shaped[np.ndarray, "h wc"], weights: Float32[np.ndarray, " c"], x0: int, y0: int,
    grey: Float32[np.ndarray, "v u"],
) -> None:  # fmt: skip
    """Grey levels of a part of an image whose first pixel is (x0, y0)."""
    channels = weights.shape[0]
    for v in range(grey.shape[0]):
        for u in range(grey.shape[1]):
            total = f32(0.0)
            for c in range(channels):
                total += weights[c] * f32(rows[y0 + v, (x0 + u) * channels + c])
            grey[v, u] = total


@inlined_kernel()
@no_type_check
def _between(grey: Float32[np.ndarray, "v u"], x: float, y: float) -> float:
    """Grey level between pixels; beyond the border that of the border."""
    x, y = min(max(x, 0.0), grey.shape[1] - 1.001), min(max(y, 0.0), grey.shape[0] - 1.001)
    u, v = int(x), int(y)
    dx, dy = x - u, y - v
    above: float = grey[v, u] * (1.0 - dx) + grey[v, u + 1] * dx
    below: float = grey[v + 1, u] * (1.0 - dx) + grey[v + 1, u + 1] * dx
    return above * (1.0 - dy) + below * dy


@kernel()
@no_type_check
def _find_rim(
    grey: Float32[np.ndarray, "v u"], x: float, y: float, radius: float,
    place: Float64[np.ndarray, " r"], fall: Float64[np.ndarray, " r"],
) -> None:  # fmt: skip
    """Where each ray leaves the dot, over the radius and less 1, and how much the brightness falls there."""
    level = np.empty(SAMPLES)
    likely = np.empty(SAMPLES)
    for ray in range(RAYS):
        u, v = radius * _ALONG_X[ray], radius * _ALONG_Y[ray]
        for k in range(SAMPLES):
            away = NEAREST + STEP * k
            level[k] = _between(grey, x + away * u, y + away * v)
        best = 2
        for k in range(1, SAMPLES - 1):
            likely[k] = max(level[k - 1] - level[k + 1], 0.0) * _LIKELY[k]
            if 1 < k < SAMPLES - 2 and likely[k] > likely[best]:
                best = k
        before, here, after = likely[best - 1], likely[best], likely[best + 1]
        bend = before - 2.0 * here + after
        part = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
        place[ray] = NEAREST + STEP * (best + min(max(part, -1.0), 1.0)) - 1.0
        fall[ray] = max(level[best - 1] - level[best + 1], 0.0)


@kernel()
@no_type_check
def _fit_circle(
    place: Float64[np.ndarray, " r"], fall: Float64[np.ndarray, " r"]
) -> tuple[float, float, float]:
    """Its middle along x and y, over the radius, and the share of rays on it."""
    usual = np.median(fall)
    growth, x, y = np.median(place), 0.0, 0.0
    for _ in range(REPEATS):
        s = sx = sy = sxx = sxy = syy = e = ex = ey = 0.0
        for ray in range(RAYS):
            u, v = _ALONG_X[ray], _ALONG_Y[ray]
            off = (place[ray] - growth - x * u - y * v) / ROUND
            weight = min(fall[ray], 1.5 * usual) / ((1.0 + off * off) * max(usual, 1e-9))
            s += weight
            sx += weight * u
            sy += weight * v
            sxx += weight * u * u
            sxy += weight * u * v
            syy += weight * v * v
            e += weight * place[ray]
            ex += weight * place[ray] * u
            ey += weight * place[ray] * v
        s += RADIUS_WEIGHT
        # without the growth of the radius two equations remain
        axx, axy, ayy = sxx - sx * sx / s, sxy - sx * sy / s, syy - sy * sy / s
        bx, by = ex - e * sx / s, ey - e * sy / s
        determinant = axx * ayy - axy * axy
        if not determinant > 1e-6:
            return 0.0, 0.0, 0.0
        x, y = (ayy * bx - axy * by) / determinant, (axx * by - axy * bx) / determinant
        growth = (e - sx * x - sy * y) / s
    number = 0
    for ray in range(RAYS):
        off = place[ray] - growth - x * _ALONG_X[ray] - y * _ALONG_Y[ray]
        number += abs(off) < 2.0 * ROUND and fall[ray] > 0.0
    return x, y, number / RAYS


@kernel()
@no_type_check
def _fit_rims(
    rows: Shaped[np.ndarray, "h wc"], weights: Float32[np.ndarray, " c"], near: Float64[np.ndarray, "n 2"],
    radius: Float64[np.ndarray, " n"], out: Float64[np.ndarray, "n 3"],
) -> None:  # fmt: skip
    place, fall, width = np.empty(RAYS), np.empty(RAYS), rows.shape[1] // weights.shape[0]
    for i in range(near.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = np.nan, np.nan, 0.0
        x, y, share = near[i, 0], near[i, 1], 0.0
        if not (abs(x) < 1e6 and abs(y) < 1e6 and radius[i] >= LEAST_RADIUS_PX):
            continue
        reach = int(WINDOW * radius[i]) + 2
        x0, x1 = max(int(x) - reach, 0), min(int(x) + reach, width)
        y0, y1 = max(int(y) - reach, 0), min(int(y) + reach, rows.shape[0])
        if x1 - x0 < 2 or y1 - y0 < 2:
            continue
        grey = np.empty((y1 - y0, x1 - x0), dtype=np.float32)
        _cut_out(rows, weights, x0, y0, grey)
        for _ in range(WALKS):
            _find_rim(grey, x - x0, y - y0, radius[i], place, fall)
            dx, dy, share = _fit_circle(place, fall)
            x += radius[i] * min(max(dx, -1.0), 1.0)
            y += radius[i] * min(max(dy, -1.0), 1.0)
            if dx * dx + dy * dy < STILL * STILL:
                break
        if share >= LEAST_SHARE:
            out[i, 0], out[i, 1], out[i, 2] = x, y, share


def fit_rims(
    image: np.ndarray, weights: Float64[np.ndarray, " c"], near_px: Points2, radius_px: Scalars
) -> tuple[Points2, Scalars]:
    """Centres (n, 2) of the rims of dots near given positions, NaN without one, and the shares seen (n,).

    Args:
        image: (h, w) or (h, w, c).
        weights: (c,) of the channels, signed so that dots are light.
        near_px: (n, 2) a dot is within about half a radius; NaN is allowed.
        radius_px: (n,) of the dots.
    """
    out = np.empty((len(near_px), 3))
    rows = np.ascontiguousarray(image).reshape(image.shape[0], -1)
    _fit_rims(
        rows, weights.astype(np.float32), np.ascontiguousarray(near_px), np.ascontiguousarray(radius_px), out
    )
    return np.ascontiguousarray(out[:, :2]), out[:, 2].copy()
