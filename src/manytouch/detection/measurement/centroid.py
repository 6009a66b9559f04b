"""Sub-pixel centres of dots, each flattened first, with the covariance that noise gives them.

In a window around each dot the brightness of the background is a plane through a ring around the dot, and
that of the dot a plane through its core; both are fitted to the pixels that agree with each other. Between
them is the coverage s of each pixel, and

    w = min(max((s - l) / (1 - 2 l), 0), 1),     centre = sum w x / sum w,

with l from 0.05 to 0.15 (`records.soft_threshold`). So neither uneven light nor an uneven background moves
the centre, and noise away from the edge does not count. The covariance follows by propagation: from the
pixels of the edge, from the slopes of the two planes, and from noise that passes the soft threshold. How
noise grows with light, and how uneven light usually is, is estimated from all dots of the image. See
docs/derivations/detection.md.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import plain
from manytouch.detection.measurement.measure_dots import measure_dots
from manytouch.detection.measurement.records import AREA, COLUMNS, CONTRAST, CUT, CXX, CXY, CYY, EDGE, X, Y
from manytouch.detection.measurement.sampling_pattern import SamplingPatterns, sampling_patterns
from manytouch.detection.noise import MIN_NOISE
from manytouch.values import Detections
from manytouch.values.arrays import Covariances2, Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MeasuredDots:
    """Measured dots, one row for each position.

    Attributes:
        centre_px: (n, 2) NaN where there is no dot in the window.
        covariance_px2: (n, 2, 2).
        area_px2: (n,) visible area.
        contrast: (n,) dot minus background, grey levels of 255.
        edge_px: (n,) width of the edge from 15 % to 85 %.
        cut: (n,) share of the dot beyond the border of the image, 0 to 1.
        is_found: (n,).
    """

    centre_px: Points2
    covariance_px2: Covariances2
    area_px2: Scalars
    contrast: Scalars
    edge_px: Scalars
    cut: Scalars
    is_found: Mask

    def at(self, keep: Mask, corner: Float64[np.ndarray, "2"]) -> Detections:
        """Detections of some of the dots; `corner` is the position of the first pixel in the whole image."""
        return Detections(
            centre_px=self.centre_px[keep] + corner,
            covariance_px2=self.covariance_px2[keep],
            area_px2=self.area_px2[keep],
            contrast=self.contrast[keep],
        )


def measure(
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    near_px: Points2,
    radius_px: Scalars,
    *,
    noise: float,
    walk: int = 0,
) -> MeasuredDots:
    """Measures the dots near given positions.

    Args:
        image: (h, w) or (h, w, c), uint8, uint16 or float32.
        weights: (c,) of the channels, for grey levels of 255, signed so that dots are light.
        near_px: (n, 2) a dot within about half a radius of its position is measured; NaN is allowed.
        radius_px: (n,) expected radii.
        noise: rough standard deviation of a pixel, grey levels of 255, to recognise outliers; see
            `estimate_noise`.
        walk: number of coarse steps towards the dot before measuring (reach: about one radius).
    """
    out = measure_rows(
        image, weights, near_px, radius_px, sampling_patterns(radius_px), noise=noise, walk=walk
    )
    covariance = np.empty((len(out), 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = out[:, CXX], out[:, CYY]
    covariance[:, 0, 1] = covariance[:, 1, 0] = out[:, CXY]
    return MeasuredDots(
        centre_px=np.ascontiguousarray(out[:, [X, Y]]),
        covariance_px2=covariance,
        area_px2=out[:, AREA].copy(),
        contrast=out[:, CONTRAST].copy(),
        edge_px=out[:, EDGE].copy(),
        cut=out[:, CUT].copy(),
        is_found=np.isfinite(out[:, X]),
    )


def measure_rows(
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    near_px: Points2,
    radius_px: Scalars,
    patterns: SamplingPatterns,
    *,
    noise: float,
    walk: int = 0,
) -> Float64[np.ndarray, "n 9"]:
    """As `measure`, with the sampling patterns of the radii; columns as in `records`."""
    out = np.empty((len(near_px), COLUMNS))
    measure_dots(
        np.ascontiguousarray(image).reshape(image.shape[0], -1),
        weights.astype(np.float32),
        np.ascontiguousarray(near_px),
        np.ascontiguousarray(radius_px),
        plain(patterns),
        (max(noise, MIN_NOISE), walk),
        out,
    )
    return out
