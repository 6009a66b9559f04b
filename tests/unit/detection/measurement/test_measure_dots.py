"""Measured dots: the plain and the general way agree, and errors are near the theoretical bound."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from manytouch.detection import measure
from manytouch.detection.measurement.sampling_pattern import ring_radii
from manytouch.simulation.render.discs import Look, render_discs

WIDTH, HEIGHT = 320, 200


def render(centre_px: np.ndarray, radius_px: float, look: Look, seed: int = 1) -> np.ndarray:
    shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
    return render_discs(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=seed)


@pytest.mark.parametrize("radius_px", [2.0, 3.5, 4.9, 5.1, 8.0, 13.0])
def test_the_general_and_the_plain_way_agree(radius_px: float) -> None:
    # cropped so that the sampling pattern no longer fits, while all of the dot does
    centre_px = np.array([[160.3, 100.4]])
    image = render(centre_px, radius_px, Look(ground=45.0, dot=205.0, read_noise=1.0))
    side = int(ring_radii(radius_px)[1])
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
    """Lowest error of an unbiased centre (C. R. Rao 1945, H. Cramer 1946), from images without noise."""
    centre_px = np.array([[x, y] for x in (60.2, 160.4, 260.7) for y in (60.1, 140.6)])
    clear = Look(ground=45.0, dot=205.0)
    half_px = np.array([0.5, 0.0])
    right, left = (render(centre_px + off, radius_px, clear).astype(float) for off in (half_px, -half_px))
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
        image = render(centre_px, radius_px, Look(ground=45.0, dot=205.0, read_noise=noise), seed + 3)
        dots = measure(image, np.ones(1), np.rint(centre_px), np.full(x.size, radius_px), noise=noise)
        error_px.append(dots.centre_px - centre_px)
        inverse = np.linalg.inv(dots.covariance_px2)
        squared.append(np.einsum("ni,nij,nj->n", error_px[-1], inverse, error_px[-1]))
    rms_px = np.sqrt(np.mean(np.square(error_px)))
    assert rms_px < limits_px[noise > 5.0]
    assert np.mean(squared) / 2.0 == pytest.approx(1.0, abs=0.3)
    # much noise leaves little to be gained; with little noise the grid of the pixels is the limit
    assert bound_px(radius_px, noise) < rms_px < (1.55 if noise > 5.0 else 2.4) * bound_px(radius_px, noise)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    radius_px=st.floats(1.0, 30.0),
    bits=st.sampled_from([8, 16]),
    colours=st.sampled_from([1, 3]),
)
def test_any_position_of_any_image_can_be_measured(
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
