"""Values that the kernels of this package exchange.

There are two measurements of a dot. The plain one (`plain_dots`) is fast and for dots without a glint, a
hole, a damaged edge or a step of brightness next to them, whose sampling pattern is inside the image; the
general one (`general_dots`) is for all others. Grey levels are those of 255, multiplied by -1 for dark dots,
so that each dot is lighter than its background. Offsets are in pixels, x right and y down. Their origin is
the pixel nearest to the dot, in the general measurement the expected position.

A `MeasuredDot` is one dot between two kernels; `centroid.MeasuredDots` are the results for all dots.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Shaped

from manytouch.compilation import inlined_kernel, no_type_check

# Soft threshold on the coverage of a pixel by the dot: weight 0 below `low`, 1 above 1 - `low`, linear
# between. `low` is between these two, see `soft_threshold`.
LEAST_LOW, SMALL_LOW, MOST_LOW = 0.05, 0.1, 0.15
SMALL_RADIUS, PLAIN_RADIUS = (
    2.4,
    3.0,
)  # px: `low` is at least SMALL_LOW up to the first, LEAST_LOW from the second
NOISES = 3.0  # deviations of a pixel that the threshold is at least
# Radius in px below which the core of a plain dot gets no plane of its own: it has too few pixels for that.
PLANE_RADIUS = 6.2

# Columns of the array of measured dots, NaN where there is no dot: centre x, y (px), its covariance (px^2),
# visible area (px^2), contrast (grey levels of 255), width of the edge (px), and the share of the dot that is
# beyond the border of the image.
X, Y, CXX, CXY, CYY, AREA, CONTRAST, EDGE, CUT = range(9)
COLUMNS = 9


class Pixels(NamedTuple):
    """An image.

    Attributes:
        rows: (h, w * c) uint8, uint16 or float32.
        flat: (h * w * c,) the same memory.
        weights: (c,) signed weights of the channels.
        width, height: in pixels.
        channels: 1 or 3.
    """

    rows: Shaped[np.ndarray, "h wc"]
    flat: Shaped[np.ndarray, " hwc"]
    weights: Float32[np.ndarray, " c"]
    width: int
    height: int
    channels: int


class Samples(NamedTuple):
    """Pixels of the background, of the core or of the whole of a dot.

    Attributes:
        dx, dy: (n,) offsets.
        value: (n,) grey levels.
        used: (n,) 1 for samples that count, else 0.
    """

    dx: Float32[np.ndarray, " n"]
    dy: Float32[np.ndarray, " n"]
    value: Float32[np.ndarray, " n"]
    used: Float32[np.ndarray, " n"]


class Plane(NamedTuple):
    """Least-squares plane a + b dx + c dy.

    Attributes:
        a, b, c: coefficients.
        number: of samples used.
        variance: of their residuals; 0 if there are too few samples.
        spread: sum of dx^2 + dy^2 about the mean.
    """

    a: float
    b: float
    c: float
    number: float = 0.0
    variance: float = 0.0
    spread: float = 0.0


class Step(NamedTuple):
    """A straight step of brightness next to a dot, beyond which its background has another level.

    Attributes:
        x, y: unit vector towards it, at right angles.
        limit: up to how far along that vector pixels are free of it, px.
    """

    x: float
    y: float
    limit: float


NO_STEP = Step(0.0, 0.0, 1e6)


class BrightnessFit(NamedTuple):
    """Planes of the background and of the contrast of a dot.

    Attributes:
        background, background_x, background_y: grey level at the origin of the offsets, and its slopes along
            x and y, per px.
        contrast, contrast_x, contrast_y: the same for dot minus background.
        background_variance: of the residuals of its plane, squared grey levels.
        background_spread, core_spread: sum of dx^2 + dy^2 of the samples about their mean, px^2; 0 for a core
            without a plane of its own.
        core_variance: of the residuals of the core's plane; -1 if not known.
        low: coverage of a pixel below which its weight is 0.
    """

    background: float
    background_x: float
    background_y: float
    contrast: float
    contrast_x: float
    contrast_y: float
    background_variance: float
    background_spread: float
    core_spread: float
    core_variance: float
    low: float


NO_FIT = BrightnessFit(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, MOST_LOW)


@inlined_kernel()
@no_type_check
def soft_threshold(noise: float, contrast: float, radius: float) -> float:
    """Coverage below which a pixel has no weight: the least that noise and the size of the dot allow.

    Pixels are samples of the weight, whose sum depends on where the dot is within a pixel, the more the
    steeper it rises from 0 to 1. Noise of the background has to stay below the threshold, and so have the
    blurred edges of small dots at the border of their window, which is as many pixels away from them.
    """
    part = min(max((radius - SMALL_RADIUS) / (PLAIN_RADIUS - SMALL_RADIUS), 0.0), 1.0)
    return min(max(SMALL_LOW + part * (LEAST_LOW - SMALL_LOW), NOISES * noise / contrast), MOST_LOW)


class Moments(NamedTuple):
    """Sums over the pixels of a dot: of their weights, and over its edge pixels (0 < weight < 1).

    Attributes:
        total, x, y: sums of the weights, px^2, and of the weights times the offsets, px^3.
        edges: number of edge pixels.
        edge_x, edge_y, edge_xx, edge_xy, edge_yy: sums of their offsets and of products of these.
    """

    total: float
    x: float
    y: float
    edges: float
    edge_x: float
    edge_y: float
    edge_xx: float
    edge_xy: float
    edge_yy: float


NO_MOMENTS = Moments(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class MeasuredDot(NamedTuple):
    """What the plain or the general measurement of one dot returns.

    Attributes:
        status: FOUND; NO_DOT; or, of the plain measurement only, NOT_PLAIN: the general one has to measure
            it.
        x, y: origin of the offsets in the image, px.
        reach2: square of the radius of the window, px^2.
        fit, moments: brightness and sums with offsets from that origin.
    """

    status: int
    x: float
    y: float
    reach2: float
    fit: BrightnessFit
    moments: Moments


FOUND, NO_DOT, NOT_PLAIN, AT_BORDER = 1, 0, -1, -2
# States of a dot. AT_BORDER: its sampling pattern is not inside the image, so that only the general
# measurement is possible; `measure_dots` sets it before the plain one.


class DotStatistics(NamedTuple):
    """What `covariance.add_noise` needs of all dots of an image, one element for each.

    Attributes:
        edge_xx, edge_xy, edge_yy: (n,) sums, over the edge pixels, of products of their offsets from the
            centre, px^2.
        window: (n,) integral of x^2 over the window about its middle, px^4.
        scale: (n,) shift of the centre in px by one grey level more in one pixel, per px of its offset.
        area: (n,) sum of the weights, px^2.
        background, background_x, background_y, contrast, contrast_x, contrast_y, background_variance,
            background_spread, core_spread, core_variance, low: (n,) as in `BrightnessFit`; the variances are
            -1 where there is no dot.
    """

    edge_xx: Float64[np.ndarray, " n"]
    edge_xy: Float64[np.ndarray, " n"]
    edge_yy: Float64[np.ndarray, " n"]
    window: Float64[np.ndarray, " n"]
    scale: Float64[np.ndarray, " n"]
    area: Float64[np.ndarray, " n"]
    background: Float64[np.ndarray, " n"]
    background_x: Float64[np.ndarray, " n"]
    background_y: Float64[np.ndarray, " n"]
    contrast: Float64[np.ndarray, " n"]
    contrast_x: Float64[np.ndarray, " n"]
    contrast_y: Float64[np.ndarray, " n"]
    background_variance: Float64[np.ndarray, " n"]
    background_spread: Float64[np.ndarray, " n"]
    core_spread: Float64[np.ndarray, " n"]
    core_variance: Float64[np.ndarray, " n"]
    low: Float64[np.ndarray, " n"]
