"""Centres of dots whose surroundings are dark on one side, from their rims."""

import cv2
import numpy as np
import pytest

from manytouch.detection import measure
from manytouch.detection.rim import LEAST_RADIUS_PX, LEAST_SHARE, fit_rims

DARK = np.full(3, -1.0 / 3.0)


def before(
    background: np.ndarray, centre_px: np.ndarray, radius_px: float, blur_px: float = 0.7
) -> np.ndarray:
    """A dark dot before a background, with a little noise."""
    y, x = (np.mgrid[: 8 * len(background), : 8 * background.shape[1]] + 0.5) / 8.0 - 0.5
    fine = np.hypot(x - centre_px[0], y - centre_px[1]) < radius_px
    size = background.shape[1], len(background)
    covered = cv2.resize(fine.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    image = (background + covered * (12.0 - background)).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), blur_px)
    image += np.random.default_rng(3).normal(0.0, 1.5, image.shape)
    return cv2.cvtColor(np.clip(image, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)


def boards(turn_deg: float, near_px: float, grey: float) -> np.ndarray:
    """A light wall, and a dark board up to a distance from the middle."""
    y, x = np.mgrid[:60, :60] - 30.0
    along = x * np.cos(np.radians(turn_deg)) + y * np.sin(np.radians(turn_deg))
    return np.where(along > near_px, grey, 140.0)


@pytest.mark.parametrize("turn_deg", [0.0, 65.0, 130.0, 250.0])
@pytest.mark.parametrize("near_px", [0.0, 2.5, 4.5])
def test_a_dark_board_behind_a_part_of_a_dot_moves_its_rim_little(turn_deg: float, near_px: float) -> None:
    """The mean of the pixels, from which the rim is found, is up to 2 px off."""
    centre_px = np.array([[30.3, 29.6]])
    image = before(boards(turn_deg, near_px, 50.0), centre_px[0], 4.5)
    start_px = measure(image, DARK, centre_px, np.array([4.5]), noise=2.0).centre_px
    found_px, share = fit_rims(image, DARK, start_px, np.array([4.5]))
    assert np.linalg.norm(found_px - centre_px) < 0.15
    assert share[0] > 0.8


@pytest.mark.parametrize(("near_px", "most_px"), [(1.0, 0.52), (2.0, 0.25)])
def test_a_board_that_is_nearly_as_dark_as_the_dot(near_px: float, most_px: float) -> None:
    """A part of the rim hardly shows: neither the known radius alone nor all rays alike give the centre."""
    centre_px = np.array([[30.3, 29.6]])
    for turn_deg in (0.0, 65.0, 130.0, 250.0):
        image = before(boards(turn_deg, near_px, 20.0), centre_px[0], 4.5)
        start_px = measure(image, DARK, centre_px, np.array([4.5]), noise=2.0).centre_px
        found_px, _ = fit_rims(image, DARK, start_px, np.array([4.5]))
        assert np.linalg.norm(found_px - centre_px) < most_px


def test_the_rim_follows_a_dot_that_moves() -> None:
    y, x = np.mgrid[:60, :60]
    background = np.where((x // 5 + y // 5) % 2, 140.0, 60.0)
    way = np.linspace(0.0, 3.0, 13)[:, None] * [1.0, -0.6] + [30.0, 30.0]
    found_px = [
        fit_rims(before(background, at, 5.0), DARK, at[None] + 1.0, np.array([5.0]))[0][0] for at in way
    ]
    assert np.linalg.norm(found_px - way, axis=1).max() < 0.3


def test_there_is_no_rim_without_a_dot() -> None:
    image = np.full((60, 60, 3), 90, dtype=np.uint8)
    found_px, share = fit_rims(image, DARK, np.array([[30.0, 30.0], [np.nan, 3.0]]), np.array([4.0, 4.0]))
    assert not np.isfinite(found_px).any()
    assert not share.any()


def test_pixels_that_are_no_numbers_give_no_rim() -> None:
    image = before(boards(20.0, 2.0, 60.0), np.array([30.0, 30.0]), 4.0).astype(np.float32)
    image[27:33, 25:35] = np.nan
    near_px = np.array([[30.0, 30.0], [-4.0, 70.0], [59.4, 0.2], [1e5, 30.0]])
    found_px, share = fit_rims(image, DARK, near_px, np.full(4, 4.0))
    assert not np.isfinite(found_px[[0, 3]]).any()
    assert not share[[0, 3]].any()


def test_small_dots_have_no_rim() -> None:
    centre_px, background = np.array([[30.0, 30.0]]), np.full((60, 60), 140.0)
    for radius_px, has_rim in ((LEAST_RADIUS_PX - 0.3, False), (LEAST_RADIUS_PX + 0.3, True)):
        image = before(background, centre_px[0], radius_px)
        found_px, share = fit_rims(image, DARK, centre_px, np.array([radius_px]))
        assert np.isfinite(found_px).all() == has_rim
        assert (share[0] > LEAST_SHARE) == has_rim


@pytest.mark.parametrize("image_type", [np.uint16, np.float32])
def test_the_type_of_the_pixels_does_not_matter(image_type: type) -> None:
    image = before(boards(20.0, 2.0, 60.0), np.array([30.0, 30.0]), 4.0)
    near_px, radius_px = np.array([[30.4, 30.0]]), np.array([4.0])
    np.testing.assert_allclose(
        fit_rims(image.astype(image_type), DARK, near_px, radius_px)[0],
        fit_rims(image, DARK, near_px, radius_px)[0],
        atol=1e-4,
    )
