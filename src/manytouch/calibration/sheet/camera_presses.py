"""Presses with a live camera: each is measured while it is held, and its frames are saved as images."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from manytouch.calibration.marker_tracks import track_markers
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.sheet.press_table import UNTOUCHED_FRAMES, PressRow
from manytouch.errors import OutputError, SensorError
from manytouch.sources.source import Source, evenly_timed_ns
from manytouch.values import Frame, Sensor

HELD_FRAMES = 8
STALE_FRAMES = 5
"""Frames that may have been buffered before Enter was pressed."""
MIN_MOTION_PX = 0.5

Print = Callable[[str], object]
Prompt = Callable[[str], str]


class CameraPresses:
    """Measures presses with a camera and saves the frames of each as images.

    Attributes:
        folder: of the images; times of the presses are those of a source of images without a rate.
    """

    def __init__(self, sensor: Sensor, camera: Source, table: Path, *, report: Print, prompt: Prompt) -> None:
        """Measure the untouched sheet.

        Args:
            sensor: with its layout.
            camera: open; it is not closed here.
            table: CSV file of the presses; the images go to a new folder near it, such as `table-1`.
            report: prints a sentence.
            prompt: prints a prompt and returns the line that is typed.

        Raises:
            LayoutError: the markers are not found.
            OutputError: the images cannot be saved.
        """
        assert sensor.layout is not None
        device = camera.capabilities.device
        if device is not None:
            device.is_colour = sensor.layout.colour_weights is not None
        self._frames, self._report, self._prompt = iter(camera), report, prompt
        self.folder = next(
            folder
            for number in range(1, 1000)
            if not (folder := table.with_name(f"{table.stem}-{number}")).exists()
        )
        self._saved = 0
        prompt("release the sheet, then press Enter: ")
        self._rest = self._next_frames(UNTOUCHED_FRAMES)
        self._sensor = register_rest(sensor, self._rest)
        self._save(self._rest)

    def __call__(self, row: PressRow) -> PressRow:
        """Wait until the press is held, save its frames, and return it with their time in the folder.

        Raises:
            SensorError: no marker moved by `MIN_MOTION_PX`.
            OutputError: the images cannot be saved.
        """
        self._prompt(f"    press at {row.x_mm:g}, {row.y_mm:g} mm, hold still, then press Enter: ")
        held = self._next_frames(HELD_FRAMES)
        seen = track_markers(self._sensor, [*self._rest, *held])
        is_rest = np.arange(len(seen.timestamp_ns)) < len(self._rest)
        moved_px = np.linalg.norm(seen.median_px(~is_rest) - seen.median_px(is_rest), axis=1)
        farthest_px = float(np.nanmax(moved_px, initial=0.0))
        if farthest_px < MIN_MOTION_PX:
            raise SensorError(
                f"the markers moved by at most {farthest_px:.2f} px, {MIN_MOTION_PX:g} px are needed: press "
                "harder, or check the position"
            )
        self._report(f"    markers moved by up to {farthest_px:.1f} px; release the sheet")
        middle = self._saved + HELD_FRAMES // 2
        self._save(held)
        return replace(row, time_s=1e-9 * evenly_timed_ns(middle, None))

    def _next_frames(self, count: int) -> list[Frame]:
        """The next frames that are not older than this call."""
        return list(islice(self._decoded_frames(), STALE_FRAMES, STALE_FRAMES + count))

    def _decoded_frames(self) -> Iterator[Frame]:
        return (frame for frame in self._frames if frame.image is not None)

    def _save(self, frames: list[Frame]) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for frame in frames:
                assert frame.image is not None
                _, coded = cv2.imencode(".png", frame.image)
                (self.folder / f"{self._saved:05}.png").write_bytes(coded.tobytes())
                self._saved += 1
        except OSError as error:
            raise OutputError(
                f"cannot save the images of a press in {self.folder}: {error.strerror}"
            ) from None
