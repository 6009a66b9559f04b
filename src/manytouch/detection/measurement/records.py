"""Values that the kernels of this package exchange.

Grey levels are signed so that dots are light, in grey levels of 255. Offsets are in pixels, x right and y
down, from the pixel nearest to the dot or, in the general measurement, from the expected position.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Shaped

# Soft threshold on the coverage of a pixel by the dot: weight 0 below LOW, 1 above HIGH, linear between.
LOW, HIGH = 0.15, 0.85
GAIN = 1.0 / (HIGH - LOW)
# Smaller radii (px): a core is all edge, or too small for a plane of its own.
PLANE_RADIUS = 6.2

# Columns of the array of measured dots, NaN where there is no dot: centre, covariance, visible area,
# contrast, width of the edge, share that is beyond the border of the image.
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


class BrightnessFit(NamedTuple):
    """Planes of the background and of the contrast of a dot.

    Attributes:
        background, background_x, background_y: level at the origin and slopes.
        contrast, contrast_x, contrast_y: the same for dot minus background.
        background_variance: of the residuals.
        background_spread, core_spread: sum of dx^2 + dy^2 of the samples; 0 for a core without its own plane.
        core_variance: of the residuals; -1 if not known.
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


NO_FIT = BrightnessFit(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0)


class Moments(NamedTuple):
    """Weight of a dot and moments of its weights and of its edge pixels (0 < weight < 1) about the origin.

    Attributes:
        total, x, y: sum of the weights and first moments.
        edges: number of edge pixels.
        edge_x, edge_y, edge_xx, edge_xy, edge_yy: their first and second moments.
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
    """What the measurement of one dot returns.

    Attributes:
        status: FOUND, MISSING, NOT_PLAIN, or AT_BORDER if its sampling pattern is not inside the image.
        x, y: origin of the offsets, px.
        reach2: square of the radius of the window, px^2.
        fit, moments: brightness and moments about the origin.
    """

    status: int
    x: float
    y: float
    reach2: float
    fit: BrightnessFit
    moments: Moments


FOUND, MISSING, NOT_PLAIN, AT_BORDER = 1, 0, -1, -2


class DotStatistics(NamedTuple):
    """What the covariance needs of all dots of an image, one row each; see `covariance`.

    Attributes:
        edge_xx, edge_xy, edge_yy: (n,) second moments of the edge pixels about the centre, px^2.
        window: (n,) second moment of the window, px^4.
        scale: (n,) change of the centre per grey level and px.
        area: (n,) sum of the weights, px^2.
        background, contrast, contrast_x, contrast_y, background_variance, background_spread, core_spread,
            core_variance: (n,) as in `BrightnessFit`; the variances are -1 where there is no dot.
    """

    edge_xx: Float64[np.ndarray, " n"]
    edge_xy: Float64[np.ndarray, " n"]
    edge_yy: Float64[np.ndarray, " n"]
    window: Float64[np.ndarray, " n"]
    scale: Float64[np.ndarray, " n"]
    area: Float64[np.ndarray, " n"]
    background: Float64[np.ndarray, " n"]
    contrast: Float64[np.ndarray, " n"]
    contrast_x: Float64[np.ndarray, " n"]
    contrast_y: Float64[np.ndarray, " n"]
    background_variance: Float64[np.ndarray, " n"]
    background_spread: Float64[np.ndarray, " n"]
    core_spread: Float64[np.ndarray, " n"]
    core_variance: Float64[np.ndarray, " n"]
