"""Search for the dots of known sensors in every frame."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from layouts import marker_layout
from manytouch.detection import DotSearch, expected_appearance
from manytouch.errors import SensorError
from manytouch.pipeline import Detector
from manytouch.simulation.render.discs import Look, Spot, render_discs
from manytouch.values import Frame, Roi, Sensor
from straight import straight_camera

WIDTH, HEIGHT = 640, 420


def sensor(
    centre_px: np.ndarray, radius_px: np.ndarray | float, polarity: str = "light", weights=None
) -> Sensor:
    """One pixel is one millimetre on the sheet."""
    middle_px = (WIDTH / 2, HEIGHT / 2)
    camera = straight_camera(WIDTH, HEIGHT, focal_px=500.0, distance_mm=500.0, principal_px=middle_px)
    layout = marker_layout(
        centre_px - middle_px, pitch_mm=40.0, radius_mm=radius_px, polarity=polarity, colour_weights=weights
    )
    return Sensor(name="test", camera=camera, layout=layout)


def lattice(pitch_px: float = 40.0) -> np.ndarray:
    x, y = np.meshgrid(np.arange(40, WIDTH - 30, pitch_px), np.arange(40, HEIGHT - 30, pitch_px))
    return np.stack([x.ravel(), y.ravel()], axis=1) + 0.37


def render(
    centre_px: np.ndarray, radius_px: np.ndarray | float, look: Look, seed: int = 1, **given
) -> np.ndarray:
    shape_px = np.broadcast_to(np.asarray(radius_px, dtype=float), (len(centre_px),))[:, None, None] * np.eye(
        2
    )
    return render_discs(centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=seed, **given)


def frame(image: np.ndarray | None) -> Frame:
    return Frame(index=0, timestamp_ns=0, camera="test", image=image)


def assert_all_once(found_px: np.ndarray, centre_px: np.ndarray, near_px: float = 0.5) -> None:
    distance = np.linalg.norm(found_px[:, None] - centre_px[None], axis=2)
    assert len(found_px) == len(centre_px)
    assert distance.min(axis=0).max() < near_px


LOOKS = {
    "light": Look(ground=45.0, dot=205.0, read_noise=2.5),
    "dark": Look(ground=190.0, dot=50.0, read_noise=2.5),
}


def test_implements_the_protocol() -> None:
    assert isinstance(DotSearch(), Detector)


@pytest.mark.parametrize("polarity", ["light", "dark"])
@pytest.mark.parametrize("radius_px", [2.0, 5.0, 9.0])
def test_whole_image_and_windows(polarity: str, radius_px: float) -> None:
    centre_px = lattice(24.0 if radius_px < 6 else 40.0)
    search = DotSearch()
    image = render(centre_px, radius_px, LOOKS[polarity])
    state, whole = search.step(search.start(sensor(centre_px, radius_px, polarity)), frame(image), None)
    assert whole.status == "ok"
    assert_all_once(whole.centre_px, centre_px, 0.2)
    expected_px = centre_px + 0.5 * radius_px * np.array([1.0, -1.0]) / np.sqrt(2)
    expected_px[3] = np.nan
    _, windows = search.step(state, frame(image), expected_px)
    assert_all_once(windows.centre_px, np.delete(centre_px, 3, axis=0), 0.2)
    assert (windows.contrast > 0).all()


def test_dots_state_whether_their_pixels_are_predicted() -> None:
    centre_px = lattice()
    given, detect = frame(render(centre_px, 9.0, LOOKS["light"])), DotSearch()
    state = detect.start(sensor(centre_px, 9.0))
    for is_predicted in (True, False):
        for expected_px in (None, centre_px):
            state, dots = detect.step(state, replace(given, is_predicted=is_predicted), expected_px)
            assert dots.is_predicted is is_predicted


def test_dots_of_different_sizes() -> None:
    centre_px = lattice(60.0)
    radius_px = np.geomspace(3.0, 18.0, len(centre_px))
    search = DotSearch()
    state = search.start(sensor(centre_px, radius_px))
    assert state.appearance.is_irregular
    _, found = search.step(state, frame(render(centre_px, radius_px, LOOKS["light"])), None)
    assert_all_once(found.centre_px, centre_px)


@pytest.mark.parametrize("gain", [0.5, 1.2])
def test_exposure_may_change(gain: float) -> None:
    centre_px, search = lattice(), DotSearch()
    state, _ = search.step(
        search.start(sensor(centre_px, 8.0)), frame(render(centre_px, 8.0, LOOKS["light"])), None
    )
    look = Look(ground=45.0 * gain, dot=205.0 * gain, read_noise=2.5)
    _, found = search.step(state, frame(render(centre_px, 8.0, look)), None)
    assert found.status == "ok"
    assert_all_once(found.centre_px, centre_px)


@pytest.mark.parametrize("polarity", ["light", "dark"])
def test_shadow_and_faded_dots(polarity: str) -> None:
    centre_px = lattice()
    contrast = np.where(np.arange(len(centre_px)) % 7 == 0, 0.22, 1.0)
    plain = LOOKS[polarity]
    look = Look(
        ground=plain.ground,
        dot=plain.dot,
        read_noise=1.5,
        shadows=(Spot(centre_px=(420.0, 200.0), radius_px=70.0, amount=0.35),),
    )
    search = DotSearch()
    image = render(centre_px, 8.0, look, contrast=contrast)
    _, found = search.step(search.start(sensor(centre_px, 8.0, polarity)), frame(image), None)
    assert_all_once(found.centre_px, centre_px)


def test_colour_weights_are_used() -> None:
    centre_px = lattice()
    image = render(centre_px, 8.0, Look(ground=(60.0, 120.0, 60.0), dot=(60.0, 70.0, 158.0), read_noise=2.0))
    weights = np.array([0.0, -0.5, 0.5])
    search = DotSearch()
    state, found = search.step(search.start(sensor(centre_px, 8.0, "light", weights)), frame(image), None)
    assert_all_once(found.centre_px, centre_px)
    _, found = search.step(state, frame(image), centre_px + 2.0)
    assert_all_once(found.centre_px, centre_px)


def test_region_limits_the_search() -> None:
    centre_px = lattice()
    search = DotSearch(roi_px=Roi(100, 100, 300, 220))
    image = render(centre_px, 8.0, LOOKS["light"])
    state, found = search.step(search.start(sensor(centre_px, 8.0)), frame(image), None)
    inside = (np.abs(centre_px - [249.5, 209.5]) < [140.0, 100.0]).all(axis=1)
    distance = np.linalg.norm(found.centre_px[:, None] - centre_px[None, inside], axis=2)
    assert distance.min(axis=0).max() < 0.2
    _, found = search.step(state, frame(image), centre_px)
    assert (found.centre_px >= [99.0, 99.0]).all()


def test_16_bit_gives_the_same_dots() -> None:
    centre_px, search = lattice(), DotSearch()
    image = render(centre_px, 8.0, LOOKS["light"], bits=16)
    _, found = search.step(search.start(sensor(centre_px, 8.0)), frame(image), None)
    assert_all_once(found.centre_px, centre_px)
    assert np.median(found.contrast) == pytest.approx(160.0, rel=0.15)


@pytest.mark.parametrize("is_grey_first", [True, False])
def test_images_may_change_between_grey_and_colour(is_grey_first: bool) -> None:
    centre_px, search = lattice(), DotSearch()
    grey = render(centre_px, 8.0, LOOKS["light"])
    images = [grey, np.repeat(grey[:, :, None], 3, axis=2)]
    state = search.start(sensor(centre_px, 8.0))
    for image in images if is_grey_first else images[::-1]:
        for expected_px in (None, centre_px):
            state, found = search.step(state, frame(image), expected_px)
            assert found.status == "ok"
            assert_all_once(found.centre_px, centre_px)


def test_bad_images_have_a_status() -> None:
    centre_px, search = lattice(), DotSearch()
    state, _ = search.step(
        search.start(sensor(centre_px, 8.0)), frame(render(centre_px, 8.0, LOOKS["light"])), None
    )
    assert search.step(state, frame(None), None)[1].status == "decode_error"
    assert search.step(state, frame(np.zeros((20, 30), np.uint8)), None)[1].status == "wrong_size"
    assert search.step(state, frame(np.zeros((HEIGHT, WIDTH, 3), np.uint8)), None)[1].status == "dark"
    assert search.step(state, frame(np.zeros((20, 30, 3), np.uint8)), None)[1].status == "wrong_size"
    outside = DotSearch(roi_px=Roi(WIDTH - 4, 0, 300, 220))
    assert outside.step(state, frame(render(centre_px, 8.0, LOOKS["light"])), None)[1].status == "wrong_size"
    assert search.step(state, frame(np.zeros((HEIGHT, WIDTH), np.uint8)), None)[1].status == "dark"
    assert (
        search.step(state, frame(np.full((HEIGHT, WIDTH), 255, np.uint8)), centre_px)[1].status == "saturated"
    )
    blurred = render(centre_px, 8.0, LOOKS["light"], blur_px=4.0)
    for expected_px in (None, centre_px):
        after, found = search.step(state, frame(blurred), expected_px)
        assert found.status == "blurred"
    assert search.step(after, frame(None), None)[1].centre_px.shape == (0, 2)


def test_a_replay_gives_the_same_bits() -> None:
    centre_px, search = lattice(), DotSearch()
    image = render(centre_px, 8.0, LOOKS["light"])
    state = search.start(sensor(centre_px, 8.0))
    first, second = (search.step(state, frame(image), None)[1] for _ in range(2))
    np.testing.assert_array_equal(first.centre_px, second.centre_px)
    np.testing.assert_array_equal(first.covariance_px2, second.covariance_px2)


def test_appearance_is_projected() -> None:
    found = expected_appearance(sensor(lattice(), 8.0, "dark"))
    assert found.polarity == "dark"
    # off the axis a disc shows larger by (f^2 + r^2)^(1/2) (n . p)^(1/2): none for a parallel plane
    assert found.radius_min_px == pytest.approx(8.0, rel=1e-6)
    assert found.radius_max_px == pytest.approx(8.0, rel=1e-6)


def test_a_sensor_without_markers_is_refused() -> None:
    given = sensor(lattice(), 8.0)
    with pytest.raises(SensorError, match="no markers"):
        DotSearch().start(Sensor(name="camera only", camera=given.camera))


def off_before(board: np.ndarray, radius_px: float) -> tuple[list[float], float]:
    """How far dark dots of a transparent skin are off before a board that moves, px, and the share seen."""
    centre_px = lattice(80.0)
    clear = sensor(centre_px, radius_px, polarity="dark")
    assert clear.layout is not None
    search = DotSearch()
    state = search.start(replace(clear, layout=replace(clear.layout, is_before_scene=True)))
    off_px: list[float] = []
    for number in range(12):
        image = cv2.GaussianBlur(board[3 * number :, 4 * number :][:HEIGHT, :WIDTH], (0, 0), 1.2)
        for x, y in centre_px:
            cv2.circle(image, (round(16 * x), round(16 * y)), round(16 * radius_px), 12.0, -1, cv2.LINE_AA, 4)
        image = cv2.GaussianBlur(image, (0, 0), 0.7)
        image += np.random.default_rng(number).normal(0.0, 1.5, image.shape)
        state, found = search.step(state, frame(np.clip(image, 0, 255).astype(np.uint8)), centre_px)
        distance_px = np.linalg.norm(found.centre_px[:, None] - centre_px, axis=2)
        off_px.extend(distance_px.min(axis=1))
    return off_px, len(off_px) / (12 * len(centre_px))


def test_a_printed_board_that_moves_behind_a_skin_moves_no_dot() -> None:
    """Its dark squares touch most of the dots; by the mean of its pixels every tenth is 1.2 px off."""
    squares = np.random.default_rng(4).random((HEIGHT // 7 + 30, WIDTH // 7 + 30)) < 0.5
    board = cv2.resize(np.where(squares, 45.0, 150.0), None, fx=7, fy=7, interpolation=cv2.INTER_NEAREST)
    off_px, seen = off_before(board, 5.0)
    assert seen > 0.95
    assert np.quantile(off_px, 0.9) < 0.6
    assert np.quantile(off_px, 0.98) < 0.8


def test_dark_spots_behind_a_skin_are_not_taken_for_its_dots() -> None:
    """Some of them are as large as the dots, and the steps from the expected position lead to them."""
    spots = np.random.default_rng(4).normal(size=(HEIGHT + 60, WIDTH + 60))
    spots = cv2.GaussianBlur(spots, (0, 0), 7.0)
    off_px, seen = off_before(np.clip(60.0 + 30.0 * spots / spots.std(), 8.0, None), 4.5)
    assert seen > 0.95
    assert np.quantile(off_px, 0.98) < 1.5
