"""Centres of rendered dots: unbiased, with the expected error and a covariance that agrees with it."""

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from manytouch.detection import estimate_noise, measure
from manytouch.simulation.render.discs import (
    DARK_DOTS,
    LIGHT_DOTS,
    Look,
    Spot,
    disc_coverage,
    render_discs,
)

WIDTH, HEIGHT = 640, 400


def dots_at(pitch_px: float, seed: int = 0) -> np.ndarray:
    """A lattice at random parts of pixels, away from the border."""
    x, y = np.meshgrid(np.arange(50, WIDTH - 50, pitch_px), np.arange(50, HEIGHT - 50, pitch_px))
    centre_px = np.stack([x.ravel(), y.ravel()], axis=1)
    return centre_px + np.random.default_rng(seed).uniform(-0.5, 0.5, centre_px.shape)


def render(centre_px: np.ndarray, radius_px: float, look: Look, seed: int = 1, **given: object) -> np.ndarray:
    shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
    return render_discs(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=seed, **given)


def measured(image: np.ndarray, centre_px: np.ndarray, radius_px: float, sign: float = 1.0, off: float = 0.3):
    weights = np.array([sign])
    near_px = centre_px + np.random.default_rng(9).uniform(-off, off, centre_px.shape)
    return measure(
        image, weights, near_px, np.full(len(centre_px), radius_px), noise=estimate_noise(image, weights)
    )


@pytest.mark.parametrize(("noise", "limit_px"), [(2.5, 0.03), (10.0, 0.06)])
def test_error_at_noise(noise: float, limit_px: float) -> None:
    centre_px = dots_at(45.0)
    image = render(centre_px, 10.0, Look(ground=45.0, dot=195.0, read_noise=noise))
    error_px = measured(image, centre_px, 10.0).centre_px - centre_px
    assert np.sqrt((error_px**2).mean()) < limit_px


@pytest.mark.parametrize("radius_px", [2.0, 4.0, 8.0, 20.0])
@pytest.mark.parametrize(("look", "sign"), [(LIGHT_DOTS, 1.0), (DARK_DOTS, -1.0)])
def test_no_bias_without_noise(radius_px: float, look: Look, sign: float) -> None:
    centre_px = dots_at(6.0 * radius_px if radius_px < 10 else 70.0)
    dots = measured(render(centre_px, radius_px, look), centre_px, radius_px, sign)
    error_px = dots.centre_px - centre_px
    assert np.abs(error_px.mean(axis=0)).max() < 0.01
    assert np.sqrt((error_px**2).mean()) < 0.02
    assert np.median(dots.area_px2) == pytest.approx(np.pi * radius_px**2, rel=0.05)
    assert np.median(dots.contrast) == pytest.approx(abs(look.dot - look.ground), rel=0.15)


@pytest.mark.parametrize(
    ("radius_px", "limit_px"),
    [(1.8, 0.008), (2.4, 0.006), (3.0, 0.006), (4.0, 0.004), (5.0, 0.003), (6.0, 0.003), (8.0, 0.003)],
)
def test_the_error_hardly_depends_on_the_place_within_a_pixel(radius_px: float, limit_px: float) -> None:
    """On a regular print such errors repeat every few markers, and look like a load."""
    centre_px = dots_at(6.0 * radius_px)
    error_px = measured(render(centre_px, radius_px, LIGHT_DOTS), centre_px, radius_px).centre_px - centre_px
    assert np.sqrt((error_px**2).mean()) < limit_px


@pytest.mark.parametrize(
    ("radius_px", "blur_px", "limit_px"),
    [(2.0, 1.2, 0.014), (3.0, 1.2, 0.01), (4.0, 1.2, 0.006), (5.0, 1.6, 0.01), (8.0, 1.6, 0.015)],
)
def test_nor_does_it_where_the_dots_are_blurred(radius_px: float, blur_px: float, limit_px: float) -> None:
    centre_px = dots_at(6.0 * radius_px)
    image = render(centre_px, radius_px, LIGHT_DOTS, blur_px=blur_px)
    error_px = measured(image, centre_px, radius_px).centre_px - centre_px
    assert np.sqrt(((error_px - error_px.mean(axis=0)) ** 2).mean()) < limit_px


