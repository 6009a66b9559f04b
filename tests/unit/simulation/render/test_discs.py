"""The renderer: exact centroids and areas, levels, light and noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from manytouch.simulation.render.discs import DARK_DOTS, LIGHT_DOTS, Look, Spot, disc_coverage, render_discs

WIDTH, HEIGHT = 61, 47


def ellipse(half_x: float, half_y: float, angle: float) -> np.ndarray:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag([half_x, half_y])


def centroid(weight: np.ndarray) -> np.ndarray:
    y, x = np.indices(weight.shape)
    return np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()


def oversampled(centre: np.ndarray, shape: np.ndarray, blur_px: float, fine: int = 16) -> np.ndarray:
    """The definition by brute force: fine pixels, convolved."""
    y, x = np.mgrid[0 : HEIGHT * fine, 0 : WIDTH * fine]
    offset = np.stack([(x + 0.5) / fine - 0.5 - centre[0], (y + 0.5) / fine - 0.5 - centre[1]], axis=-1)
    inside = ((offset @ np.linalg.inv(shape).T) ** 2).sum(axis=-1) <= 1
    smooth = gaussian_filter(inside.astype(float), blur_px * fine, truncate=6)
    low, high = fine // 2 - 1, fine // 2
    return np.mean([smooth[a::fine, b::fine] for a in (low, high) for b in (low, high)], axis=0)


@pytest.mark.parametrize("radius_px", [1.5, 4.0, 8.0, 16.0])
@pytest.mark.parametrize("flatness", [1.0, 0.7])
def test_coverage_is_the_blurred_ellipse(radius_px: float, flatness: float) -> None:
    centre, shape = np.array([30.3, 22.77]), ellipse(radius_px, radius_px * flatness, 0.6)
    coverage = disc_coverage(centre[None], shape[None], width_px=WIDTH, height_px=HEIGHT, blur_px=0.8)
    assert np.abs(coverage - oversampled(centre, shape, 0.8)).max() < 0.01


@settings(max_examples=40, deadline=None)
@given(
    shift=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    half=st.tuples(st.floats(0.8, 14.0), st.floats(0.6, 1.0)),
    angle=st.floats(0, np.pi),
    blur_px=st.floats(0.6, 1.8),
)
def test_centroid_and_area_are_the_dots(
    shift: tuple[float, float], half: tuple[float, float], angle: float, blur_px: float
) -> None:
    centre = np.array([30.0, 23.0]) + shift
    shape = ellipse(half[0], half[0] * half[1], angle)
    coverage = disc_coverage(centre[None], shape[None], width_px=WIDTH, height_px=HEIGHT, blur_px=blur_px)
    assert np.abs(centroid(coverage.astype(float)) - centre).max() < 2e-3
    assert coverage.sum(dtype=float) == pytest.approx(np.pi * abs(np.linalg.det(shape)), rel=2e-3)


@pytest.mark.parametrize("look", [LIGHT_DOTS, DARK_DOTS])
@pytest.mark.parametrize("bits", [8, 16])
def test_rounded_pictures_keep_the_centroid(look: Look, bits: int) -> None:
    centre = np.array([[15.37, 20.81], [44.62, 21.14]])
    shape = np.stack([ellipse(6.0, 5.0, 0.4), ellipse(2.2, 2.0, 1.2)])
    image = render_discs(centre, shape, width_px=WIDTH, height_px=HEIGHT, look=look, bits=bits)
    assert image.dtype == (np.uint8 if bits == 8 else np.uint16)
    assert image.shape == (HEIGHT, WIDTH)
    weight = np.abs(image.astype(float) - image[0, 0])
    assert np.abs(centroid(weight[:, :30]) - centre[0]).max() < 0.01
    assert np.abs(centroid(weight[:, 30:]) - (centre[1] - [30, 0])).max() < 0.01


def test_levels_are_the_looks() -> None:
    shape = ellipse(10.0, 10.0, 0.0)[None]
    image = render_discs(
        np.array([[30.0, 23.0]]), shape, width_px=WIDTH, height_px=HEIGHT, look=Look(ground=30.0, dot=201.0)
    )
    assert (image[23, 30], image[0, 0]) == (201, 30)
    colour = render_discs(
        np.array([[30.0, 23.0]]),
        shape,
        width_px=WIDTH,
        height_px=HEIGHT,
        look=Look(ground=(10.0, 20.0, 30.0), dot=(200.0, 100.0, 30.0)),
    )
    assert colour.shape == (HEIGHT, WIDTH, 3)
    assert colour[23, 30].tolist() == [200, 100, 30]
    assert colour[0, 0].tolist() == [10, 20, 30]


def test_contrast_missing_and_cut_dots() -> None:
    centre = np.array([[12.0, 23.0], [30.0, 23.0], [48.0, 23.0], [np.nan, 23.0]])
    shape = np.tile(ellipse(6.0, 6.0, 0.0), (4, 1, 1))
    cut = np.array([[0.0, 0.0, np.inf], [0.0, 0.0, np.inf], [1.0, 0.0, 0.0], [0.0, 0.0, np.inf]])
    coverage = disc_coverage(
        centre,
        shape,
        width_px=WIDTH,
        height_px=HEIGHT,
        contrast=np.array([0.0, 0.5, 1.0, 1.0]),
        cut=cut,
    )
    assert coverage[:, :20].max() == 0
    assert coverage[23, 30] == pytest.approx(0.5, abs=1e-4)
    assert coverage[23, 48] == pytest.approx(0.5, abs=0.01)  # on the cut
    assert coverage[23, 51] < 1e-3
    assert coverage[23, 45] > 0.99
    assert coverage[:, 40:].sum() == pytest.approx(np.pi * 36 / 2, rel=0.01)


def test_dots_beyond_the_border_are_cut_off() -> None:
    centre = np.array([[-0.5, 20.0], [200.0, 20.0]])
    coverage = disc_coverage(
        centre, np.tile(ellipse(8.0, 8.0, 0.0), (2, 1, 1)), width_px=WIDTH, height_px=HEIGHT
    )
    assert coverage.sum() == pytest.approx(np.pi * 64 / 2, rel=0.01)


def test_light_falls_off_to_corners_and_under_spots() -> None:
    none = np.zeros((0, 2))

    def ground(look: Look) -> np.ndarray:
        return render_discs(none, np.zeros((0, 2, 2)), width_px=WIDTH, height_px=HEIGHT, look=look).astype(
            int
        )

    assert ground(Look(ground=100.0, vignetting=0.4))[[0, 23], [0, 30]] == pytest.approx([61, 100], abs=1)
    tilted = ground(Look(ground=100.0, tilt_x=0.2, tilt_y=-0.1))
    assert (tilted[23, 60], tilted[46, 30]) == (120, 90)
    spot = Spot(centre_px=(20.0, 10.0), radius_px=4.0, amount=90.0)
    assert ground(Look(ground=100.0, glare=(spot,)))[[10, 46], [20, 60]].tolist() == [190, 100]
    assert ground(Look(ground=200.0, glare=(spot,))).max() == 255
    shade = Spot(centre_px=(20.0, 10.0), radius_px=4.0, amount=0.3)
    assert ground(Look(ground=100.0, shadows=(shade,)))[[10, 46], [20, 60]].tolist() == [70, 100]


def test_noise_has_its_deviation_and_repeats_with_its_seed() -> None:
    def picture(seed: int | None, **noise: float) -> np.ndarray:
        return render_discs(
            np.zeros((0, 2)),
            np.zeros((0, 2, 2)),
            width_px=320,
            height_px=200,
            look=Look(ground=100.0, **noise),
            seed=seed,
            bits=16,
        )

    read = picture(1, read_noise=2.0)
    assert (read / 257).std() == pytest.approx(2.0, rel=0.02)
    assert (picture(1, shot_noise=0.04) / 257).std() == pytest.approx(2.0, rel=0.02)
    assert (read / 257).mean() == pytest.approx(100, abs=0.05)
    assert np.array_equal(read, picture(1, read_noise=2.0))
    other = picture(2, read_noise=2.0)
    assert abs(np.corrcoef(read.ravel(), other.ravel())[0, 1]) < 0.02
    assert abs(np.corrcoef(read[:, 1:].ravel(), read[:, :-1].ravel())[0, 1]) < 0.02
    assert picture(None, read_noise=2.0).std() == 0


def test_pictures_cannot_be_written() -> None:
    image = render_discs(np.zeros((0, 2)), np.zeros((0, 2, 2)), width_px=7, height_px=5)
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 1
    assert image.base is None or not image.base.flags.writeable
