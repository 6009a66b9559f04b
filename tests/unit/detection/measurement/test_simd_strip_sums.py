"""The strip sums in LLVM IR agree with their scalar twin and with plain numpy."""

import numpy as np
import pytest
from jaxtyping import Float32, Shaped, UInt16

from manytouch.compilation import kernel, no_type_check
from manytouch.detection.measurement.simd_strip_sums import STRIP, strip_sums, strip_sums_scalar

PLANES = np.array([70.0, 0.3, -0.2, 0.01, 1e-5, -2e-5, 0.2, -3.0], dtype=np.float32)


@kernel()
@no_type_check
def simd_sums(
    flat: Shaped[np.ndarray, " k"], window: tuple[int, int, int, int], mask: UInt16[np.ndarray, " bits"],
    planes: Float32[np.ndarray, "8"], sums: Float32[np.ndarray, "8"],
) -> None:  # fmt: skip
    first, width, strips, rows = window
    strip_sums(flat, first, width, strips, rows, mask, planes, sums)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize(("strips", "rows"), [(1, 7), (2, 25), (3, 41)])
def test_simd_scalar_and_numpy_sum_the_same(kind: type, strips: int, rows: int) -> None:
    rng, columns = np.random.default_rng(strips), STRIP * strips
    image = rng.integers(0, 256, (rows + 9, columns + 30)).astype(kind)
    is_inside = rng.random((rows, columns)) < 0.8
    bits = is_inside.reshape(rows, strips, STRIP) @ (1 << np.arange(STRIP))
    mask = np.ascontiguousarray(bits.T).astype(np.uint16).ravel()
    window = (4 * image.shape[1] + 11, image.shape[1], strips, rows)
    simd, scalar = np.empty((2, 8), dtype=np.float32)
    simd_sums(image.ravel(), window, mask, PLANES, simd)
    strip_sums_scalar(image.ravel(), *window, mask, PLANES, scalar)
    v, u = np.mgrid[:rows, :columns]
    ground, bright = (PLANES[at] + PLANES[at + 1] * u + PLANES[at + 2] * v for at in (0, 3))
    weight = (image[4 : 4 + rows, 11 : 11 + columns] - ground) * bright - PLANES[6]
    weight = np.clip(weight, 0.0, 1.0) * is_inside
    x, y = u - 3.0, rows - v
    parts = [weight, weight * x, weight * x * x, weight * y, weight * y * x, weight * y * (y + 1) / 2]
    parts.append((weight > 0.0) & (weight < 1.0))
    expected = [part.sum() for part in parts]
    np.testing.assert_allclose(simd[:7], expected, rtol=1e-4, atol=0.05)
    np.testing.assert_allclose(scalar[:7], expected, rtol=1e-4, atol=0.05)
    np.testing.assert_allclose(simd[:7], scalar[:7], rtol=1e-4, atol=0.05)
