"""Sub-pixel centres of dots, each flattened first, with the covariance that noise gives them.

In a window around each dot the light of the ground is a plane through a ring around the dot, and the
light of the dot a plane through its core; both are fitted to the pixels that agree with each other.
Between them lies the share s of dot in each pixel, and

    w = min(max((s - 0.15) / 0.7, 0), 1),     centre = sum w x / sum w.

So neither uneven light nor uneven ground moves the centre, and noise away from the edge counts for
nothing. The covariance follows by propagation: from the pixels of the edge, from the two planes'
slopes, and from noise that passes the soft threshold; how noise grows with light, and how uneven light
usually is, all dots of the picture tell together.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.detection.measurement.kernels import measure_dots
from manytouch.detection.measurement.sampling_pattern import Plans, plans_of
from manytouch.detection.noise import MIN_NOISE
from manytouch.values import Detections
from manytouch.values.arrays import Covariances2, Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Dots:
    """Dots as the image shows them, one row for each window that was asked for.

    Attributes:
        centre_px: (n, 2) NaN where there is no dot in the window.
        covariance_px2: (n, 2, 2).
        area_px2: (n,) visible area.
        contrast: (n,) dot against its ground in grey levels of 255.
        edge_px: (n,) width of the edge from 15 % to 85 %.
        cut: (n,) share of the dot that lies beyond the image's border, 0 to 1.
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
        """Those to be kept; `corner` is where the image's first pixel lies in the whole image."""
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
) -> Dots:
    """Centres of the dots near given places.

    Args:
        image: (h, w) or (h, w, c), uint8, uint16 or float32.
        weights: (c,) that make grey levels of 255 of a pixel, signed so that dots are light.
        near_px: (n, 2) where to look; a dot within about half a radius is measured as it is.
        radius_px: (n,) radius that is expected there.
        noise: rough standard deviation of a pixel, grey levels of 255, to tell outliers; see `noise_of`.
        walk: number of coarse steps towards the dot before measuring (reach: about one radius).
    """
    out = measured_rows(image, weights, near_px, radius_px, plans_of(radius_px), noise=noise, walk=walk)
    covariance = np.empty((len(out), 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = out[:, 2], out[:, 4]
    covariance[:, 0, 1] = covariance[:, 1, 0] = out[:, 3]
    return Dots(
        centre_px=np.ascontiguousarray(out[:, :2]),
        covariance_px2=covariance,
        area_px2=out[:, 5].copy(),
        contrast=out[:, 6].copy(),
        edge_px=out[:, 7].copy(),
        cut=out[:, 8].copy(),
        is_found=np.isfinite(out[:, 0]),
    )


def measured_rows(
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    near_px: Points2,
    radius_px: Scalars,
    plans: Plans,
    *,
    noise: float,
    walk: int = 0,
) -> Float64[np.ndarray, "n 9"]:
    """As `measure`, with the plans for the radii; rows as `kernels.measure_dots` gives them."""
    out = np.empty((len(near_px), 9))
    measure_dots(
        np.ascontiguousarray(image).reshape(image.shape[0], -1),
        weights.astype(np.float32),
        np.ascontiguousarray(near_px),
        np.ascontiguousarray(radius_px),
        plans.index,
        plans.place,
        plans.mask,
        plans.count,
        max(noise, MIN_NOISE),
        MIN_NOISE,
        walk,
        out,
    )
    return out
