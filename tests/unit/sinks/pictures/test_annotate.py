"""Annotated camera images: sizes, positions of marks, files."""

import dataclasses

import cv2
import numpy as np
import pytest

from manytouch.sinks.pictures.annotate import AnnotatedPictures, Annotator
from manytouch.sinks.pictures.drawing import SKY, VERMILION, eight_bit_colour
from manytouch.values import Phase, Status


def count(picture, colour):
    return int(np.all(picture == np.array(colour, np.uint8), axis=2).sum())


def place_of(picture, colour):
    rows, columns = np.nonzero(np.all(picture == np.array(colour, np.uint8), axis=2))
    return columns.mean(), rows.mean()


def test_small_pictures_are_enlarged_and_sizes_are_even_and_constant(sensor, reading_of):
    annotate = Annotator(sensor)
    states = (Status.OK, Status.DECODE_ERROR, Status.OK)
    shapes = {annotate(reading_of(i, status=s)).shape for i, s in enumerate(states)}
    assert annotate.zoom == 3
    assert len(shapes) == 1
    height, width, _ = shapes.pop()
    assert width == 960
    assert height > 720
    assert height % 2 == width % 2 == 0


def test_a_contact_is_drawn_where_it_shows(sensor, reading_of, contact_of):
    annotate = Annotator(sensor)
    legend = count(annotate(reading_of(0)), VERMILION)
    picture = annotate(reading_of(0, (contact_of(),)))
    assert count(picture, VERMILION) > legend
    bar = (picture.shape[0] - 720) // 2
    x, y = place_of(picture[bar : bar + 720], VERMILION)
    assert (x, y) == pytest.approx((180 * 3 - 0.5, 110 * 3 - 0.5), abs=2)


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
def test_annotated_pictures_appear_when_complete(tmp_path, sensor, reading_of, as_video):
    sink = AnnotatedPictures(tmp_path, sensor, as_video=as_video, fps=20.0)
    for index in range(3):
        sink.write(reading_of(index))
    final = tmp_path / ("annotated.mp4" if as_video else "annotated")
    assert not final.exists()
    sink.close()
    if as_video:
        film = cv2.VideoCapture(str(final))
        assert (film.get(cv2.CAP_PROP_FRAME_COUNT), film.get(cv2.CAP_PROP_FPS)) == (3, 20)
        film.release()
    else:
        assert [path.name for path in sorted(final.iterdir())] == ["000000.png", "000001.png", "000002.png"]
