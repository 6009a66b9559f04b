"""The folder that `manytouch simulate` writes: images, sensor file, and tables of the ground truth."""

from pathlib import Path
from types import TracebackType

import cv2
import numpy as np

from manytouch.simulation.scene.motion import HeldPress
from manytouch.sinks.files.atomic_output import output_errors
from manytouch.sinks.files.regions import RegionTable
from manytouch.sinks.files.result_folder import ResultFolder
from manytouch.sinks.files.simulated.true_press_table import TruePressTable
from manytouch.sinks.files.tables import ContactTable, MarkerTable
from manytouch.values import Detections, Frame, Reading, Sensor, Truth
from manytouch.values.arrays import read_only
from manytouch.values.sensor_file.write import save_sensor

FAST_PNG = 1


class SimulatedFolder:
    """frames/000000.png and on, sensor.toml, truth/contacts.csv, regions.parquet and markers.parquet.

    If bodies press and rest, also truth/presses.csv: a table for `calibrate sheet`, with what a scale would
    show.

    They replace those of an earlier run at the end of its block, unless it ends with an error.
    """

    def __init__(self, folder: Path, sensor: Sensor, presses: tuple[HeldPress, ...] = ()) -> None:
        self._folder = ResultFolder(folder, ("frames", "sensor.toml", "truth"))
        partial = self._folder.partial_path
        self._frames = partial / "frames"
        try:
            with output_errors(folder):
                self._frames.mkdir()
                (partial / "truth").mkdir()
            save_sensor(sensor, partial / "sensor.toml")
            tables = (ContactTable, RegionTable, MarkerTable)
            self._tables = tuple(table(partial / "truth", sensor) for table in tables)
            self._presses = TruePressTable(partial / "truth", presses)
        except BaseException:
            self._folder.close()
            raise

    def __enter__(self) -> "SimulatedFolder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._folder:
            for table in self._tables:
                table.close()
            if error is None:
                self._presses.close()
                self._folder.commit()

    def write(self, frame: Frame, truth: Truth) -> None:
        """Add a frame and its ground truth."""
        path = self._frames / f"{frame.index:06d}.png"
        encoded = b""
        if frame.image is not None:
            options = [cv2.IMWRITE_PNG_COMPRESSION, FAST_PNG]
            encoded = cv2.imencode(".png", np.asarray(frame.image), options)[1].tobytes()
        with output_errors(path):
            path.write_bytes(encoded)
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
        self._presses.write(reading)


def _no_detections() -> Detections:
    return Detections(
        centre_px=read_only(np.empty((0, 2))),
        covariance_px2=read_only(np.empty((0, 2, 2))),
        area_px2=read_only(np.empty(0)),
        contrast=read_only(np.empty(0)),
    )
