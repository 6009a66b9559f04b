"""The shape of dots: round, squeezed, cut off."""

import numpy as np
import pytest

from manytouch.calibration.dot_shape import height_over_width
from manytouch.values import Roi

SIZE_PX, RADIUS_PX = (640, 480), 9.0
GREY = np.array([1.0])


def picture(stretch: float, *, noise: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """Dark dots on light ground, taller than wide by a factor, and their centres."""
    x, y = np.meshgrid(np.arange(60, 600, 50), np.arange(50, 440, 50))
    centre = np.column_stack([x.ravel(), y.ravel()]) + np.random.default_rng(1).uniform(
        -0.5, 0.5, (x.size, 2)
    )
    image = np.full(SIZE_PX[::-1], 200.0)
    x_px, y_px = np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1])[:, None]
    for column, row in centre:
        off = np.hypot((x_px - column) * stretch**0.5, (y_px - row) / stretch**0.5)
        image -= 160.0 / (1.0 + np.exp(np.clip(2.0 * (off - RADIUS_PX), -50.0, 50.0)))
    noisy = image + np.random.default_rng(2).normal(0.0, noise, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), centre


@pytest.mark.parametrize(
    "stretch", [0.75, *(pytest.param(each, marks=pytest.mark.slow) for each in (1.0, 1.333))]
)
def test_the_ratio_is_that_of_the_drawn_dots(stretch: float) -> None:
    image, centre = picture(stretch)
    found = height_over_width(image, GREY, centre, np.full(len(centre), RADIUS_PX))
    assert found == pytest.approx(stretch, rel=0.02)


def test_colours_are_weighed_and_the_region_is_cut_out() -> None:
    image, centre = picture(1.333)
    colour = np.dstack([np.zeros_like(image), image, np.zeros_like(image)])
    found = height_over_width(
        colour,
        np.array([0.0, 1.0, 0.0]),
        centre,
        np.full(len(centre), RADIUS_PX),
        roi_px=Roi(30, 20, 400, 300),
    )
    assert found == pytest.approx(1.333, rel=0.02)


def test_dots_that_are_cut_off_have_no_shape() -> None:
    image, _ = picture(1.0)
    edge = np.array([[2.0, 240.0], [320.0, 478.0]])
    assert np.isnan(height_over_width(image, GREY, edge, np.full(2, RADIUS_PX)))
