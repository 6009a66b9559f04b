"""Dots found by the survey in images of all kinds, and images that are refused."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from manytouch.detection import survey
from manytouch.errors import LayoutError
from manytouch.simulation.render.discs import Look, Spot, render_discs
from manytouch.values import Frame, Roi

WIDTH, HEIGHT = 520, 400
LIGHT, DARK = {"ground": 45.0, "dot": 205.0}, {"ground": 190.0, "dot": 50.0}
BOTH = pytest.mark.parametrize(("levels", "polarity"), [(LIGHT, "light"), (DARK, "dark")])


def frame(image: np.ndarray | None, index: int = 0) -> Frame:
    return Frame(index=index, timestamp_ns=0, camera="test", image=image)


def lattice(columns: int, rows: int, pitch_px: float, turn: float = 0.0) -> np.ndarray:
    x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.stack([x.ravel(), y.ravel()], axis=1) * pitch_px @ rotation.T + np.array(
        [WIDTH / 2, HEIGHT / 2]
    )


def render(centre_px: np.ndarray, radius_px: float, look: Look, **given: object) -> np.ndarray:
    shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
    return render_discs(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=3, **given)


def assert_exactly(image: np.ndarray, centre_px: np.ndarray, polarity: str, near_px: float = 3.0):
    found = survey([frame(image)])
    assert found.appearance.polarity == polarity
    distance = np.linalg.norm(found.detections.centre_px[:, None] - centre_px[None], axis=2)
    assert len(found.detections.centre_px) == len(centre_px)
    assert distance.min(axis=0).max() < near_px
    return found


@BOTH
@pytest.mark.parametrize(
    ("grid", "pitch_px", "radius_px"),
    [((30, 20), 13.0, 1.6), ((14, 9), 30.0, 8.0), ((4, 3), 120.0, 40.0)],
)
def test_dots_of_any_size(levels, polarity, grid, pitch_px, radius_px) -> None:
    centre_px = lattice(*grid, pitch_px, 0.04)
    found = assert_exactly(render(centre_px, radius_px, Look(**levels, read_noise=2.0)), centre_px, polarity)
    assert found.appearance.radius_min_px == pytest.approx(radius_px, rel=0.1)
    assert found.appearance.radius_max_px == pytest.approx(radius_px, rel=0.1)
    assert not found.appearance.is_irregular
    assert found.appearance.colour_weights is None


@BOTH
def test_faded_dots_among_full_ones(levels, polarity) -> None:
    centre_px = lattice(12, 9, 38.0)
    contrast = np.random.default_rng(2).choice([0.2, 0.4, 1.0, 1.0], len(centre_px))
    assert_exactly(
        render(centre_px, 8.0, Look(**levels, read_noise=2.0), contrast=contrast), centre_px, polarity
    )


@BOTH
def test_half_printed_dots(levels, polarity) -> None:
    centre_px = lattice(12, 9, 38.0)
    angle = np.random.default_rng(4).uniform(0, 2 * np.pi, len(centre_px))
    cut = np.column_stack(
        [np.cos(angle), np.sin(angle), np.where(np.arange(len(angle)) % 4 == 0, 0.0, np.inf)]
    )
    image = render(centre_px, 9.0, Look(**levels, read_noise=2.0), cut=cut)
    assert_exactly(image, centre_px, polarity, near_px=6.0)


@BOTH
def test_a_dark_dot_with_a_glint_is_one_dot(levels, polarity) -> None:
    centre_px = lattice(12, 9, 38.0)
    image = render(centre_px, 9.0, Look(**levels)).astype(int)
    glint = render(
        centre_px + np.array([1.5, -2.0]), 3.0, Look(ground=0.0, dot=45.0 if polarity == "light" else 130.0)
    )
    assert_exactly(np.clip(image + glint, 0, 255).astype(np.uint8), centre_px, polarity)


@BOTH
def test_uneven_light_glare_and_a_shadow(levels, polarity) -> None:
    centre_px = lattice(12, 9, 38.0)
    look = Look(
        **levels,
        tilt_x=0.4,
        tilt_y=-0.2,
        vignetting=0.4,
        glare=(Spot(centre_px=(262.0, 180.0), radius_px=3.0, amount=150.0),),
        shadows=(Spot(centre_px=(150.0, 150.0), radius_px=60.0, amount=0.6),),
        read_noise=2.0,
    )
    assert_exactly(render(centre_px, 8.0, look), centre_px, polarity)


@BOTH
def test_cables_and_stripes_are_not_dots(levels, polarity) -> None:
    centre_px = lattice(10, 7, 38.0)
    image = render(centre_px, 8.0, Look(**levels, read_noise=2.0)).astype(int)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    image += (12 * np.sin(y / 2.1)).astype(int)
    image[np.abs(y - 25 - 0.03 * x) < 5] = int(levels["dot"])
    image[np.abs(x - 30 + 0.05 * y) < 7] = int(levels["dot"])
    assert_exactly(np.clip(image, 0, 255).astype(np.uint8), centre_px, polarity)


@BOTH
def test_rings_of_dots(levels, polarity) -> None:
    rings = [[0.0, 0.0]]
    for ring in range(1, 6):
        angle = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        rings.extend(34.0 * ring * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    centre_px = np.array(rings) + np.array([WIDTH / 2, HEIGHT / 2])
    assert_exactly(render(centre_px, 8.0, Look(**levels, read_noise=2.0)), centre_px, polarity)


def test_cut_dots_count_when_half_of_them_shows() -> None:
    centre_px = lattice(12, 9, 38.0)
    centre_px -= [centre_px[:, 0].min() + 0.0, 0.0]  # the first column's centres on the border
    image = render(centre_px, 9.0, Look(read_noise=1.0))
    found = survey([frame(image)]).detections
    assert 108 - 9 <= len(found.centre_px) <= 108
    hidden = centre_px - [6.0, 0.0]  # less than a fifth of the first column shows
    assert len(survey([frame(render(hidden, 9.0, Look(read_noise=1.0)))]).detections.centre_px) == 108 - 9


def test_colour_separates_dots_that_grey_does_not() -> None:
    centre_px = lattice(12, 9, 38.0)
    image = render(centre_px, 8.0, Look(ground=(60.0, 120.0, 60.0), dot=(60.0, 70.0, 158.0), read_noise=2.0))
    found = survey([frame(image)])
    weights = found.appearance.colour_weights
    assert weights is not None
    assert np.abs(weights).sum() == pytest.approx(1.0)
    assert len(found.detections.centre_px) == 108
    assert (found.detections.contrast > 0).all()


def test_of_two_patterns_the_known_one_is_found() -> None:
    """Light dots on the left, and fewer dark ones on the right."""
    centre_px = lattice(12, 9, 38.0)
    is_left = centre_px[:, 0] < WIDTH / 2 + 40.0
    light = render(centre_px, 8.0, Look(ground=120.0, dot=230.0, read_noise=2.0))
    dark = render(centre_px, 8.0, Look(ground=120.0, dot=60.0, read_noise=2.0))
    image = np.where(np.arange(WIDTH) < WIDTH / 2 + 40.0, light, dark)
    first = survey([frame(image)])
    assert (first.appearance.polarity, len(first.detections.centre_px)) == ("light", is_left.sum())
    known = survey([frame(dark)]).appearance
    again = survey([frame(image)], known=known)
    assert (again.appearance.polarity, len(again.detections.centre_px)) == ("dark", (~is_left).sum())


def test_a_known_colour_is_used_again() -> None:
    look = Look(ground=(60.0, 120.0, 60.0), dot=(60.0, 70.0, 158.0), read_noise=2.0)
    first = survey([frame(render(lattice(12, 9, 38.0), 8.0, look))])
    there_px = lattice(12, 9, 37.0)
    image = render(there_px, 8.0, look)
    again = survey([frame(image)], known=first.appearance)
    assert len(again.detections.centre_px) == 108
    assert again.appearance.colour_weights == pytest.approx(first.appearance.colour_weights)
    with pytest.raises(LayoutError):
        survey([frame(image)], known=replace(first.appearance, colour_weights=None))


def test_16_bit_is_measured_in_grey_levels_of_255() -> None:
    image = render(lattice(12, 9, 38.0), 8.0, Look(read_noise=2.0), bits=16)
    for given in (image, image >> 4):
        found = survey([frame(np.ascontiguousarray(given))])
        assert len(found.detections.centre_px) == 108
        assert found.appearance.contrast == pytest.approx(160.0, rel=0.12)


def test_region_gives_whole_image_coordinates() -> None:
    centre_px = lattice(12, 9, 38.0)
    image = render(centre_px, 8.0, Look(read_noise=2.0))
    found = survey([frame(image)], roi_px=Roi(150, 100, 300, 200)).detections.centre_px
    distance = np.linalg.norm(found[:, None] - centre_px[None], axis=2).min(axis=1)
    assert np.median(distance) < 0.05
    assert found.min(axis=0)[0] >= 149.0
    assert found.min(axis=0)[1] >= 99.0


def test_frames_without_image_or_dots_are_skipped() -> None:
    image = render(lattice(12, 9, 38.0), 8.0, Look(read_noise=2.0))
    found = survey([frame(None, 0), frame(np.zeros_like(image), 1), frame(image, 2)])
    assert found.frame_index == 2


NOTHING = (
    *("black", "white", "noise", "clouds 2", "clouds 4", "clouds 8"),
    *("stripes", "random circles", "five dots"),
)


@cache
def nothing() -> dict[str, np.ndarray]:
    random = np.random.default_rng(0)
    pictures = {
        "black": np.zeros((HEIGHT, WIDTH), np.uint8),
        "white": np.full((HEIGHT, WIDTH, 3), 255, np.uint8),
    }
    pictures["noise"] = np.clip(random.normal(128, 25, (HEIGHT, WIDTH)), 0, 255).astype(np.uint8)
    for scale in (2, 4, 8):
        smooth = gaussian_filter(random.normal(size=(HEIGHT, WIDTH)), scale)
        pictures[f"clouds {scale}"] = np.clip(128 + 40 * smooth / smooth.std(), 0, 255).astype(np.uint8)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    pictures["stripes"] = (128 + 60 * np.sin(x / 6)).astype(np.uint8)
    circles = np.full((HEIGHT, WIDTH), 60, np.uint8)
    for _ in range(50):
        u, v, radius = random.integers(WIDTH), random.integers(HEIGHT), random.integers(3, 30)
        circles[(x - u) ** 2 + (y - v) ** 2 < radius**2] = random.integers(80, 255)
    pictures["random circles"] = circles
    pictures["five dots"] = render(lattice(5, 1, 60.0), 9.0, Look(read_noise=1.0))
    return pictures


@pytest.mark.parametrize("name", NOTHING)
def test_images_without_dots_are_refused(name: str) -> None:
    assert nothing().keys() == set(NOTHING)
    with pytest.raises(LayoutError, match=r"^no dots were found in .*expected"):
        survey([frame(nothing()[name])])


def test_frames_without_images_are_refused() -> None:
    with pytest.raises(LayoutError, match="decoded"):
        survey([frame(None)])


def test_an_irregular_pattern_is_stated_in_a_sentence() -> None:
    rng = np.random.default_rng(4)
    centre_px = np.zeros((0, 2))
    for tried_px in rng.uniform([15.0, 15.0], [WIDTH - 15.0, HEIGHT - 15.0], (2000, 2)):
        if np.all(np.linalg.norm(centre_px - tried_px, axis=1) > 20.0):
            centre_px = np.vstack([centre_px, tried_px])
    notes = survey([frame(render(centre_px, 5.0, Look(**DARK)))]).notes
    assert "The dots are not a locally regular pattern." in notes
    assert all(note.endswith(".") for note in notes)
    assert survey([frame(render(lattice(16, 12, 30.0), 5.0, Look(**DARK)))]).notes == ()
