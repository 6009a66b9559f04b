"""Outlines of blobs along rays from their centres.

They are the measurements by which `pattern` and `channel` distinguish dots from gaps, edges and ridges: part
of the survey of an unknown image, not of the search in each frame. The brightness of a dot falls to the
background in every direction. Between dots, along ridges, at edges and in corners there are directions in
which it does not.
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64, Shaped

from manytouch.compilation import THREADS, in_threads, kernel, no_type_check, u64
from manytouch.values.arrays import Points2, Scalars

RAYS = 24
STEPS = 26  # samples of a ray
REACH = 2.6  # radii
MOST_TRIALS = 3  # of each blob, from the centroid and size of the one before
FITTING_RADIUS_PX = 4.0
"""A blob is sampled in the octave in which its radius is this to twice this, if there is one."""
X, Y, RADIUS, CONTRAST, OPENNESS, ASPECT, ROUGHNESS, VISIBLE, FILL = range(9)  # of a row, as in `Outlines`
COLUMNS = 9
ANGLES = [2.0 * math.pi * ray / RAYS for ray in range(RAYS)]
COSINE, SINE = np.array([math.cos(each) for each in ANGLES]), np.array([math.sin(each) for each in ANGLES])


class OutlineLimits(NamedTuple):
    """Limits of the outline of a dot.

    Attributes:
        least_ray_share: share of a ray that must be inside the image, so that it is visible.
        least_rays: share of the rays that must be visible.
        closed: a ray whose fall is at least this share of the median fall has an end; otherwise it is open.
        ridge: fall below which both of two opposite rays belong to a ridge.
        most_contrast: largest fall, as a multiple of the median fall, that sets the level of the outline.
    """

    least_ray_share: float = 0.7
    least_rays: float = 1.0 / 3.0
    closed: float = 0.5
    ridge: float = 0.65
    most_contrast: float = 1.5


class RaySamples(NamedTuple):
    """Samples along the rays of one blob, and scratch.

    Attributes:
        values: (RAYS, STEPS) brightness; not set outside the image.
        samples_inside: (RAYS,) number of samples inside the image.
        falls: (RAYS,) fall of the brightness; NaN if not known.
        lengths: (RAYS,) length of the rays to the outline, px; NaN if not known.
        scratch: (RAYS,) of medians.
    """

    values: Float64[np.ndarray, "r s"]
    samples_inside: Int64[np.ndarray, " r"]
    falls: Float64[np.ndarray, " r"]
    lengths: Float64[np.ndarray, " r"]
    scratch: Float64[np.ndarray, " r"]


LIMITS = OutlineLimits()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Outlines:
    """Outlines of blobs; NaN where there is none.

    Attributes:
        place_px: (n, 2) centroid of the outline.
        radius_px: (n,) of the disc of the same area.
        contrast: (n,) level of the core minus that of the background, grey levels of 255, positive.
        openness: (n,) share of the directions without a fall.
        aspect: (n,) long against short axis of the outline.
        fill: (n,) share of the area inside the outline that is lighter than half the contrast; a glint lowers
            it a little, the gap between two dots much.
        roughness: (n,) deviation of the outline from an ellipse, in radii.
        visible: (n,) share of the rays that stay within the image.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars
    openness: Scalars
    aspect: Scalars
    roughness: Scalars
    visible: Scalars
    fill: Scalars

    def at(self, chosen: np.ndarray) -> "Outlines":
        """Some of them, by mask or index."""
        return Outlines(**{name: getattr(self, name)[chosen] for name in self.__slots__})


