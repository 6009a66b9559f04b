"""Figures of the surface in three dimensions."""

import cv2
import numpy as np
import pytest

from manytouch.sinks.pictures.surface_picture import BusiestFrame, SelectedFrames, SurfacePicture
from manytouch.values import Status


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


def test_the_figure_of_an_unknown_surface_has_axes_and_no_surface(sensor, reading_of):
    pytest.importorskip("matplotlib")
    reading = reading_of(0, unseen=tuple(range(24)), status=Status.DECODE_ERROR)
    figure = SurfacePicture(sensor).figure(reading)
    figure.canvas.draw()
    _, surface, scale = figure.axes
    for low, high in (surface.get_xlim(), surface.get_zlim(), scale.get_ylim()):
        assert np.isfinite([low, high]).all()
        assert high > low
    (drawn,) = surface.collections
    assert len(drawn.get_array()) == 0 or np.ma.masked_invalid(drawn.get_array()).mask.all()
