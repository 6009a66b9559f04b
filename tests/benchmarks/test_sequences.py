"""Motion, faults, noise and truth of the sequences of the benchmarks."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

import sequences  # noqa: E402
from sequences import Sequence, course_of, dots_in, jpegs, picture, pictures, to_and_fro  # noqa: E402

SMALL = Sequence(dots=96, size="480p", frames=8, seed=3)


@pytest.mark.parametrize("step", [0.25, 0.8, 1.2])
def test_fastest_dot_moves_by_the_step(step: float) -> None:
    course = course_of(Sequence(dots=384, size="720p", frames=8, step_pitches=step))
    fastest = np.linalg.norm(np.diff(course.centre_px, axis=0), axis=2).max(axis=1) / course.pitch_px
    assert fastest[2:] == pytest.approx(np.full(5, step), rel=1e-3)
    assert fastest[:2] == pytest.approx(np.full(2, step / 2), rel=1e-3)


def test_first_frame_is_at_rest_and_the_sheet_does_not_fold() -> None:
    course = course_of(Sequence(dots=1040, frames=6, step_pitches=2.0))
    assert course.centre_px[0] == pytest.approx(course.sensor.layout.rest_px, abs=1e-9)
    strain = course.shape_px / course.radius_px - np.eye(2)
    assert 0.3 < np.linalg.norm(strain, axis=(2, 3), ord=2).max() < 1.1 * sequences.STEEPEST


def test_shape_is_the_derivative_of_the_motion() -> None:
    course = course_of(replace(SMALL, dots=384, jitter_pitches=0.0, step_pitches=0.5))
    rows, columns = course.sensor.layout.shape
    moved = (course.centre_px[6] - course.centre_px[0]).reshape(rows, columns, 2)
    strain = (moved[:, 2:] - moved[:, :-2]) / (2 * course.pitch_px)
    shape = course.shape_px[6].reshape(rows, columns, 2, 2) / course.radius_px
    found = shape[:, 1:-1, :, 0] - [1.0, 0.0]
    assert np.abs(found).max() > 0.1
    assert (found * strain).sum() / (strain**2).sum() == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(np.mean((found - strain) ** 2)) < 0.1 * np.abs(found).max()


def test_clamped_rim_stays_and_a_free_one_moves() -> None:
    clamped, free = (course_of(replace(SMALL, is_clamped=each, frames=6)) for each in (True, False))
    rim = (clamped.sensor.layout.row_column == 0).any(axis=1)
    assert np.ptp(clamped.centre_px[:, rim], axis=0).max() < 0.05 * clamped.pitch_px
    assert np.ptp(free.centre_px[:, rim], axis=0).max() > 0.1 * free.pitch_px


@pytest.mark.parametrize("shift", [0.6, 1.0])
def test_view_jumps_away_and_back_with_its_rim(shift: float) -> None:
    still, moved = (
        course_of(replace(SMALL, frames=16, shift_pitches=each)).centre_px for each in (0.0, shift)
    )
    away = np.linalg.norm(moved - still, axis=2) / course_of(SMALL).pitch_px
    assert away[:5] == pytest.approx(0.0, abs=1e-9)
    assert away[5:10] == pytest.approx(np.full_like(away[5:10], shift))
    assert away[10:15] == pytest.approx(0.0, abs=1e-9)
    assert np.flatnonzero(course_of(replace(SMALL, frames=16, shift_pitches=shift)).is_jump).tolist() == [
        5,
        10,
        15,
    ]


def test_the_share_of_missing_dots_is_as_specified() -> None:
    course = course_of(Sequence(dots=4000, frames=8, missing_share=0.05))
    absent = ~course.is_visible
    assert absent.mean() == pytest.approx(0.05, rel=0.15)
    assert absent.all(axis=0).mean() == pytest.approx(0.025, rel=0.3)


def test_hole_is_round_and_wanders() -> None:
    course = course_of(Sequence(dots=1040, frames=12, hole_pitches=3.0))
    rest_px = course.sensor.layout.rest_px / course.pitch_px
    assert (~course.is_visible).sum(axis=1) == pytest.approx(np.full(12, np.pi * 9.0), rel=0.25)
    middles = [rest_px[~visible].mean(axis=0) for visible in course.is_visible]
    assert np.ptp(middles, axis=0).max() > 10.0
    for middle, visible in zip(middles, course.is_visible, strict=True):
        assert np.linalg.norm(rest_px[~visible] - middle, axis=1).max() < 3.6


def test_false_spots_touch_no_dot_and_half_of_them_stay() -> None:
    course = course_of(Sequence(dots=1040, frames=4, false_share=0.04))
    for centre_px, false_px in zip(course.centre_px, course.false_px, strict=True):
        assert len(false_px) == 42
        assert cKDTree(centre_px).query(false_px)[0].min() > 2.0 * course.radius_px
    same = cKDTree(course.false_px[0]).query(course.false_px[1])[0] < 1e-9
    assert 15 <= same.sum() <= 21


def test_the_noise_of_dots_agrees_with_their_covariance() -> None:
    course = course_of(Sequence(dots=4000, frames=2))
    dots = dots_in(course, 1, noise_px=0.02)
    distance, index = cKDTree(course.centre_px[1]).query(dots.centre_px)
    assert sorted(index.tolist()) == list(range(4000))
    assert not np.array_equal(index, np.arange(4000))
    error = dots.centre_px - course.centre_px[1][index]
    square = np.einsum("ni,nij,nj->n", error, np.linalg.inv(dots.covariance_px2), error)
    assert square.mean() == pytest.approx(2.0, rel=0.08)
    assert distance.max() < 0.2


@pytest.mark.parametrize(
    ("fault", "share", "status"),
    [
        ("black", 0.0, "dark"),
        ("saturated", 0.0, "saturated"),
        ("blurred", 0.5, "blurred"),
        ("hidden", 0.5, "ok"),
    ],
)
def test_faults_take_dots_away_for_their_time(fault: str, share: float, status: str) -> None:
    course = course_of(Sequence(dots=384, size="720p", frames=8, fault=fault, fault_from=3, fault_frames=2))
    counts = np.array([len(dots_in(course, index).centre_px) for index in range(8)]) / 384
    assert counts[[0, 1, 2, 5, 6, 7]] == pytest.approx(np.ones(6))
    assert counts[3:5] == pytest.approx(np.full(2, share), abs=0.1)
    assert [dots_in(course, index).status for index in (2, 3, 5)] == ["ok", status, "ok"]
    assert np.flatnonzero(course.is_faulty).tolist() == [3, 4]


def test_flash_lasts_one_frame_and_blinds() -> None:
    course = course_of(replace(SMALL, fault="flash", fault_from=2))
    assert np.flatnonzero(course.is_faulty).tolist() == [2]
    assert picture(course, 2).mean() > 250
    assert picture(course, 3).mean() < 100


def test_pictures_show_dots_at_their_true_positions() -> None:
    course = course_of(replace(SMALL, missing_share=0.1, noise=1.0))
    image = picture(course, 5).astype(np.float64)
    assert image.shape == (480, 640)
    x, y = np.rint(course.centre_px[5]).astype(int).T
    shown = course.is_visible[5]
    assert 0 < (~shown).sum() < 30
    assert image[y, x][shown].min() > 100
    assert image[y, x][~shown].max() < 60
    for marker in np.flatnonzero(shown)[::7]:
        half = int(2 * course.radius_px)
        window = image[y[marker] - half : y[marker] + half + 1, x[marker] - half : x[marker] + half + 1]
        light = np.maximum(window - 60.0, 0.0)
        v, u = np.indices(window.shape) - half
        centre = [x[marker] + (light * u).sum() / light.sum(), y[marker] + (light * v).sum() / light.sum()]
        assert centre == pytest.approx(course.centre_px[5][marker], abs=0.1)


def test_the_noise_of_pictures_is_as_specified() -> None:
    quiet, loud = (picture(course_of(replace(SMALL, noise=each, light_noise=0.0)), 0) for each in (0.0, 10.0))
    assert (loud.astype(float) - quiet)[quiet > 40].std() == pytest.approx(10.0, rel=0.1)


def test_pictures_are_drawn_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sequences, "cache_folder", lambda: tmp_path)
    course = course_of(replace(SMALL, frames=3))
    first = pictures(course)
    monkeypatch.setattr(sequences, "picture", None)
    again = pictures(course)
    assert all(np.array_equal(a.image, b.image) for a, b in zip(first, again, strict=True))
    assert [frame.index for frame in again] == [0, 1, 2]
    assert len(list(tmp_path.iterdir())) == 1
    assert all(each.startswith(b"\xff\xd8") for each in jpegs(again))


def test_to_and_fro_never_jumps() -> None:
    order = to_and_fro(5, 23)
    assert order[:9].tolist() == [0, 1, 2, 3, 4, 3, 2, 1, 0]
    assert (np.abs(np.diff(order)) == 1).all()


def test_impossible_sequences_are_refused() -> None:
    with pytest.raises(ValueError, match="expected one of"):
        course_of(Sequence(dots=100))
    with pytest.raises(ValueError, match="fewer dots or a larger image"):
        course_of(Sequence(dots=10000, size="480p"))
    with pytest.raises(ValueError, match="a smaller step"):
        course_of(Sequence(dots=96, frames=5, step_pitches=9.0))
