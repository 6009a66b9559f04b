"""The quick way to measure plain dots agrees with the general one, and its pieces with plain numpy."""

from typing import no_type_check

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from manytouch.detection import measure, noise_of
from manytouch.detection.candidates import candidates, workshop
from manytouch.detection.measurement.sampling_pattern import CORE, HALF, LANES, RING, STEP, STRIPS, plans_of
from manytouch.detection.measurement.simd_strip_sums import STRIP, strip_sums
from manytouch.detection.selection import without_doubles
from manytouch.simulation.render.discs import Look, render_discs

WIDTH, HEIGHT = 320, 200


def picture(centre_px: np.ndarray, radius_px: float, look: Look, seed: int = 1) -> np.ndarray:
    shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
    return render_discs(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=seed)


@pytest.mark.parametrize("radius_px", [2.0, 3.5, 4.9, 5.1, 8.0, 13.0])
def test_a_dot_is_measured_alike_near_the_border(radius_px: float) -> None:
    # cut so close that the quick way's ring no longer fits, while all of the dot does
    centre_px = np.array([[160.3, 100.4]])
    image = picture(centre_px, radius_px, Look(ground=45.0, dot=205.0, read_noise=1.0))
    side = int(1.5 * radius_px + 2.0)
    x, y = 160 - side, 100 - side
    near = image[y : y + 2 * side + 1, x : x + 2 * side + 1]
    corner = np.array([x, y], dtype=float)
    radii = np.array([radius_px])
    plain = measure(image, np.ones(1), centre_px, radii, noise=1.0)
    general = measure(near, np.ones(1), centre_px - corner, radii, noise=1.0)
    np.testing.assert_allclose(general.centre_px + corner, plain.centre_px, atol=0.03)
    np.testing.assert_allclose(general.area_px2, plain.area_px2, rtol=0.03)
    np.testing.assert_allclose(general.contrast, plain.contrast, rtol=0.03)
    np.testing.assert_allclose(general.covariance_px2[0, 0, 0], plain.covariance_px2[0, 0, 0], rtol=0.7)


def bound_px(radius_px: float, noise: float) -> float:
    """No unbiased centre is better (C. R. Rao 1945, H. Cramer 1946): from pictures without noise."""
    centre_px = np.array([[x, y] for x in (60.2, 160.4, 260.7) for y in (60.1, 140.6)])
    clear = Look(ground=45.0, dot=205.0)
    half_px = np.array([0.5, 0.0])
    right, left = (picture(centre_px + off, radius_px, clear).astype(float) for off in (half_px, -half_px))
    return noise / float(np.sqrt(np.square(right - left).sum() / len(centre_px)))


@pytest.mark.parametrize("noise", [2.5, 10.0])
@pytest.mark.parametrize(
    ("radius_px", "limits_px"),
    [(2.0, (0.024, 0.062)), (3.0, (0.015, 0.044)), (5.0, (0.012, 0.036)), (8.0, (0.015, 0.036))],
)
def test_error_and_covariance_of_dots(radius_px: float, noise: float, limits_px: tuple[float, float]) -> None:
    x, y = np.meshgrid(np.arange(30.0, 300.0, 33.0), np.arange(30.0, 180.0, 33.0))
    error_px, squared = [], []
    for seed in range(6):
        shift = np.random.default_rng(seed).uniform(-0.5, 0.5, (x.size, 2))
        centre_px = np.stack([x.ravel(), y.ravel()], axis=1) + shift
        image = picture(centre_px, radius_px, Look(ground=45.0, dot=205.0, read_noise=noise), seed + 3)
        dots = measure(image, np.ones(1), np.rint(centre_px), np.full(x.size, radius_px), noise=noise)
        error_px.append(dots.centre_px - centre_px)
        inverse = np.linalg.inv(dots.covariance_px2)
        squared.append(np.einsum("ni,nij,nj->n", error_px[-1], inverse, error_px[-1]))
    rms_px = np.sqrt(np.mean(np.square(error_px)))
    assert rms_px < limits_px[noise > 5.0]
    assert np.mean(squared) / 2.0 == pytest.approx(1.0, abs=0.3)
    # much noise leaves little to be gained; with little noise it is the pixels' grid that limits
    assert bound_px(radius_px, noise) < rms_px < (1.55 if noise > 5.0 else 2.4) * bound_px(radius_px, noise)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    radius_px=st.floats(1.0, 30.0),
    bits=st.sampled_from([8, 16]),
    colours=st.sampled_from([1, 3]),
)
def test_any_place_of_any_picture_can_be_looked_at(
    seed: int, radius_px: float, bits: int, colours: int
) -> None:
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(8, 90)), int(rng.integers(8, 70)))
    full = shape if colours == 1 else (*shape, colours)
    image = rng.integers(0, 2**bits, full).astype(np.uint8 if bits == 8 else np.uint16)
    near_px = rng.uniform(-3.0, 3.0 + np.array(shape[::-1]), (30, 2))
    weights = rng.normal(size=colours) * 255.0 / 2**bits
    dots = measure(image, weights, near_px, np.full(30, radius_px), noise=2.0, walk=3)
    found = dots.is_found
    assert np.isfinite(dots.covariance_px2[found]).all()
    assert (np.linalg.eigvalsh(dots.covariance_px2[found]) > 0.0).all()


