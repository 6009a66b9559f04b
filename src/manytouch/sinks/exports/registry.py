"""The formats of exports, in one place."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from manytouch.errors import OutputError
from manytouch.recording.reader import Recording, open_recording
from manytouch.sinks.exports.hdf5 import write_hdf5
from manytouch.sinks.exports.lerobot import write_lerobot
from manytouch.sinks.exports.parquet import write_parquet
from manytouch.sinks.exports.ros2bag import write_ros2bag
from manytouch.sinks.files.atomic_output import output_errors, remove
from manytouch.sinks.ros2.messages import UNKNOWN_SCALE

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A format of exports.

    Attributes:
        purpose: what it is for.
        result: what is written into the folder, with NAME for the stem of the recording.
        suffix: of the result of one recording; None: all recordings together are one result.
        write: writes recordings to a path that does not exist.
        is_metric: its lengths are metres; it cannot state that they are pitches.
    """

    purpose: str
    result: str
    suffix: str | None
    write: Callable[[Sequence[Recording], Path], None]
    is_metric: bool = False


FORMATS: Mapping[str, Format] = {
    "ros2bag": Format(
        purpose="ROS 2 bag (MCAP) with the topics of --to ros2:// and sensor_msgs/CompressedImage",
        result="NAME/",
        suffix="",
        write=write_ros2bag,
        is_metric=True,
    ),
    "lerobot": Format(
        purpose="LeRobot data set v3.0, an episode per recording",
        result="data/, meta/, videos/",
        suffix=None,
        write=write_lerobot,
    ),
    "hdf5": Format(
        purpose="HDF5 with units as attributes; xarray opens it",
        result="NAME.h5",
        suffix=".h5",
        write=write_hdf5,
    ),
    "parquet": Format(
        purpose="Parquet tables for pandas, polars, DuckDB",
        result="NAME/*.parquet",
        suffix="",
        write=write_parquet,
    ),
}


def export(
    paths: Sequence[Path],
    format_name: str,
    folder: Path,
    on_warning: Callable[[str], None] = lambda sentence: None,
) -> list[Path]:
    """Write recordings in another format.

    Args:
        paths: the recordings; of a rig with the name of a sensor, as in hand.mcap#index.
        format_name: a key of `FORMATS`.
        folder: where the results go; of a format with one result for all recordings the result itself.
        on_warning: is called before anything is written, with a sentence for each recording that is not
            whole, or whose lengths the format cannot state.

    Returns:
        The results.

    Raises:
        SourceError: a file is not a recording.
        OutputError: a result exists, or cannot be written; earlier results are complete.
        MissingExtraError: a package is not installed.
    """
    found = FORMATS[format_name]
    recordings = [open_recording(path) for path in paths]
    for recording in recordings:
        if recording.damage is not None:
            on_warning(recording.damage)
        if found.is_metric and recording.sensor.length_unit != "mm":
            on_warning(f"{recording.path.name}: {UNKNOWN_SCALE}")
    if found.suffix is None:
        return [_written(found, recordings, folder)]
    names = _names(recordings)
    return [
        _written(found, [recording], folder / f"{name}{found.suffix}")
        for recording, name in zip(recordings, names, strict=True)
    ]


def _written(found: Format, recordings: Sequence[Recording], path: Path) -> Path:
    """Write next to the final place, and rename."""
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise OutputError(f"{str(path)!r} exists: remove it, or choose another folder")
    scratch = path.with_name(f".{path.name}.partial")
    partial = scratch / path.name  # rosbags names files like the folder
    with output_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        remove(scratch)
        scratch.mkdir()
        try:
            found.write(recordings, partial)
            if path.is_dir():
                path.rmdir()
            partial.replace(path)
        finally:
            remove(scratch)
    return path


def _names(recordings: Sequence[Recording]) -> list[str]:
    """Stems of the recordings, with the sensor of a rig, and with numbers where they are equal."""
    taken: set[str] = set()
    names = []
    for recording in recordings:
        sensor = "" if recording.rig_sensor is None else f"-{recording.rig_sensor}"
        stem = recording.path.stem if recording.path.stem.strip(".") else "recording"
        name, number = f"{stem}{sensor}", 1
        while name.casefold() in taken:
            number += 1
            name = f"{stem}{sensor}-{number}"
        taken.add(name.casefold())
        names.append(name)
    return names
