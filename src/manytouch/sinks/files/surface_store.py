"""The surface of every frame as a Zarr store: depth, its standard deviation, strain and pressure on a grid.

import xarray
depth = xarray.open_zarr("out/press/surface.zarr").depth_mm
"""

import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from manytouch.errors import MissingExtraError
from manytouch.sinks.display_grid import DisplayGrid, display_grid
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.sensor_description import layout_of
from manytouch.sinks.files.tables import time_s
from manytouch.values import Reading, Sensor

FRAMES_PER_CHUNK = 16


def require_zarr() -> None:
    """Check that zarr is installed.

    Raises:
        MissingExtraError: it is not.
    """
    if find_spec("zarr") is None:
        raise MissingExtraError("the depth map", "zarr", "lab")


class SurfaceStore:
    """surface.zarr: arrays over (frame, y, x) with coordinates and units; NaN where not known."""

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        require_zarr()
        self._unit = sensor.length_unit
        grid = display_grid(layout_of(sensor))
        self._sampler = grid.sampler
        self._path = folder / "surface.zarr"
        self._pending: list[tuple[int, float, dict[str, np.ndarray]]] = []
        with output_errors(self._path):
            self._create(sensor, grid)

    def write(self, reading: Reading) -> None:
        """Add a frame."""
        surface, sampler = reading.surface, self._sampler
        found = {
            "depth": sampler.depth(surface),
            "depth_std": sampler.depth_std(surface),
            "strain": sampler.strain(surface),
        }
        if "pressure" in self._arrays:
            found["pressure"] = sampler.pressure_kPa(surface)
        self._pending.append((reading.frame.index, time_s(reading.frame.timestamp_ns), found))
        if len(self._pending) == FRAMES_PER_CHUNK:
            self._append()

    def close(self) -> None:
        """Complete the store."""
        import zarr

        self._append()
        with output_errors(self._path), warnings.catch_warnings():
            # xarray looks for consolidated metadata; zarr warns that format 3 does not define them yet
            warnings.filterwarnings("ignore", message="Consolidated metadata", category=UserWarning)
            zarr.consolidate_metadata(self._group.store)

    def _append(self) -> None:
        if not self._pending:
            return
        frames, times, found = zip(*self._pending, strict=True)
        with output_errors(self._path):
            self._frame.append(np.array(frames, dtype=np.int64))
            self._time.append(np.array(times))
            for name, array in self._arrays.items():
                array.append(np.stack([fields[name] for fields in found]).astype(np.float32))
        self._pending = []

    def _create(self, sensor: Sensor, grid: DisplayGrid) -> None:
        """Create the empty arrays."""
        import zarr

        self._group: Any = zarr.create_group(str(self._path), zarr_format=3)
        self._group.attrs.update({"title": f"the sheet of {sensor.name}", "unit": self._unit})
        axis = {"units": self._unit, "long_name": "undeformed sheet coordinate"}
        self._coordinate("x", grid.x_mm, axis)
        self._coordinate("y", grid.y_mm, axis)
        shape = (len(grid.y_mm), len(grid.x_mm))
        self._arrays: dict[str, Any] = {
            name: self._map(f"{name}_{unit}" if unit else name, shape, unit, description)
            for name, unit, description in (
                ("depth", self._unit, "depth of the camera-side face, positive when pressed"),
                ("depth_std", self._unit, "standard deviation of the depth"),
                ("strain", "", "largest principal Green-Lagrange strain of the camera-side face"),
                ("pressure", "kPa", "normal force per area, positive in compression"),
            )
            if name != "pressure" or (sensor.sheet is not None and sensor.sheet.young_MPa is not None)
        }
        self._frame = self._array("frame", (), "int64", ("frame",))
        self._frame.attrs["long_name"] = "number of the frame in its input"
        self._time = self._array("time_s", (), "float64", ("frame",))
        self._time.attrs.update({"units": "s", "long_name": "time since the input's start"})

    def _map(self, name: str, shape: tuple[int, ...], unit: str, description: str) -> Any:
        array = self._array(name, shape, "float32", ("frame", "y", "x"))
        array.attrs.update({"units": unit or "1", "long_name": description, "coordinates": "time_s"})
        return array

    def _array(self, name: str, shape: tuple[int, ...], kind: str, dimensions: tuple[str, ...]) -> Any:
        """An array that grows with the frames."""
        fill = np.nan if kind.startswith("float") else 0
        return self._group.create_array(
            name,
            shape=(0, *shape),
            chunks=(FRAMES_PER_CHUNK, *shape),
            dtype=kind,
            fill_value=fill,
            dimension_names=dimensions,
        )

    def _coordinate(self, name: str, values: np.ndarray, attributes: dict[str, str]) -> None:
        array = self._group.create_array(
            name, shape=values.shape, chunks=values.shape, dtype="float64", dimension_names=(name,)
        )
        array[:] = values
        array.attrs.update(attributes)
