"""The reduced image and its difference of Gaussians agree with plain numpy and scipy."""

import numpy as np
import pytest
from scipy.ndimage import correlate1d

from manytouch.detection.dog_response import PADDING, TAPS, DogImages, gaussian_taps, reduce_rows, respond


@pytest.mark.parametrize("factor", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("weights", [np.array([-1.0]), np.array([0.2, -0.5, 0.3])])
def test_reduced_pixels_are_means_of_blocks(factor: int, weights: np.ndarray) -> None:
    height, width, channels = 6, 11, len(weights)
    shape = (height * factor + 1, width * factor, channels)
    image = np.random.default_rng(factor).integers(0, 256, shape).astype(np.uint8)
    rows = image.reshape(shape[0], -1)
    small = np.empty((height, width), dtype=np.float32)
    total = np.empty(width * factor * channels, dtype=np.uint16)
    grey = np.empty(width * factor, dtype=np.float32)
    reduce_rows(rows, weights.astype(np.float32), factor, total, grey, small)
    blocks = (image[:-1] @ weights).reshape(height, factor, width, factor)
    np.testing.assert_allclose(small, blocks.mean(axis=(1, 3)), rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("number", TAPS)
@pytest.mark.parametrize("shape", [(30, 41), (4, 6)])  # also smaller than the taps reach
def test_the_response_is_the_difference_of_two_blurred_images(
    number: tuple[int, int], shape: tuple[int, int]
) -> None:
    height, width = shape
    image = np.random.default_rng(number[0]).uniform(0.0, 255.0, shape)
    images = DogImages(
        small=np.zeros((height + 2 * PADDING, width), dtype=np.float32),
        row=np.empty((2, width + 2 * PADDING), dtype=np.float32),
        smooth=np.empty(shape, dtype=np.float32),
        response=np.full((height + 2, width + 2), -1e9, dtype=np.float32),
    )
    images.small[PADDING:-PADDING] = image
    halves = [gaussian_taps(deviation, taps) for deviation, taps in zip((1.2, 2.4), number, strict=True)]
    respond(images, *halves)
    blurred = []
    for half in halves:
        taps = np.array([*half[:0:-1], *half], dtype=float)
        assert taps.sum() == pytest.approx(1.0, abs=1e-6)
        blurred.append(correlate1d(correlate1d(image, taps, axis=0, mode="reflect"), taps, axis=1))
    np.testing.assert_allclose(images.smooth, blurred[0], atol=1e-3)
    np.testing.assert_allclose(images.response[1:-1, 1:-1], blurred[0] - blurred[1], atol=2e-3)
    rim = np.ones_like(images.response, dtype=bool)
    rim[1:-1, 1:-1] = False
    assert (images.response[rim] == np.float32(-1e9)).all()
