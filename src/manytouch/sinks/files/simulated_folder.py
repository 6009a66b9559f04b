"""The folder that `manytouch simulate` writes: images, sensor file, and tables of the ground truth."""

from pathlib import Path

import cv2
import numpy as np

from manytouch.errors import OutputError
from manytouch.sinks.files.atomic_output import AtomicOutput, output_errors
from manytouch.sinks.files.tables import ContactTable, MarkerTable
from manytouch.values import Detections, Frame, Reading, Sensor, Truth
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file import save_sensor

FAST_PNG = 1


class SimulatedFolder:
    """frames/000000.png and on, sensor.toml, truth/contacts.csv, truth/markers.parquet.

    The sensor file is there at once; the rest appears when it is complete.
    """

    def __init__(self, folder: Path, sensor: Sensor) -> None:
        self._frames = AtomicOutput(folder / "frames")
        with output_errors(folder):
            self._frames.temporary_path.mkdir()
            (folder / "truth").mkdir(exist_ok=True)
        save_sensor(sensor, folder / "sensor.toml")
        self._tables = (ContactTable(folder / "truth", sensor), MarkerTable(folder / "truth", sensor))

    def write(self, frame: Frame, truth: Truth) -> None:
        """Add a frame and its ground truth."""
        path = self._frames.temporary_path / f"{frame.index:06d}.png"
        with output_errors(path):
            done = frame.image is not None and cv2.imwrite(
                str(path), np.asarray(frame.image), [cv2.IMWRITE_PNG_COMPRESSION, FAST_PNG]
            )
        if not done:
            raise OutputError(f"cannot write {path}: choose a folder that is writable and has enough space")
        reading = Reading(
            frame=frame,
            detections=_no_detections(),
            grid=truth.grid,
            surface=truth.surface,
            contacts=truth.contacts,
            milliseconds=0.0,
        )
        for table in self._tables:
            table.write(reading)

    def close(self) -> None:
        """Complete all files."""
        for table in self._tables:
            table.close()
        self._frames.commit()


def _no_detections() -> Detections:
    return Detections(
        centre_px=read_only(np.empty((0, 2))),
        covariance_px2=read_only(np.empty((0, 2, 2))),
        area_px2=read_only(np.empty(0)),
        contrast=read_only(np.empty(0)),
    )