def trace_outlines(pyramid: list[np.ndarray], place_px: Points2, radius_px: Scalars, sign: float) -> Outlines:
    """Outlines of blobs, by rays through the octaves of a pyramid.

    `sign` is 1 for light blobs, -1 for dark.
    """
    octave_of_blob = np.floor(np.log2(np.maximum(radius_px / FITTING_RADIUS_PX, 1.0))).astype(int)
    octave_of_blob = np.minimum(octave_of_blob, len(pyramid) - 1)
    rows = np.full((len(place_px), COLUMNS), np.nan)

    def trace(blobs: np.ndarray) -> None:
        for octave, image in enumerate(pyramid):
            chosen, scale = blobs[octave_of_blob[blobs] == octave], 2.0**octave
            part = np.full((len(chosen), COLUMNS), np.nan)
            trace_octave(image, place_px[chosen] / scale, radius_px[chosen] / scale, sign, part)
            part[:, [X, Y, RADIUS]] *= scale
            rows[chosen] = part

    in_threads(trace, [np.arange(first, len(rows), THREADS) for first in range(THREADS)])
    _, *names = Outlines.__slots__  # in the order of the columns
    columns = dict(zip(names, rows[:, RADIUS:].T.copy(), strict=True))
    return Outlines(place_px=np.ascontiguousarray(rows[:, [X, Y]]), **columns)


Octave = Shaped[np.ndarray, "h w"]


@kernel()
@no_type_check
def _between(image: Octave, x: float, y: float) -> float:
    """Bilinear interpolation at a place whose four pixels are in the image."""
    left, top = int(x), int(y)
    a, b = x - left, y - top
    u, v = u64(left), u64(top)
    below, right = v + u64(1), u + u64(1)
    upper: float = (1.0 - a) * image[v, u] + a * image[v, right]
    lower: float = (1.0 - a) * image[below, u] + a * image[below, right]
    return (1.0 - b) * upper + b * lower


@kernel()
@no_type_check
def _sample_rays(image: Octave, x: float, y: float, radius: float, sign: float, rays: RaySamples) -> None:
    """Samples the brightness along all rays."""
    height, width = image.shape
    reach = REACH * radius
    is_inside = reach <= x < width - 1.01 - reach and reach <= y < height - 1.01 - reach
    for ray in range(RAYS):
        rays.samples_inside[ray] = STEPS
        for step in range(STEPS):
            distance = REACH * radius * (step + 0.5) / STEPS
            u, v = x + distance * COSINE[ray], y + distance * SINE[ray]
            if is_inside:
                rays.values[ray, step] = sign * _between(image, u, v)
            elif u < -0.5 or v < -0.5 or u > width - 0.5 or v > height - 0.5:
                rays.samples_inside[ray] = step
                break
            else:
                u, v = min(max(u, 0.0), width - 1.001), min(max(v, 0.0), height - 1.001)
                rays.values[ray, step] = sign * _between(image, u, v)


