"""`manytouch export`: recordings in the formats of other programs."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from manytouch.cli.terminal import options
from manytouch.cli.terminal.failures import report, usage_error
from manytouch.errors import OutputError
from manytouch.sinks.files.atomic_output import check_writable
from manytouch.source_names import require_existing


def export(
    recordings: Annotated[
        list[Path] | None,
        Parameter(name="RECORDING", negative=(), help="Recordings (.mcap); of a rig FILE#SENSOR."),
    ] = None,
    /,
    *,
    ros2bag: Annotated[Path | None, options.folder("A ROS 2 bag (MCAP) per recording.")] = None,
    lerobot: Annotated[Path | None, options.folder("A LeRobot data set v3.0, an episode each.")] = None,
    hdf5: Annotated[Path | None, options.folder("An HDF5 file per recording.")] = None,
    parquet: Annotated[Path | None, options.folder("Parquet tables, a folder per recording.")] = None,
) -> int:
    """Write recordings in the formats of other programs; without an option, list the formats.

    Several formats may be given; if one fails, the others are written all
    the same. An existing result is never replaced.

    Example: manytouch export press.mcap --hdf5 exported --ros2bag bags
    """
    wanted = {"ros2bag": ros2bag, "lerobot": lerobot, "hdf5": hdf5, "parquet": parquet}
    folders = {name: folder for name, folder in wanted.items() if folder is not None}
    if not folders:
        from manytouch.sinks.exports.registry import FORMATS

        for name, each in FORMATS.items():
            print(f"--{name} DIR".ljust(14), f"{each.purpose}: DIR/{each.result}")
        return 0
    if not recordings:
        raise usage_error("export", "no recording is given: list one or more .mcap files")
    failed: set[str] = set()

    def fail(name: str, error: Exception) -> None:
        report(error, f"--{name}: " if len(folders) > 1 else "")
        failed.add(name)

    for name, folder in folders.items():
        try:
            check_writable(folder)
        except OutputError as error:
            fail(name, error)
    if len(failed) == len(folders):
        return 1
    require_existing(recordings)
    from manytouch.sinks.exports.registry import export as export_recordings

    warned: set[str] = set()

    def warn(sentence: str) -> None:
        if sentence not in warned:  # each format reads the recordings
            print(f"warning: {sentence}", file=sys.stderr)
        warned.add(sentence)

    for name, folder in folders.items():
        if name in failed:
            continue
        try:
            paths = export_recordings(recordings, name, folder, warn)
        except Exception as error:  # noqa: BLE001 - the other formats are written all the same
            fail(name, error)
            continue
        for path in paths:
            print(path)
    return 1 if failed else 0
