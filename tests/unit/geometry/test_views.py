"""Several cameras on one sheet: one place for each marker, one image for each marker."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.errors import LayoutError
from manytouch.geometry.camera import onto_plane, project, view_of
from manytouch.geometry.views.merging import merged_grid, side_by_side
from manytouch.geometry.views.view_sensors import ViewSensor, view_sensors
from manytouch.simulation.demo_sensor import skin_sensor
from manytouch.values import Frame, Layout, Sensor, Status, TrackedGrid
from manytouch.values.sensor import camera_of_views


@pytest.fixture(scope="module")
def sensor() -> Sensor:
    """The left camera is turned a little, and its picture is higher than the other."""
    skin = skin_sensor(1280)
    left, right = (view.camera for view in skin.camera.views)
    left = replace(left, height_px=780, cy_px=389.5, rotation_vector=np.array([0.01, -0.02, 0.015]))
    return replace(skin, camera=camera_of_views({"left": left, "right": right}))


def layout_of(sensor: Sensor) -> Layout:
    assert sensor.layout is not None
    return sensor.layout


def grid_of(view: ViewSensor) -> TrackedGrid:
    """What a view without errors tracks at rest."""
    layout, count = layout_of(view.sensor), len(view.marker)
    return TrackedGrid(
        position_px=project(view.view.camera, layout.rest_mm),
        covariance_px2=np.zeros((count, 2, 2)),
        is_seen=np.ones(count, dtype=np.bool_),
        frames_unseen=np.zeros(count, dtype=np.int64),
    )


def test_places_of_the_sheet_come_back_from_their_pixels(sensor: Sensor) -> None:
    rest_mm = layout_of(sensor).rest_mm
    again_mm = onto_plane(sensor.camera, project(sensor.camera, rest_mm))
    assert np.abs(again_mm - rest_mm).max() < 1e-6


def test_every_marker_has_the_image_of_one_view_and_seam_markers_are_in_both(sensor: Sensor) -> None:
    views, rest_mm = view_sensors(sensor), layout_of(sensor).rest_mm
    own = np.concatenate([view.marker[view.is_own] for view in views])
    assert sorted(own) == list(range(len(rest_mm)))
    both = np.intersect1d(*(view.marker for view in views))
    assert len(both) > 100
    assert np.abs(rest_mm[both, 0]).max() < 30.0
    for view in views:
        layout, place_px = layout_of(view.sensor), project(view.view.camera, layout_of(view.sensor).rest_mm)
        assert np.array_equal(layout.rest_mm, rest_mm[view.marker])
        assert (place_px > 0).all()
        assert (place_px < [view.view.camera.width_px - 1, view.view.camera.height_px - 1]).all()


def test_merged_markers_are_where_the_whole_camera_shows_them(sensor: Sensor) -> None:
    views, layout = view_sensors(sensor), layout_of(sensor)
    grids = [grid_of(view) for view in views]
    merged = merged_grid(views, grids, len(layout.rest_mm))
    assert np.abs(merged.position_px - project(sensor.camera, layout.rest_mm)).max() < 1e-9
    assert merged.is_seen.all()
    blind = replace(grids[1], is_seen=np.zeros_like(grids[1].is_seen), status=Status.FEW_MARKERS)
    half = merged_grid(views, [grids[0], blind], len(layout.rest_mm))
    assert half.status is Status.FEW_MARKERS
    assert not half.is_compressed
    one = merged_grid(views, [grids[0], replace(grids[1], is_compressed=True)], len(layout.rest_mm))
    assert one.is_compressed
    assert np.array_equal(half.is_seen, view_of(sensor.camera, layout.rest_mm) == 0)


def test_pictures_are_the_parts_of_the_frame(sensor: Sensor) -> None:
    random = np.random.default_rng(1)
    pictures = [
        Frame(
            index=7,
            timestamp_ns=9,
            camera=view.name,
            image=random.integers(0, 255, (view.camera.height_px, view.camera.width_px), dtype=np.uint8),
        )
        for view in sensor.camera.views
    ]
    frame = side_by_side(pictures)
    assert frame.image is not None
    assert frame.image.shape == (sensor.camera.height_px, sensor.camera.width_px)
    for view, picture in zip(view_sensors(sensor), pictures, strict=True):
        assert np.array_equal(view.picture(frame).image, picture.image)
    assert side_by_side([pictures[0], replace(pictures[1], image=None)]).image is None
    assert not frame.is_predicted
    assert side_by_side([pictures[0], replace(pictures[1], is_predicted=True)]).is_predicted


def test_a_view_beside_the_sheet_is_refused_by_name(sensor: Sensor) -> None:
    left, right = (view.camera for view in sensor.camera.views)
    away = replace(right, translation_mm=np.array([900.0, 0.0, 116.3]))
    with pytest.raises(LayoutError, match="view 'right' of the sensor 'skin' shows fewer than four markers"):
        view_sensors(replace(sensor, camera=camera_of_views({"left": left, "right": away})))
