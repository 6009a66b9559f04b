"""The dense depth map of every frame, as a Zarr store that xarray opens.

import xarray
depth = xarray.open_zarr("out/press/surface.zarr").depth_mm
"""

import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from manytouch.errors import MissingExtraError
from manytouch.sinks.depth_map import DepthMap
from manytouch.sinks.staging import Staged, told
from manytouch.sinks.tables import time_s
from manytouch.values import Reading, Sensor

FRAMES_PER_CHUNK = 16


def require_zarr() -> None:
    """Refuse early where the package is not installed.

    Raises:
        MissingExtraError: it is not.
    """
    if find_spec("zarr") is None:
        raise MissingExtraError("the depth map", "zarr", "surface")


class SurfaceMap:
    """surface.zarr: depth over (frame, y, x), NaN where not known, with coordinates and units."""

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        require_zarr()
        import zarr

        self._unit = sensor.length_unit
        self._map = DepthMap(sensor)
        self._staged = Staged(folder / "surface.zarr")
        with told(self._staged.path):
            self._group: Any = zarr.create_group(str(self._staged.aside), zarr_format=3)
        self._group.attrs.update({"title": f"depth of the sheet of {sensor.name}", "unit": self._unit})
        axis = {"units": self._unit, "long_name": "undeformed sheet coordinate"}
        self._coordinate("x", self._map.x_mm, axis)
        self._coordinate("y", self._map.y_mm, axis)
        shape = (len(self._map.y_mm), len(self._map.x_mm))
        self._depth = self._array(f"depth_{self._unit}", shape, "float32", ("frame", "y", "x"))
        self._depth.attrs.update(
            {
                "units": self._unit,
                "long_name": "depth of the camera-side face, positive when pressed",
                "coordinates": "time_s",
            }
        )
        self._frame = self._array("frame", (), "int64", ("frame",))
        self._frame.attrs["long_name"] = "number of the frame in its input"
        self._time = self._array("time_s", (), "float64", ("frame",))
        self._time.attrs.update({"units": "s", "long_name": "time since the input's start"})
        self._waiting: list[tuple[int, float, Float64[np.ndarray, "y x"]]] = []

    def write(self, reading: Reading) -> None:
        """Add a frame."""
        depth = self._map(reading.surface)
        self._waiting.append((reading.frame.index, time_s(reading.frame.timestamp_ns), depth))
        if len(self._waiting) == FRAMES_PER_CHUNK:
            self._append()

    def close(self) -> None:
        """Complete the store."""
        import zarr

        self._append()
        with told(self._staged.path), warnings.catch_warnings():
            # xarray looks for consolidated metadata; zarr warns that format 3 does not define them yet
            warnings.filterwarnings("ignore", message="Consolidated metadata", category=UserWarning)
            zarr.consolidate_metadata(self._group.store)
        self._staged.finish()

    def _append(self) -> None:
        if not self._waiting:
            return
        frames, times, depths = zip(*self._waiting, strict=True)
        with told(self._staged.path):
            self._frame.append(np.array(frames, dtype=np.int64))
            self._time.append(np.array(times))
            self._depth.append(np.stack(depths).astype(np.float32))
        self._waiting = []

    def _array(self, name: str, shape: tuple[int, ...], kind: str, dimensions: tuple[str, ...]) -> Any:
        """An array that grows with the frames."""
        fill = np.nan if kind.startswith("float") else 0
        with told(self._staged.path):
            return self._group.create_array(
                name,
                shape=(0, *shape),
                chunks=(FRAMES_PER_CHUNK, *shape),
                dtype=kind,
                fill_value=fill,
                dimension_names=dimensions,
            )

    def _coordinate(self, name: str, values: np.ndarray, attributes: dict[str, str]) -> None:
        with told(self._staged.path):
            array = self._group.create_array(
                name, shape=values.shape, chunks=values.shape, dtype="float64", dimension_names=(name,)
            )
            array[:] = values
        array.attrs.update(attributes)
