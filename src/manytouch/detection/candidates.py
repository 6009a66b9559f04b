"""Where dots of a known size may be: peaks of a difference of Gaussians in a reduced image."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.detection import dog_response as response
from manytouch.values.arrays import Points2, Scalars

REDUCED_RADIUS_PX = 2.0  # or more, up to half as much again
INNER, OUTER = 0.5, 1.0  # the two Gaussians' deviations against the dot's radius
# answer at the centre of a disc of contrast 1: exp(-r^2 / 2 outer^2) - exp(-r^2 / 2 inner^2)
DISC_ANSWER = math.exp(-0.5 / OUTER**2) - math.exp(-0.5 / INNER**2)
ENOUGH_DEVIATIONS = 3.0  # of a Gaussian, to be summed on each side
DIRECTIONS = 16
MOST_SHORT = 257  # rows of 8 bits that 16 bits hold the sum of


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Candidates:
    """Places that look like dots.

    Attributes:
        place_px: (n, 2) in the whole image, good to about a third of the radius.
        radius_px: (n,) the radius that was searched for.
        contrast: (n,) roughly, grey levels of 255.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars

    def at(self, chosen: np.ndarray) -> "Candidates":
        """Some of them."""
        return Candidates(
            place_px=self.place_px[chosen], radius_px=self.radius_px[chosen], contrast=self.contrast[chosen]
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DogBuffers:
    """Scratch memory for one size of image and of dots, kept from frame to frame.

    Attributes:
        shape, dtype: of the images.
        factor: by which they are reduced.
        narrow, wide: halves of the two Gaussians.
        offset: (DIRECTIONS, 3, 2) where around a peak to look whether the ground encloses it, y and x.
        total, grey, row, mark: rows.
        small, smooth, answer: reduced images, padded as `response` says.
        found: (k, 3) peaks.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    factor: int
    narrow: tuple[np.float32, ...]
    wide: tuple[np.float32, ...]
    offset: np.ndarray
    total: np.ndarray
    grey: np.ndarray
    row: np.ndarray
    mark: np.ndarray
    small: np.ndarray
    smooth: np.ndarray
    answer: np.ndarray
    found: np.ndarray


def workshop(image: np.ndarray, radius_px: float) -> DogBuffers:
    """Memory to search images like this one for dots of a radius."""
    factor = max(1, int(radius_px / REDUCED_RADIUS_PX))
    height, width = image.shape[0] // factor, image.shape[1] // factor
    channels = 1 if image.ndim == 2 else image.shape[2]
    own = radius_px / factor
    few, many = response.TAPS
    inner, outer = few if few[1] >= ENOUGH_DEVIATIONS * OUTER * own else many
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    reach = own * np.array(response.AROUND)
    offset = np.rint(reach[None, :, None] * np.stack([np.sin(angle), np.cos(angle)], axis=1)[:, None])
    short = image.dtype == np.uint8 and factor <= MOST_SHORT
    return DogBuffers(
        shape=image.shape,
        dtype=image.dtype,
        factor=factor,
        narrow=response.taps(INNER * own, inner),
        wide=response.taps(OUTER * own, outer),
        offset=offset.astype(np.int64),
        total=np.empty(width * factor * channels, dtype=np.uint16 if short else np.float32),
        grey=np.empty(width * factor, dtype=np.float32),
        row=np.empty((2, width + 2 * response.WIDE), dtype=np.float32),
        mark=np.empty(8 * (width // 8 + 1), dtype=np.uint8),
        small=np.empty((height + 2 * response.WIDE, width), dtype=np.float32),
        smooth=np.empty((height, width), dtype=np.float32),
        answer=np.full((height + 2, width + 2), response.LOWEST, dtype=np.float32),
        found=np.empty((height * width // 4 + 16, 3), dtype=np.float32),
    )


def candidates(
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    radius_px: float,
    least: float,
    kept: DogBuffers | None = None,
) -> Candidates:
    """Peaks of at least the contrast `least` (grey levels of 255) that the ground encloses.

    `kept` is memory of `workshop` for images like this one and this radius.
    """
    own = kept if kept is not None else workshop(image, radius_px)
    height = own.smooth.shape[0]
    rows = np.ascontiguousarray(image).reshape(image.shape[0], -1)
    response.reduce_rows(
        rows,
        weights.astype(np.float32),
        own.factor,
        own.total,
        own.grey,
        own.small[response.WIDE : response.WIDE + height],
    )
    response.respond(own.small, own.narrow, own.wide, own.row, own.smooth, own.answer)
    count = response.peaks(
        own.smooth, own.answer, np.float32(least * DISC_ANSWER), own.offset, own.mark, own.found
    )
    peaks = own.found[:count].astype(np.float64)
    return Candidates(
        place_px=(peaks[:, :2] + 0.5) * own.factor - 0.5,
        radius_px=np.full(count, float(radius_px)),
        contrast=peaks[:, 2] / DISC_ANSWER,
    )
