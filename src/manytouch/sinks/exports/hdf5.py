"""A recording as HDF5: tables, surface and images, with units as attributes.

/contacts, /frames, /markers   a data set per column of `manytouch process`
/surface                       depth_mm and depth_std_mm over (time, y, x), with dimension scales:
                               xarray.open_dataset(path, group="surface")
/images                        the encoded images, as the camera sent them
"""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from manytouch.errors import MissingExtraError
from manytouch.recording.reader import Recording
from manytouch.sinks.display_grid import display_grid
from manytouch.sinks.exports.parquet import attributes_of, description, tables
from manytouch.sinks.exports.readings import frames_of, readings_of
from manytouch.sinks.files.sensor_description import layout_of

FRAMES_PER_CHUNK = 8
COMPRESSION = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


def write_hdf5(recordings: Sequence[Recording], path: Path) -> None:
    """Write one recording.

    Raises:
        MissingExtraError: h5py is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise MissingExtraError("HDF5", "h5py", "connect") from None
    (recording,) = recordings
    with h5py.File(path, "w") as file, tempfile.TemporaryDirectory() as scratch:
        file.attrs["manytouch"] = json.dumps(description(recording.sensor, recording.about))
        for name, table in tables(recording, Path(scratch)):
            if name != "regions":  # polygons are in the Parquet tables
                _put_table(file.create_group(name), table)
        _put_surface(file.create_group("surface"), recording)
        _put_images(file.create_group("images"), recording)


def _put_table(group: Any, table: pa.Table) -> None:
    import h5py

    for name in table.column_names:
        column = table[name]
        if pa.types.is_string(column.type):
            texts = ["" if value is None else value for value in column.to_pylist()]
            group.create_dataset(name, data=texts, dtype=h5py.string_dtype())
            continue
        values = column.to_numpy(zero_copy_only=False)
        if values.dtype == object:  # integers or truth values of which some are unknown
            values = np.array([np.nan if value is None else float(value) for value in values])
        data = group.create_dataset(name, data=values, **({} if len(values) == 0 else COMPRESSION))
        _describe(data, name)


def _describe(data: Any, name: str) -> None:
    """Set unit and frame of reference of a data set, by its name."""
    for key, value in attributes_of(name).items():
        data.attrs["units" if key == "unit" else key] = value


def _put_surface(group: Any, recording: Recording) -> None:
    sensor = recording.sensor
    unit, grid = sensor.length_unit, display_grid(layout_of(sensor))
    shape = (len(grid.y_mm), len(grid.x_mm))
    for name, values in ((f"x_{unit}", grid.x_mm), (f"y_{unit}", grid.y_mm)):
        scale = group.create_dataset(name, data=values)
        scale.attrs["units"] = unit
        scale.make_scale(name)
    texts = {"depth": "displacement along -z", "depth_std": "standard deviation of the depth"}
    maps = {}
    for name, text in texts.items():
        maps[name] = group.create_dataset(
            f"{name}_{unit}",
            shape=(0, *shape),
            maxshape=(None, *shape),
            chunks=(FRAMES_PER_CHUNK, *shape),
            dtype="f4",
            **COMPRESSION,
        )
        maps[name].attrs.update({"units": unit, "frame": "sheet", "long_name": text})
    times_s = []
    for place, reading in enumerate(readings_of(recording)):
        for each in maps.values():
            each.resize(place + 1, axis=0)
        maps["depth"][place] = grid.sampler.depth(reading.surface)
        maps["depth_std"][place] = grid.sampler.depth_std(reading.surface)
        times_s.append(reading.frame.timestamp_ns * 1e-9)
    time = group.create_dataset("time_s", data=np.array(times_s, np.float64))
    _describe(time, "time_s")
    time.make_scale("time_s")
    for axis, name in enumerate(("time_s", f"y_{unit}", f"x_{unit}")):
        for each in maps.values():
            each.dims[axis].attach_scale(group[name])


def _put_images(group: Any, recording: Recording) -> None:
    import h5py

    kind = h5py.vlen_dtype(np.uint8)
    images = group.create_dataset("encoded", shape=(len(recording),), dtype=kind)
    images.attrs["format"] = "JPEG or PNG, as the camera sent it"
    times_s = np.zeros(len(recording))
    for place, (frame, _) in enumerate(frames_of(recording)):
        images[place] = np.frombuffer(frame.encoded or b"", np.uint8)
        times_s[place] = frame.timestamp_ns * 1e-9
    _describe(group.create_dataset("time_s", data=times_s), "time_s")
