"""Annotated camera images: sizes, positions of marks, files."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from manytouch.errors import OutputError
from manytouch.sinks.pictures.annotate import AnnotatedPictures, Annotator, force_text
from manytouch.sinks.pictures.drawing import GREY, SKY, VERMILION, YELLOW, eight_bit_colour
from manytouch.values import OutlineRing, Phase, Status


def count(picture, colour):
    return int(np.all(picture == np.array(colour, np.uint8), axis=2).sum())


def place_of(picture, colour):
    rows, columns = np.nonzero(np.all(picture == np.array(colour, np.uint8), axis=2))
    return columns.mean(), rows.mean()


def test_small_pictures_are_enlarged_and_sizes_are_even_and_constant(sensor, reading_of):
    annotate = Annotator(sensor)
    states = (Status.OK, Status.DECODE_ERROR, Status.OK)
    shapes = {annotate(reading_of(i, status=s)).shape for i, s in enumerate(states)}
    assert annotate.zoom == 2
    assert len(shapes) == 1
    height, width, _ = shapes.pop()
    assert width == 640
    assert height > 480
    assert height % 2 == width % 2 == 0


@pytest.mark.parametrize(("long_side_px", "zoom"), [(100, 7), (320, 2), (640, 2), (800, 1), (2560, 1)])
def test_small_pictures_become_as_large_as_text_needs_and_not_larger(sensor, long_side_px, zoom):
    camera = dataclasses.replace(sensor.camera, width_px=long_side_px, height_px=long_side_px * 3 // 4)
    assert Annotator(dataclasses.replace(sensor, camera=camera)).zoom == zoom


def test_a_contact_is_drawn_where_it_shows(sensor, reading_of, contact_of):
    annotate = Annotator(sensor)
    legend = count(annotate(reading_of(0)), VERMILION)
    picture = annotate(reading_of(0, (contact_of(),)))
    assert count(picture, VERMILION) > legend
    bar = (picture.shape[0] - 480) // 2
    x, y = place_of(picture[bar : bar + 480], VERMILION)
    assert (x, y) == pytest.approx((180 * 2 - 0.5, 110 * 2 - 0.5), abs=2)


def test_the_outline_of_a_contact_is_drawn_in_place_of_a_circle(sensor, reading_of, contact_of):
    square_mm = np.array([[-1.0, -2.0], [4.0, -2.0], [4.0, 1.0], [-1.0, 1.0]])
    hole_mm = np.array([[1.0, -1.0], [1.0, 0.0], [2.0, 0.0]])
    contact = contact_of(
        outline=(OutlineRing(point_mm=square_mm), OutlineRing(point_mm=hole_mm, is_hole=True)), area_mm2=14.5
    )
    picture = Annotator(sensor)(reading_of(0, (contact,)))
    bar = (picture.shape[0] - 480) // 2
    image = picture[bar : bar + 480].astype(np.int64)
    drawn = image[..., 2] - image[..., 0] > 60  # a thin line is blended with the ground

    def is_line_at(x_mm, y_mm):
        x, y = (np.array([x_mm, y_mm]) * 8.0 + [160.0, 120.0]) * 2
        return drawn[round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3].any()

    assert is_line_at(1.5, -2.0)
    assert is_line_at(4.0, -0.5)
    assert is_line_at(1.0, -0.5)  # of the hole
    assert not is_line_at(-0.5, -0.5)
    assert not is_line_at(2.5 + np.sqrt(14.5 / np.pi), -1.25)  # a circle of this area


def test_a_contact_that_ended_is_not_drawn(sensor, reading_of, contact_of):
    annotate = Annotator(sensor)
    ended = annotate(reading_of(0, (contact_of(1, Phase.END),)))
    assert count(ended, VERMILION) == count(annotate(reading_of(0)), VERMILION)


def test_every_seen_marker_has_a_ring_and_an_unseen_one_a_cross(sensor, reading_of):
    annotate = Annotator(sensor)
    all_seen = count(annotate(reading_of(0)), SKY)
    one_less = count(annotate(reading_of(0, unseen=(0,))), SKY)
    assert 0 < all_seen - one_less < 0.1 * all_seen


def test_deep_pixels_keep_their_contrast(sensor, reading_of):
    deep = np.linspace(0, 4000, 320 * 240).reshape(240, 320).astype(np.uint16)
    drawn = eight_bit_colour(deep, 4000.0)
    assert drawn.dtype == np.uint8
    assert (drawn.min(), drawn.max()) == (0, 255)
    frame = dataclasses.replace(reading_of(0).frame, image=deep)
    assert Annotator(sensor)(dataclasses.replace(reading_of(0), frame=frame)).max() == 255


@pytest.mark.parametrize("as_video", [True, False])
def test_annotated_pictures_have_every_frame(tmp_path, sensor, reading_of, as_video):
    sink = AnnotatedPictures(tmp_path, sensor, as_video=as_video, fps=20.0)
    for index in range(3):
        sink.write(reading_of(index))
    final = tmp_path / ("annotated.mp4" if as_video else "annotated")
    sink.close()
    if as_video:
        film = cv2.VideoCapture(str(final))
        assert (film.get(cv2.CAP_PROP_FRAME_COUNT), film.get(cv2.CAP_PROP_FPS)) == (3, 20)
        film.release()
    else:
        assert [path.name for path in sorted(final.iterdir())] == ["000000.png", "000001.png", "000002.png"]


@pytest.mark.parametrize(
    ("free", "limited"), [(8, 45), pytest.param(20, 60, marks=pytest.mark.slow)], ids=["short", "long"]
)
def test_a_video_for_browsers_is_vp9_and_not_larger_than_it_may_be(
    tmp_path, sensor, reading_of, free, limited
):
    av = pytest.importorskip("av")
    sizes = []
    for frames, limit in ((free, None), (limited, 6e5)):
        folder = tmp_path / str(frames)
        folder.mkdir()
        chance = np.random.default_rng(0)
        sink = AnnotatedPictures(folder, sensor, as_video=True, fps=20.0, most_bits_per_s=limit)
        for index in range(frames):
            noisy = chance.normal(128, 10, (240, 320)).clip(0, 255).astype(np.uint8)
            frame = dataclasses.replace(reading_of(index).frame, image=noisy)
            sink.write(dataclasses.replace(reading_of(index), frame=frame))
        sink.close()
        path = folder / "annotated.mp4"
        with av.open(str(path)) as film:
            assert film.streams.video[0].codec_context.name == "vp9"
            assert film.streams.video[0].codec_context.pix_fmt == "yuv420p"
        sizes.append(path.stat().st_size / frames)
    assert sizes[1] < 1.5 * 6e5 / 8 / 20.0
    assert sizes[0] > 2 * sizes[1]


def test_a_full_disk_is_an_error(tmp_path, sensor, reading_of):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    sink = AnnotatedPictures(tmp_path, sensor, as_video=True, fps=20.0)
    (tmp_path / "annotated.mp4").symlink_to(full)
    with pytest.raises(OutputError, match=r"annotated\.mp4: No space left"):
        write_all(sink, [reading_of(index) for index in range(3)])


def write_all(sink, readings):
    for reading in readings:
        sink.write(reading)
    sink.close()


def test_arrows_are_what_markers_moved_in_the_image(sensor, reading_of):
    annotate = Annotator(sensor)
    at_rest = annotate(reading_of(0))
    moved = annotate(reading_of(1, shift_px=(4.0, 0.0)))
    assert count(moved, YELLOW) > count(at_rest, YELLOW)  # the legend has one too


def test_a_shear_force_is_an_arrow_from_the_centre_of_the_contact(sensor, reading_of, contact_of):
    annotate = Annotator(sensor)
    bar = (annotate(reading_of(0)).shape[0] - 480) // 2

    def drawn(force_N):
        contact = contact_of(force_N=np.array(force_N), centre_px=np.array([159.5, 119.5]))
        image = annotate(reading_of(0, (contact,)))[bar : bar + 480]
        rows, columns = np.nonzero(np.all(image == np.array(VERMILION, np.uint8), axis=2))
        return columns, rows

    still, pulled = drawn((0.0, 0.0, -1.5)), drawn((3.0, 0.0, -1.5))
    assert pulled[0].max() == pytest.approx(319.5 + 0.09 * 640, abs=3)
    assert pulled[0].min() == still[0].min()
    assert drawn((0.0, -40.0, -1.5))[1].min() == pytest.approx(239.5 - 0.15 * 640, abs=3)
    unknown = drawn((np.nan, np.nan, -1.5))
    assert len(unknown[0]) == len(still[0])


def test_a_shear_force_below_its_deviation_is_not_drawn_and_the_legend_has_its_scale(
    sensor, reading_of, contact_of
):
    annotate = Annotator(sensor)

    def vermilion(std_N):
        covariance = np.full((8, 8), np.nan)
        covariance[[3, 4], [3, 4]] = std_N**2
        contact = contact_of(force_N=np.array([0.5, 0.0, -1.5]), covariance=covariance)
        return count(annotate(reading_of(0, (contact,))), VERMILION)

    assert vermilion(0.6) < vermilion(0.1)
    relative = Annotator(dataclasses.replace(sensor, sheet=None))
    assert count(annotate(reading_of(0)), VERMILION) > count(relative(reading_of(0)), VERMILION)


def test_a_force_within_two_deviations_is_grey_and_a_clear_one_is_not(sensor, reading_of, contact_of):
    def grey_of(std_N):
        covariance = np.diag([0.04, 0.09, 0.01, 1.0, 1.0, std_N**2, 1.0, 1.0])
        contact = contact_of(force_N=np.array([0.0, 0.0, -1.0]), covariance=covariance)
        return count(Annotator(sensor)(reading_of(0, (contact,))), GREY)

    assert grey_of(0.7) > grey_of(0.4) + 20


def test_a_label_contains_newtons_where_there_are_any(contact_of):
    assert force_text(contact_of(force_N=np.full(3, np.nan))) == ""
    covariance = np.full((8, 8), np.nan)
    covariance[5, 5] = 0.04
    text = force_text(contact_of(force_N=np.array([0.0, 0.0, -1.5]), covariance=covariance))
    assert text == "  1.50 ± 0.20 N"
