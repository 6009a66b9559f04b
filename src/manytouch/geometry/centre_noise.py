"""Noise of measured centres while nothing moves, as calibration, `doctor` and summaries define it."""

import numpy as np
from jaxtyping import Float64

from manytouch.values.arrays import Scalars

BLOCK_FRAMES = 15
LEAST_FRAMES = 3
_MAD_TO_STD = 1.4826


def centre_noise_px(position_px: Float64[np.ndarray, "frames n 2"]) -> Scalars:
    """Robust standard deviation (n,) of centres in one direction, in px.

    In each block of `BLOCK_FRAMES` successive frames it is the median absolute deviation from the median of
    the block, scaled to a standard deviation; of the blocks, the median. So neither creep of the sheet,
    which is slow, nor a touch in less than half of the blocks is part of it.

    Args:
        position_px: (frames, n, 2) measured centres; NaN where not seen.

    Returns:
        (n,); NaN where no block has `LEAST_FRAMES` measurements.
    """
    starts = range(0, max(len(position_px), 1), BLOCK_FRAMES)
    return median_of_blocks(
        np.stack([block_noise_px(position_px[start : start + BLOCK_FRAMES]) for start in starts])
    )


def block_noise_px(position_px: Float64[np.ndarray, "frames n 2"]) -> Scalars:
    """`centre_noise_px` of one block (frames, n, 2)."""
    noise = np.full(position_px.shape[1], np.nan)
    enough = np.isfinite(position_px[..., 0]).sum(axis=0) >= LEAST_FRAMES
    if enough.any():
        kept = position_px[:, enough]
        spread = np.nanmedian(np.abs(kept - np.nanmedian(kept, axis=0)), axis=0)
        noise[enough] = _MAD_TO_STD * np.sqrt((spread**2).mean(axis=1))
    return noise


def median_of_blocks(noise_px: Float64[np.ndarray, "blocks n"]) -> Scalars:
    """Median (n,) over the blocks (blocks, n) in which the noise is known; NaN where it is in none."""
    middle = np.full(noise_px.shape[1], np.nan)
    known = np.isfinite(noise_px).any(axis=0)
    if known.any():
        middle[known] = np.nanmedian(noise_px[:, known], axis=0)
    return middle
