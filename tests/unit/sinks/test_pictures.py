"""Annotated pictures, depth maps and the picture of the surface: sizes, places, nothing hidden."""

import dataclasses

import cv2
import numpy as np
import pytest

from manytouch.sinks.files.surface_store import SurfaceStore
from manytouch.sinks.pictures.annotate import AnnotatedPictures, Annotator
from manytouch.sinks.pictures.drawing import SKY, VERMILION, eight_bit_colour, text_size, write_text
from manytouch.sinks.pictures.surface_picture import BusiestFrame, SelectedFrames, SurfacePicture
from manytouch.sinks.surface_grid import surface_grid
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


def test_labels_stay_inside_and_apart(sensor, reading_of, contact_of):
    corners = [(0.0, 0.0), (319.0, 0.0), (0.0, 239.0), (319.0, 239.0), (160.0, 120.0), (161.0, 121.0)]
    contacts = tuple(
        contact_of(number, centre_px=np.array(place), depth_mm=1.0 + number)
        for number, place in enumerate(corners)
    )
    assert Annotator(sensor)(reading_of(0, contacts)).shape[1] == 960


def test_deep_pixels_keep_their_contrast(sensor, reading_of):
    deep = np.linspace(0, 4000, 320 * 240).reshape(240, 320).astype(np.uint16)
    drawn = eight_bit_colour(deep, 4000.0)
    assert drawn.dtype == np.uint8
    assert (drawn.min(), drawn.max()) == (0, 255)
    frame = dataclasses.replace(reading_of(0).frame, image=deep)
    assert Annotator(sensor)(dataclasses.replace(reading_of(0), frame=frame)).max() == 255


def test_plus_minus_is_as_wide_as_a_plus():
    assert text_size("1.0 ± 0.1", 20.0) == text_size("1.0 + 0.1", 20.0)
    plain, signed = np.zeros((2, 60, 200, 3), np.uint8)
    write_text(plain, "+", (10.0, 40.0), 20.0, (255, 255, 255))
    write_text(signed, "±", (10.0, 40.0), 20.0, (255, 255, 255))
    assert signed[38:44].sum() > plain[38:44].sum()


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


def test_depth_map_reproduces_a_plane_and_covers_the_markers(sensor, reading_of):
    reading = reading_of(0)
    rest = sensor.layout.rest_mm
    displacement = np.zeros_like(rest)
    displacement[:, 2] = -(1.0 + 0.05 * rest[:, 0] - 0.1 * rest[:, 1])
    grid = surface_grid(sensor)
    depth = grid.sampler.depth(dataclasses.replace(reading.surface, displacement_mm=displacement))
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    assert depth.shape == (len(grid.y_mm), len(grid.x_mm))
    assert grid.x_mm[0] <= rest[:, 0].min()
    assert grid.y_mm[-1] >= rest[:, 1].max()
    assert depth == pytest.approx(1.0 + 0.05 * x - 0.1 * y, abs=1e-6)


def test_depth_map_is_not_known_around_an_unseen_marker_only(sensor, reading_of):
    grid = surface_grid(sensor)
    depth = grid.sampler.depth(reading_of(0, unseen=(10,), depth_mm=0.5).surface)
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    unknown = sensor.layout.rest_mm[[9, 10]]
    away = np.min([np.hypot(x - marker[0], y - marker[1]) for marker in unknown], axis=0)
    assert np.isnan(depth[away < 1.0]).all()
    assert depth[away > 6.0] == pytest.approx(0.5, abs=1e-6)


def test_depth_map_of_nothing_is_not_known(sensor, reading_of):
    assert np.isnan(surface_grid(sensor).sampler.depth(reading_of(0, unseen=tuple(range(24))).surface)).all()


def test_depth_store_has_dimensions_coordinates_and_all_frames(tmp_path, sensor, reading_of):
    zarr = pytest.importorskip("zarr")
    sink = SurfaceStore(tmp_path, sensor)
    for index in range(19):
        sink.write(reading_of(2 * index, depth_mm=0.1 * index))
    assert not (tmp_path / "surface.zarr").exists()
    sink.close()
    group = zarr.open_group(tmp_path / "surface.zarr", mode="r")
    depth = group["depth_mm"]
    assert group.metadata.zarr_format == 3
    assert depth.metadata.dimension_names == ("frame", "y", "x")
    assert depth.shape == (19, group["y"].shape[0], group["x"].shape[0])
    assert list(group["frame"][:]) == list(range(0, 38, 2))
    assert group["time_s"][18] == pytest.approx(36 * 0.04)
    assert depth.attrs["units"] == group["y"].attrs["units"] == "mm"
    assert np.nanmax(np.abs(depth[18] - 1.8)) < 1e-5
    assert group["depth_std_mm"].shape == group["strain"].shape == depth.shape
    assert np.nanmax(np.abs(group["strain"][18])) < 1e-6
    assert group["strain"].attrs["units"] == "1"


def test_picture_of_the_frame_with_most_contacts(tmp_path, sensor, reading_of, contact_of):
    pytest.importorskip("matplotlib")
    busiest = BusiestFrame(sensor)
    assert busiest.draw(tmp_path / "none.png") is None
    busiest.write(reading_of(0))
    busiest.write(reading_of(1, (contact_of(1, depth_mm=1.0), contact_of(2, depth_mm=1.0))))
    busiest.write(reading_of(2, (contact_of(1, depth_mm=2.0), contact_of(2, depth_mm=1.0))))
    busiest.write(reading_of(3, (contact_of(1, depth_mm=9.0),)))
    busiest.close()
    assert busiest.reading.frame.index == 2
    assert busiest.draw(tmp_path / "picture.png") == tmp_path / "picture.png"
    assert [path.name for path in tmp_path.iterdir()] == ["picture.png"]
    assert min(cv2.imread(str(tmp_path / "picture.png")).shape[:2]) > 400


def test_pictures_of_chosen_frames(tmp_path, sensor, reading_of, contact_of):
    pytest.importorskip("matplotlib")
    chosen = SelectedFrames(tmp_path, sensor, (1, 5))
    for index in range(3):
        chosen.write(reading_of(index, (contact_of(),)))
    chosen.close()
    assert chosen.missing == [5]
    assert [path.name for path in tmp_path.iterdir()] == ["picture-000001.png"]
    assert min(cv2.imread(str(tmp_path / "picture-000001.png")).shape[:2]) > 400


def test_picture_states_units_and_exaggeration(sensor_of, reading_of, contact_of):
    pytest.importorskip("matplotlib")
    sensor = sensor_of("pitch")
    figure = SurfacePicture(sensor).figure(reading_of(4, (contact_of(),), depth_mm=0.5))
    _, surface, scale = figure.axes
    assert "(pitch)" in surface.get_xlabel()
    assert "(pitch)" in scale.get_ylabel()
    assert "magnified" in surface.get_title()
    assert any("#1" in text.get_text() for text in surface.texts)


def test_picture_of_an_unknown_surface_does_not_fail(sensor, reading_of):
    pytest.importorskip("matplotlib")
    reading = reading_of(0, unseen=tuple(range(24)), status=Status.DECODE_ERROR)
    SurfacePicture(sensor).figure(reading).canvas.draw()
