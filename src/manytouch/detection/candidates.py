"""Positions where dots of a known size may be: peaks of a difference of Gaussians in a reduced image."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Shaped, UInt8

from manytouch.compilation import f32
from manytouch.detection.dog_peaks import BACKGROUND_RADII, Enclosure, find_peaks
from manytouch.detection.dog_response import PADDING, TAPS, DogImages, gaussian_taps, reduce_rows, respond
from manytouch.values.arrays import Points2, Scalars

REDUCED_RADIUS_PX = 2.0  # or more, up to half as much again
INNER, OUTER = 0.5, 1.0  # deviations of the two Gaussians over the radius of the dot
# response at the centre of a disc of contrast 1: exp(-r^2 / 2 outer^2) - exp(-r^2 / 2 inner^2)
DISC_RESPONSE = math.exp(-0.5 / OUTER**2) - math.exp(-0.5 / INNER**2)
ENOUGH_DEVIATIONS = 3.0  # of a Gaussian, to be summed on each side
DIRECTIONS = 16
MOST_SHORT = 257  # rows of 8 bits whose sum fits into 16 bits
LOWEST = np.float32(-1e9)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Candidates:
    """Positions that may be dots.

    Attributes:
        place_px: (n, 2) in the whole image, precise to about a third of the radius.
        radius_px: (n,) the radius that was searched for.
        contrast: (n,) approximate, grey levels of 255.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars

    def at(self, chosen: np.ndarray) -> "Candidates":
        """Some of them, by mask or index."""
        return Candidates(
            place_px=self.place_px[chosen], radius_px=self.radius_px[chosen], contrast=self.contrast[chosen]
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class DogBuffers:
    """Memory for one size of image and of dots, reused for every frame.

    Attributes:
        shape, dtype: of the images.
        factor: by which they are reduced.
        narrow, wide: halves of the two Gaussians.
        enclosure: pixels around a peak that must be darker.
        total, grey, mark: scratch rows.
        images: reduced image and response.
        found: (k, 3) peaks.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    factor: int
    narrow: tuple[np.float32, ...]
    wide: tuple[np.float32, ...]
    enclosure: Enclosure
    total: Shaped[np.ndarray, " t"]
    grey: Float32[np.ndarray, " g"]
    mark: UInt8[np.ndarray, " m"]
    images: DogImages
    found: Float32[np.ndarray, "n 3"]


def allocate_dog_buffers(image: np.ndarray, radius_px: float) -> DogBuffers:
    """Memory to search images like this one for dots of a radius."""
    factor = max(1, int(radius_px / REDUCED_RADIUS_PX))
    height, width = image.shape[0] // factor, image.shape[1] // factor
    channels = 1 if image.ndim == 2 else image.shape[2]
    reduced_px = radius_px / factor
    few, many = TAPS
    inner, outer = few if few[1] >= ENOUGH_DEVIATIONS * OUTER * reduced_px else many
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    reach = reduced_px * np.array(BACKGROUND_RADII)
    offset = np.rint(reach[None, :, None] * np.stack([np.sin(angle), np.cos(angle)], axis=1)[:, None])
    is_short = image.dtype == np.uint8 and factor <= MOST_SHORT
    return DogBuffers(
        shape=image.shape,
        dtype=image.dtype,
        factor=factor,
        narrow=gaussian_taps(INNER * reduced_px, inner),
        wide=gaussian_taps(OUTER * reduced_px, outer),
        enclosure=Enclosure(offset.astype(np.int64)),
        total=np.empty(width * factor * channels, dtype=np.uint16 if is_short else np.float32),
        grey=np.empty(width * factor, dtype=np.float32),
        mark=np.empty(8 * (width // 8 + 1), dtype=np.uint8),
        images=DogImages(
            small=np.empty((height + 2 * PADDING, width), dtype=np.float32),
            row=np.empty((2, width + 2 * PADDING), dtype=np.float32),
            smooth=np.empty((height, width), dtype=np.float32),
            response=np.full((height + 2, width + 2), LOWEST, dtype=np.float32),
        ),
        found=np.empty((height * width // 4 + 16, 3), dtype=np.float32),
    )


def find_candidates(
    image: np.ndarray,
    weights: Float64[np.ndarray, " c"],
    radius_px: float,
    least: float,
    buffers: DogBuffers | None = None,
) -> Candidates:
    """Finds bright spots of about a radius that are enclosed by background.

    Args:
        image: (h, w) or (h, w, c).
        weights: (c,) of the channels, for grey levels of 255, signed so that dots are light.
        radius_px: of the dots.
        least: lowest contrast, grey levels of 255.
        buffers: of `allocate_dog_buffers` for images like this one and this radius; None allocates them.
    """
    own = buffers if buffers is not None else allocate_dog_buffers(image, radius_px)
    images = own.images
    small = images.small[PADDING : PADDING + images.smooth.shape[0]]
    rows = np.ascontiguousarray(image).reshape(image.shape[0], -1)
    reduce_rows(rows, weights.astype(np.float32), own.factor, own.total, own.grey, small)
    respond(images, own.narrow, own.wide)
    lowest = f32(least * DISC_RESPONSE)
    count = find_peaks(images.smooth, images.response, lowest, own.enclosure, own.mark, own.found)
    peaks = own.found[:count].astype(np.float64)
    return Candidates(
        place_px=(peaks[:, :2] + 0.5) * own.factor - 0.5,
        radius_px=np.full(count, float(radius_px)),
        contrast=peaks[:, 2] / DISC_RESPONSE,
    )