@kernel()
@no_type_check
def _sorted_middle(value: Float64[np.ndarray, " r"], count: int) -> float:
    """Median of the first values, the larger one of two; sorts them by insertion, as they are few."""
    for i in range(1, count):
        one, j = value[i], i
        while j > 0 and value[j - 1] > one:
            value[j] = value[j - 1]
            j -= 1
        value[j] = one
    middle: float = value[count // 2]
    return middle


@kernel()
@no_type_check
def _find_core(rays: RaySamples) -> tuple[float, int]:
    """Largest median brightness of a ring within the radius, and the step of that ring."""
    core, best = -1e9, 0
    for step in range(int(STEPS * 1.0 / REACH)):
        count = lighter = 0
        for ray in range(RAYS):
            if rays.samples_inside[ray] > step:
                rays.scratch[count] = rays.values[ray, step]
                lighter += rays.scratch[count] > core
                count += 1
        if count >= int(RAYS * LIMITS.least_rays) and 2 * lighter >= count:
            middle = _sorted_middle(rays.scratch, count)
            if middle > core:
                core, best = middle, step
    return core, best


@kernel()
@no_type_check
def _measure_falls(rays: RaySamples, core: float, best: int) -> tuple[int, float]:
    """Fall of each visible ray from the core; returns the number of visible rays and the median fall."""
    count = 0
    for ray in range(RAYS):
        rays.falls[ray] = np.nan
        if rays.samples_inside[ray] < int(LIMITS.least_ray_share * STEPS):
            continue
        low = 1e9
        for step in range(best, rays.samples_inside[ray]):
            low = min(low, rays.values[ray, step])
        rays.falls[ray] = core - low
        rays.scratch[count] = rays.falls[ray]
        count += 1
    if count < int(RAYS * LIMITS.least_rays):
        return count, 0.0
    return count, _sorted_middle(rays.scratch, count)


@kernel()
@no_type_check
def _length(rays: RaySamples, ray: int, best: int, level: float, radius: float) -> float:
    """Length of a ray up to a level, px; NaN if it does not fall below."""
    for step in range(best, rays.samples_inside[ray]):
        value = rays.values[ray, step]
        if value < level:
            part = 0.0
            if step > 0 and rays.values[ray, step - 1] > level:
                before = rays.values[ray, step - 1]
                part = (before - level) / (before - value) - 1.0
            return REACH * radius * (max(step + part, 0.0) + 0.5) / STEPS
    return np.nan


@kernel()
@no_type_check
def _measure_lengths(rays: RaySamples, core: float, best: int, contrast: float, radius: float) -> int:
    """Length of each ray up to half of its fall; returns the number of open rays."""
    open_rays = 0
    for ray in range(RAYS):
        rays.lengths[ray] = np.nan
        fall = rays.falls[ray]
        if not math.isfinite(fall):
            continue
        if fall < LIMITS.closed * contrast:
            open_rays += 1
            continue
        level = core - 0.5 * min(fall, LIMITS.most_contrast * contrast)
        rays.lengths[ray] = _length(rays, ray, best, level, radius)
    return open_rays


@kernel()
@no_type_check
def _is_ridge(rays: RaySamples, contrast: float) -> bool:
    """Whether opposite rays are open: a ridge, a cable, a stripe.

    A ray that leaves the image may be one too.
    """
    low = LIMITS.ridge * contrast
    for ray in range(RAYS):
        for turn in range(RAYS // 2 - 1, RAYS // 2 + 2):
            if rays.falls[ray] < low and not rays.falls[(ray + turn) % RAYS] >= low:
                return True
    return False


@kernel()
@no_type_check
def _fill_lengths(rays: RaySamples) -> bool:
    """Sets unknown lengths to the median; False if too few are known."""
    count = 0
    for ray in range(RAYS):
        if math.isfinite(rays.lengths[ray]):
            rays.scratch[count] = rays.lengths[ray]
            count += 1
    if count < RAYS // 4:
        return False
    typical = _sorted_middle(rays.scratch, count)
    for ray in range(RAYS):
        if not math.isfinite(rays.lengths[ray]):
            rays.lengths[ray] = typical
    return True


@kernel()
@no_type_check
def _fill_share(rays: RaySamples, radius: float, least: float) -> float:
    """Share of the area inside the outline that is lighter than `least`."""
    light = total = 0.0
    for ray in range(RAYS):
        for step in range(rays.samples_inside[ray]):
            distance = REACH * radius * (step + 0.5) / STEPS
            if distance < rays.lengths[ray]:
                total += distance
                if rays.values[ray, step] > least:
                    light += distance
    return light / total if total > 0.0 else 0.0


@kernel()
@no_type_check
def _trace_one(
    image: Octave,
    x: float,
    y: float,
    radius: float,
    sign: float,
    rays: RaySamples,
    row: Float64[np.ndarray, "9"],
) -> float:
    """One outline, all but its shape and fill; the brightness of its core, NaN if there is no outline."""
    _sample_rays(image, x, y, radius, sign, rays)
    core, best = _find_core(rays)
    visible_rays, contrast = _measure_falls(rays, core, best)
    row[VISIBLE] = visible_rays / RAYS
    if contrast <= 0.0:
        return np.nan
    open_rays = _measure_lengths(rays, core, best, contrast, radius)
    row[CONTRAST], row[OPENNESS] = contrast, open_rays / visible_rays
    if _is_ridge(rays, contrast):
        row[OPENNESS] = max(row[OPENNESS], 0.5)  # counts as half open, so that it is never a dot
    if not _fill_lengths(rays):
        return np.nan
    area = sum_x = sum_y = 0.0
    for ray in range(RAYS):
        length = rays.lengths[ray]
        area += 0.5 * length**2
        sum_x += length**3 / 3.0 * COSINE[ray]
        sum_y += length**3 / 3.0 * SINE[ray]
    row[X], row[Y] = x + sum_x / area, y + sum_y / area
    row[RADIUS] = math.sqrt(2.0 * area / RAYS)
    return core


@kernel()
@no_type_check
def _measure_shape(lengths: Float64[np.ndarray, " r"], row: Float64[np.ndarray, "9"]) -> None:
    """Aspect and roughness from the harmonics of the lengths: the first is a shift, the second an ellipse."""
    mean = c1 = s1 = c2 = s2 = 0.0
    for ray in range(RAYS):
        twice = 2 * ray % RAYS
        mean += lengths[ray] / RAYS
        c1 += 2.0 * lengths[ray] * COSINE[ray] / RAYS
        s1 += 2.0 * lengths[ray] * SINE[ray] / RAYS
        c2 += 2.0 * lengths[ray] * COSINE[twice] / RAYS
        s2 += 2.0 * lengths[ray] * SINE[twice] / RAYS
    squares = 0.0
    for ray in range(RAYS):
        twice = 2 * ray % RAYS
        shift = c1 * COSINE[ray] + s1 * SINE[ray]
        smooth = mean + shift + c2 * COSINE[twice] + s2 * SINE[twice]
        squares += (lengths[ray] - smooth) ** 2
    ellipse = min(math.hypot(c2, s2) / mean, 0.9)
    row[ASPECT] = (1.0 + ellipse) / (1.0 - ellipse)
    row[ROUGHNESS] = math.sqrt(squares / RAYS) / mean


@kernel()
@no_type_check
def trace_octave(
    image: Octave,
    place: Float64[np.ndarray, "n 2"],
    radius: Float64[np.ndarray, " n"],
    sign: float,
    rows: Float64[np.ndarray, "n 9"],
) -> None:
    """Traces blobs, each again from its outline's centroid and size until these stay.

    Args:
        image: one octave.
        place, radius: of the blobs, px of this octave.
        sign: 1 for light blobs, -1 for dark ones.
        rows: written; columns as numbered above, NaN where there is no outline.
    """
    rays = RaySamples(
        np.empty((RAYS, STEPS)),
        np.empty(RAYS, dtype=np.int64),
        np.empty(RAYS),
        np.empty(RAYS),
        np.empty(RAYS),
    )
    row = np.empty(COLUMNS)
    for i in range(place.shape[0]):
        x, y, size = place[i, 0], place[i, 1], radius[i]
        for trial in range(MOST_TRIALS):
            core = _trace_one(image, x, y, size, sign, rays, row)
            if math.isnan(core):
                rows[i] = np.nan
                break
            shift = math.hypot(row[X] - x, row[Y] - y)
            is_settled = shift < 0.1 * size and 0.8 < row[RADIUS] / size < 1.25
            if is_settled or trial == MOST_TRIALS - 1:
                _measure_shape(rays.lengths, row)
                row[FILL] = _fill_share(rays, size, core - 0.5 * row[CONTRAST])
                rows[i] = row
                break
            limit = min(max(row[RADIUS], 0.5 * size), 1.6 * size)
            step = min(1.0, 0.8 * size / max(shift, 1e-9))
            x, y, size = x + step * (row[X] - x), y + step * (row[Y] - y), max(limit, 1.0)