@pytest.mark.parametrize("blur_px", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("radius_px", [4.0, 5.0, 8.0])
def test_the_width_of_an_edge_is_that_of_the_point_spread(radius_px: float, blur_px: float) -> None:
    centre_px = dots_at(8.0 * radius_px)
    dots = measured(render(centre_px, radius_px, LIGHT_DOTS, blur_px=blur_px), centre_px, radius_px)
    from_15_to_85 = 2.0 * ndtri(0.85) * blur_px
    assert np.median(dots.edge_px) == pytest.approx(from_15_to_85, rel=0.15)


@pytest.mark.parametrize("radius_px", [4.0, 10.0])
def test_linear_light_does_not_move_the_centre(radius_px: float) -> None:
    centre_px = dots_at(45.0)
    dots = measured(render(centre_px, radius_px, Look(tilt_x=0.6, tilt_y=0.3)), centre_px, radius_px)
    assert np.abs((dots.centre_px - centre_px).mean(axis=0)).max() < 0.01


@pytest.mark.parametrize("radius_px", [3.0, 6.0, 10.0])
@pytest.mark.parametrize("noise", [2.5, 6.0])
def test_covariance_agrees_with_the_error(radius_px: float, noise: float) -> None:
    squared = []
    for seed in range(3):
        centre_px = dots_at(max(5.0 * radius_px, 24.0), seed)
        dots = measured(render(centre_px, radius_px, Look(read_noise=noise), seed + 5), centre_px, radius_px)
        error_px = dots.centre_px - centre_px
        squared.append(np.einsum("ni,nij,nj->n", error_px, np.linalg.inv(dots.covariance_px2), error_px))
    assert np.concatenate(squared).mean() / 2.0 == pytest.approx(1.0, abs=0.27)


@pytest.mark.parametrize("radius_px", [3.5, 5.0, 8.5])
@pytest.mark.parametrize(("ground", "dot", "sign"), [(30.0, 190.0, 1.0), (190.0, 30.0, -1.0)])
def test_covariance_agrees_where_noise_grows_with_light(
    radius_px: float, ground: float, dot: float, sign: float
) -> None:
    look = Look(ground=ground, dot=dot, read_noise=1.5, shot_noise=4.0 / 60.0)
    squared = []
    for seed in range(3):
        centre_px = dots_at(max(5.0 * radius_px, 24.0), seed)
        dots = measured(render(centre_px, radius_px, look, seed + 5), centre_px, radius_px, sign)
        error_px = dots.centre_px - centre_px
        squared.append(np.einsum("ni,nij,nj->n", error_px, np.linalg.inv(dots.covariance_px2), error_px))
    assert 0.75 < np.concatenate(squared).mean() / 2.0 < 1.3


@pytest.mark.parametrize(("columns", "rows", "pitch_px"), [(6, 4, 90.0), (12, 9, 40.0)])
@pytest.mark.parametrize("radius_px", [4.0, 5.8, 8.0])
def test_dots_of_varying_contrast_do_not_look_like_slopes_of_the_light(
    radius_px: float, columns: int, rows: int, pitch_px: float
) -> None:
    errors_px, squared = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x, y = np.meshgrid(np.arange(columns) * pitch_px, np.arange(rows) * pitch_px)
        centre_px = np.stack([x.ravel() + 80.0, y.ravel() + 45.0], axis=1)
        centre_px += rng.uniform(-0.5, 0.5, (x.size, 2))
        look = Look(ground=150.0, dot=60.0, read_noise=0.5, vignetting=0.3, tilt_x=0.2)
        contrast = np.clip(rng.normal(1.0, 0.25, len(centre_px)), 0.3, 1.6)
        dots = measured(
            render(centre_px, radius_px, look, seed, contrast=contrast), centre_px, radius_px, -1.0
        )
        error_px = dots.centre_px - centre_px
        errors_px.append(error_px)
        squared.append(np.einsum("ni,nij,nj->n", error_px, np.linalg.inv(dots.covariance_px2), error_px))
    assert np.sqrt(np.square(errors_px).mean()) < 0.0105
    assert np.mean(squared) / 2.0 < 1.6


def test_noise_of_a_clipped_core_does_not_count() -> None:
    centre_px = dots_at(45.0)
    image = render(centre_px, 8.0, Look(ground=60.0, dot=300.0, read_noise=6.0))
    assert (
        image[np.rint(centre_px[:, 1]).astype(int), np.rint(centre_px[:, 0]).astype(int)] == 255
    ).mean() > 0.9
    dots = measured(image, centre_px, 8.0)
    error_px = dots.centre_px - centre_px
    squared = np.einsum("ni,nij,nj->n", error_px, np.linalg.inv(dots.covariance_px2), error_px)
    assert 0.7 < squared.mean() / 2.0 < 1.4


def test_even_light_is_estimated_from_all_dots_and_steep_light_from_one() -> None:
    radius_px, centre_px = 9.0, dots_at(45.0)
    image = render(centre_px, radius_px, Look(read_noise=2.5))
    assert np.sqrt(np.square(measured(image, centre_px, radius_px).centre_px - centre_px).mean()) < 0.0088
    spot = Spot(centre_px=(200.0, 190.0), radius_px=70.0, amount=0.6)
    lit = render(centre_px, radius_px, Look(shadows=(spot,)))
    away_px = centre_px - np.array(spot.centre_px)
    distance_px = np.linalg.norm(away_px, axis=1)
    on_flank = (distance_px > 45.0) & (distance_px < 105.0)
    error_px = measured(lit, centre_px, radius_px).centre_px - centre_px
    inward = np.einsum("ni,ni->n", error_px, away_px) / distance_px
    assert on_flank.sum() > 10
    assert abs(inward[on_flank].mean()) < 0.012


def test_a_glint_inside_belongs_to_the_dot() -> None:
    centre_px = dots_at(45.0)
    image = render(centre_px, 9.0, DARK_DOTS).astype(int)
    glint = render(centre_px + np.array([2.0, -1.5]), 3.0, Look(ground=0.0, dot=120.0)).astype(int)
    dots = measured(np.clip(image + glint, 0, 255).astype(np.uint8), centre_px, 9.0, -1.0)
    assert np.abs(dots.centre_px - centre_px).max() < 0.1
    assert np.median(dots.area_px2) == pytest.approx(np.pi * 81.0, rel=0.05)


def test_walk_reaches_a_dot_most_of_its_radius_away() -> None:
    centre_px = dots_at(45.0)
    image = render(centre_px, 8.0, Look(read_noise=2.0))
    found = measure(
        image, np.ones(1), centre_px + np.array([5.0, -4.0]), np.full(len(centre_px), 8.0), noise=2.0, walk=3
    )
    assert np.abs(found.centre_px - centre_px).max() < 0.1


def test_a_dot_cut_by_the_border_is_less_certain() -> None:
    centre_px = np.array([[100.0, 100.0], [1.0, 200.0], [300.0, HEIGHT - 1.0]])
    dots = measured(render(centre_px, 9.0, LIGHT_DOTS), centre_px, 9.0, off=0.0)
    assert dots.cut[0] == 0.0
    assert (dots.cut[1:] > 0.2).all()
    error_px = np.linalg.norm(dots.centre_px - centre_px, axis=1)
    deviation_px = np.sqrt(np.trace(dots.covariance_px2, axis1=1, axis2=2))
    assert (error_px[1:] < 2.0 * deviation_px[1:]).all()
    assert (deviation_px[1:] > 10.0 * deviation_px[0]).all()


def test_an_even_image_has_no_dots() -> None:
    image = np.full((HEIGHT, WIDTH), 60, dtype=np.uint8)
    dots = measure(
        image, np.ones(1), np.array([[50.0, 60.0], [np.nan, 3.0], [-9.0, 5.0]]), np.full(3, 6.0), noise=1.0
    )
    assert not dots.is_found.any()
    assert np.isnan(dots.centre_px).all()


def test_colour_and_16_bit_give_the_centre_of_grey() -> None:
    centre_px = dots_at(45.0)
    grey = render(centre_px, 8.0, LIGHT_DOTS)
    radius_px = np.full(len(centre_px), 8.0)
    plain = measure(grey, np.ones(1), centre_px, radius_px, noise=1.0)
    colour = measure(
        np.repeat(grey[:, :, None], 3, axis=2), np.array([0.2, 0.5, 0.3]), centre_px, radius_px, noise=1.0
    )
    fine = measure(grey.astype(np.uint16) * 257, np.array([1 / 257]), centre_px, radius_px, noise=1.0)
    np.testing.assert_allclose(colour.centre_px, plain.centre_px, atol=1e-4)
    np.testing.assert_allclose(fine.centre_px, plain.centre_px, atol=1e-4)


def errors_next_to_steps(radius_px: float, sign: float, heights: tuple[float, float]):
    """Errors (n, 2) of dots, a third of them next to a step; their normalised squares; which these are.

    The height of a step is in contrasts of a dot; its distance from the centre of a dot is random, from 4 px
    and from 2.5 px outside the dot on.
    """
    error_px, squares, is_next, pitch = [], [], [], 60
    x, y = np.meshgrid(np.arange(40, WIDTH - 30, pitch), np.arange(40, HEIGHT - 30, pitch))
    middle_px, half = np.stack([x.ravel(), y.ravel()], axis=1), pitch // 2
    for seed in range(6):
        rng = np.random.default_rng(seed)
        centre_px = middle_px + rng.uniform(-0.5, 0.5, middle_px.shape)
        shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
        level = disc_coverage(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT).astype(float)
        chosen = rng.uniform(size=len(centre_px)) < 1.0 / 3.0
        for number in np.flatnonzero(chosen):
            angle, away_px = rng.uniform(0.0, 2.0 * np.pi), max(4.0, radius_px + 2.5)
            away_px += rng.uniform(0.0, 4.0)
            left, top = middle_px[number] - half
            v, u = np.mgrid[top : top + pitch, left : left + pitch]
            along_px = np.cos(angle) * (u - centre_px[number, 0]) + np.sin(angle) * (v - centre_px[number, 1])
            step = rng.uniform(*heights) * rng.choice([-1.0, 1.0]) * ndtr((along_px - away_px) / 0.8)
            level[top : top + pitch, left : left + pitch] += step
        grey = 128.0 + sign * 80.0 * (level - 0.5) + rng.normal(0.0, 2.0, level.shape)
        image, weights = np.clip(np.rint(grey), 0, 255).astype(np.uint8), np.array([sign])
        near_px = centre_px + rng.uniform(-0.3, 0.3, centre_px.shape)
        dots = measure(
            image, weights, near_px, np.full(len(near_px), radius_px), noise=estimate_noise(image, weights)
        )
        assert dots.is_found.all()
        off_px = dots.centre_px - centre_px
        error_px.append(off_px)
        squares.append(0.5 * np.einsum("ni,nij,nj->n", off_px, np.linalg.inv(dots.covariance_px2), off_px))
        is_next.append(chosen)
    return np.concatenate(error_px), np.concatenate(squares), np.concatenate(is_next)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("radius_px", [1.8, 2.4, 3.0, 4.0, 6.0])
def test_a_step_next_to_a_dot_hardly_moves_its_centre(radius_px: float, sign: float) -> None:
    error_px, squares, is_next = errors_next_to_steps(radius_px, sign, (0.3, 1.0))
    rms_px = np.sqrt(np.square(error_px[is_next]).mean())
    assert rms_px < 2.1 * np.sqrt(np.square(error_px[~is_next]).mean())
    assert squares[is_next].mean() < 1.3


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("radius_px", [1.8, 3.0, 6.0])
def test_nor_does_one_that_is_higher_than_the_dot(radius_px: float, sign: float) -> None:
    error_px, squares, is_next = errors_next_to_steps(radius_px, sign, (1.0, 1.6))
    rms_px = np.sqrt(np.square(error_px[is_next]).mean())
    assert rms_px < 1.7 * np.sqrt(np.square(error_px[~is_next]).mean())
    assert squares[is_next].mean() < 1.3
