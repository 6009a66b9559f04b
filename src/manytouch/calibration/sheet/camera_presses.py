"""Presses before a running camera: each is looked at while it is held, and its pictures are kept."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from manytouch.calibration.marker_tracks import track_markers
from manytouch.calibration.rest.register_rest import register_rest
from manytouch.calibration.sheet.press_table import REST_FRAMES, PressRow
from manytouch.errors import OutputError, SensorError
from manytouch.sources.source import Device, evenly_timed_ns
from manytouch.values import Frame, Sensor

HELD_FRAMES = 8
STALE_FRAMES = 5
"""Pictures that may have waited since before the key was pressed."""
LEAST_MOVED_PX = 0.5

Say = Callable[[str], object]
Ask = Callable[[str], str]


class PressedLive:
    """DotAppearances through a camera when a press is held, and keeps what it saw as pictures.

    Attributes:
        folder: of the pictures; the times of presses are those of a folder of pictures.
    """

    def __init__(self, sensor: Sensor, camera: Device, table: Path, *, say: Say, ask: Ask) -> None:
        """Look at the untouched sheet.

        Args:
            sensor: with its layout.
            camera: running until somebody closes it.
            table: of the presses; the folder gets its name and a number.
            say: prints a sentence.
            ask: prints a prompt and waits for Enter.

        Raises:
            LayoutError: the markers were not found.
            OutputError: the pictures cannot be kept.
        """
        assert sensor.layout is not None
        camera.is_colour = sensor.layout.colour_weights is not None
        self._frames, self._say, self._ask = iter(camera), say, ask
        self.folder = next(
            folder
            for number in range(1, 1000)
            if not (folder := table.with_name(f"{table.stem}-{number}")).exists()
        )
        self._kept = 0
        ask("take your hands off the sheet, then Enter: ")
        self._rest = self._fresh(REST_FRAMES)
        self._sensor = register_rest(sensor, self._rest)
        self._keep(self._rest)

    def __call__(self, row: PressRow) -> PressRow:
        """Wait until the press is held, and tell at which time its pictures stand in the folder.

        Raises:
            SensorError: hardly a marker moved.
            OutputError: the pictures cannot be kept.
        """
        self._ask(f"    press at {row.x_mm:g}, {row.y_mm:g} mm now, hold still, then Enter: ")
        held = self._fresh(HELD_FRAMES)
        seen = track_markers(self._sensor, [*self._rest, *held])
        is_rest = np.arange(len(seen.timestamp_ns)) < len(self._rest)
        moved_px = np.linalg.norm(seen.median_px(~is_rest) - seen.median_px(is_rest), axis=1)
        farthest_px = float(np.nanmax(moved_px, initial=0.0))
        if farthest_px < LEAST_MOVED_PX:
            raise SensorError(
                f"no marker moved by more than {farthest_px:.2f} px: was it pressed, and hard enough?"
            )
        self._say(f"    markers moved by up to {farthest_px:.1f} px; let go now")
        middle = self._kept + HELD_FRAMES // 2
        self._keep(held)
        return replace(row, time_s=1e-9 * evenly_timed_ns(middle, None))

    def _fresh(self, count: int) -> list[Frame]:
        """Some pictures from now on."""
        return list(islice(self._whole(), STALE_FRAMES, STALE_FRAMES + count))

    def _whole(self) -> Iterator[Frame]:
        return (frame for frame in self._frames if frame.image is not None)

    def _keep(self, frames: list[Frame]) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for frame in frames:
                assert frame.image is not None
                _, coded = cv2.imencode(".png", frame.image)
                (self.folder / f"{self._kept:05}.png").write_bytes(coded.tobytes())
                self._kept += 1
        except OSError as error:
            raise OutputError(
                f"cannot keep the pictures of a press in {self.folder}: {error.strerror}"
            ) from None
