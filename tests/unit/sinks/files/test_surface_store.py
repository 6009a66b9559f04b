"""surface.zarr and the grid that it is sampled on."""

import dataclasses

import numpy as np
import pytest

from manytouch.sinks.display_grid import display_grid
from manytouch.sinks.files.surface_store import SurfaceStore


def test_depth_map_reproduces_a_plane_and_covers_the_markers(sensor, reading_of):
    reading = reading_of(0)
    rest = sensor.layout.rest_mm
    displacement = np.zeros_like(rest)
    displacement[:, 2] = -(1.0 + 0.05 * rest[:, 0] - 0.1 * rest[:, 1])
    grid = display_grid(sensor.layout)
    depth = grid.sampler.depth(dataclasses.replace(reading.surface, displacement_mm=displacement))
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    assert depth.shape == (len(grid.y_mm), len(grid.x_mm))
    assert grid.x_mm[0] <= rest[:, 0].min()
    assert grid.y_mm[-1] >= rest[:, 1].max()
    assert depth == pytest.approx(1.0 + 0.05 * x - 0.1 * y, abs=1e-6)


def test_depth_map_is_not_known_around_an_unseen_marker_only(sensor, reading_of):
    grid = display_grid(sensor.layout)
    depth = grid.sampler.depth(reading_of(0, unseen=(10,), depth_mm=0.5).surface)
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    unknown = sensor.layout.rest_mm[[9, 10]]
    away = np.min([np.hypot(x - marker[0], y - marker[1]) for marker in unknown], axis=0)
    assert np.isnan(depth[away < 1.0]).all()
    assert depth[away > 6.0] == pytest.approx(0.5, abs=1e-6)


def test_depth_map_of_nothing_is_not_known(sensor, reading_of):
    assert np.isnan(
        display_grid(sensor.layout).sampler.depth(reading_of(0, unseen=tuple(range(24))).surface)
    ).all()


def test_depth_store_has_dimensions_coordinates_and_all_frames(tmp_path, sensor, reading_of):
    zarr = pytest.importorskip("zarr")
    sink = SurfaceStore(tmp_path, sensor)
    for index in range(19):
        sink.write(reading_of(2 * index, depth_mm=0.1 * index))
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