def test_plans_look_where_they_say() -> None:
    radius_px = np.array([8.0, 2.0, 7.95])
    plans = plans_of(radius_px)
    assert plans.index[0] == plans.index[2] != plans.index[1]
    for radius, row in zip(radius_px, plans.index, strict=True):
        place, count = plans.place[row], plans.count[row]
        ring = np.hypot(*place[:, RING * LANES : RING * LANES + count[RING]])
        assert (ring > radius + 0.5).all()
        core = np.hypot(*place[:, CORE * LANES : CORE * LANES + count[CORE]])
        assert (core < max(0.75 * radius, 1.9)).all()
        half, strips = count[HALF], count[STRIPS]
        rows = plans.mask[row][: strips * (2 * half + 1)].reshape(strips, 2 * half + 1).T
        counts = np.hstack([rows[:, [s]] >> np.arange(STRIP) & 1 for s in range(strips)])[:, : 2 * half + 1]
        u, v = np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1))
        np.testing.assert_array_equal(counts, np.hypot(u, v) <= 1.35 * plans_radius(radius) + 1.5)
        assert counts.sum() == sum(int(bits).bit_count() for bits in plans.mask[row])


def plans_radius(radius_px: float) -> float:
    return STEP ** np.rint(np.log(radius_px) / np.log(STEP))


@njit
@no_type_check
def summed(flat, window, mask, planes, sums):
    first, width, strips, rows = window
    strip_sums(flat, first, width, strips, rows, mask, planes, sums)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize(("strips", "rows"), [(1, 7), (2, 25), (3, 41)])
def test_strips_sum_what_plain_numpy_sums(kind: type, strips: int, rows: int) -> None:
    rng, columns = np.random.default_rng(strips), STRIP * strips
    image = rng.integers(0, 256, (rows + 9, columns + 30)).astype(kind)
    is_inside = rng.random((rows, columns)) < 0.8
    bits = is_inside.reshape(rows, strips, STRIP) @ (1 << np.arange(STRIP))
    planes = np.array([70.0, 0.3, -0.2, 0.01, 1e-5, -2e-5, 0.2, -3.0], dtype=np.float32)
    sums = np.empty(8, dtype=np.float32)
    mask = np.ascontiguousarray(bits.T).astype(np.uint16).ravel()
    window = (4 * image.shape[1] + 11, image.shape[1], strips, rows)
    summed(image.ravel(), window, mask, planes, sums)
    v, u = np.mgrid[:rows, :columns]
    ground, bright = (planes[at] + planes[at + 1] * u + planes[at + 2] * v for at in (0, 3))
    weight = (image[4 : 4 + rows, 11 : 11 + columns] - ground) * bright - planes[6]
    weight = np.clip(weight, 0.0, 1.0) * is_inside
    x, y = u - 3.0, rows - v
    expected = [weight, weight * x, weight * x * x, weight * y, weight * y * x, weight * y * (y + 1) / 2]
    expected.append((weight > 0.0) & (weight < 1.0))
    np.testing.assert_allclose(sums[:7], [each.sum() for each in expected], rtol=1e-4, atol=0.05)


@pytest.mark.parametrize("colours", [1, 3])
@pytest.mark.parametrize("radius_px", [2.5, 5.0, 7.0, 8.0, 11.0])
def test_candidates_are_peaks_of_a_difference_of_gaussians(radius_px: float, colours: int) -> None:
    x, y = np.meshgrid(np.arange(40.0, 300.0, 52.0), np.arange(40.0, 180.0, 52.0))
    centre_px = np.stack([x.ravel(), y.ravel()], axis=1) + 0.3
    image = picture(centre_px, radius_px, Look(ground=45.0, dot=205.0, read_noise=2.0))
    given = image if colours == 1 else np.repeat(image[:, :, None], 3, axis=2)
    weights = np.ones(1) if colours == 1 else np.array([0.2, 0.5, 0.3])
    kept = workshop(given, radius_px)
    for _ in range(2):  # the second time with used memory
        found = candidates(given, weights, radius_px, 30.0, kept)
        distance = np.linalg.norm(found.place_px[:, None] - centre_px[None], axis=2)
        assert len(found.place_px) == len(centre_px)
        assert distance.min(axis=0).max() < 0.35 * radius_px
    factor = kept.factor
    height, width = HEIGHT // factor, WIDTH // factor
    small = image[: height * factor, : width * factor].reshape(height, factor, width, factor)
    small = small.mean(axis=(1, 3)).astype(np.float32)
    own = radius_px / factor
    blurred = [
        cv2.GaussianBlur(small, (0, 0), share * own, borderType=cv2.BORDER_REFLECT) for share in (0.5, 1)
    ]
    np.testing.assert_allclose(kept.answer[1:-1, 1:-1], blurred[0] - blurred[1], atol=0.8)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), number=st.integers(0, 60))
def test_of_near_dots_the_heaviest_stays(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    place, radius = rng.uniform(0.0, 40.0, (number, 2)), rng.uniform(1.0, 6.0, number)
    weight = rng.integers(1, 5, number).astype(float)
    keep = without_doubles(place, radius, weight, 0.8)
    distance = np.linalg.norm(place[:, None] - place[None], axis=2)
    near = distance < 0.8 * np.maximum(radius[:, None], radius[None])
    index = np.arange(number)
    heavier = (weight[:, None] > weight[None]) | (
        (weight[:, None] == weight[None]) & (index[:, None] < index[None])
    )
    np.testing.assert_array_equal(keep, ~(near & heavier).any(axis=0))


@pytest.mark.parametrize("shape", [(400, 640), (1440, 2560), (300, 500, 3)])
def test_noise_of_wide_and_narrow_pictures(shape: tuple[int, ...]) -> None:
    image = np.clip(np.rint(np.random.default_rng(0).normal(100.0, 4.0, shape)), 0, 255).astype(np.uint8)
    weights = np.ones(1) if len(shape) == 2 else np.array([0.2, 0.5, 0.3])
    assert noise_of(image, weights) == pytest.approx(4.0 * np.linalg.norm(weights), rel=0.08)
