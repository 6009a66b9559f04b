"""Noise of the marker positions while nothing touches the sheet."""

from collections import deque

import numpy as np

from manytouch.geometry.centre_noise import BLOCK_FRAMES, block_noise_px, median_of_blocks
from manytouch.sinks.files.sensor_description import pitch_px, rest_px
from manytouch.values import Reading, Sensor, Status
from manytouch.values.arrays import Points2, Scalars

MOST_BLOCKS = 400  # 200 s at 30 frames per second; later frames would change the median little
END_FRAMES = 15  # frames at the end without a contact
END_STDS = 5.0  # a motion of most markers above this many standard deviations of one is no noise
END_SHIFT_PITCHES = 0.02  # what rubber that creeps keeps for a while is less


class RestNoise:
    """`geometry.centre_noise` of the frames without contact, in blocks that no contact interrupts."""

    def __init__(self, markers: int) -> None:
        self._markers = markers
        self._blocks: list[Scalars] = []
        self._positions_px: list[Points2] = []

    def add(self, reading: Reading) -> None:
        """Add a frame; a contact or a status other than `ok` ends the block."""
        if len(self._blocks) >= MOST_BLOCKS:
            return
        if reading.status is not Status.OK or reading.contacts.contacts:
            self._blocks += self._open_block()
            self._positions_px = []
            return
        self._positions_px.append(np.where(reading.grid.is_seen[:, None], reading.grid.position_px, np.nan))
        if len(self._positions_px) == BLOCK_FRAMES:
            self._blocks += self._open_block()
            self._positions_px = []

    def per_marker_px(self) -> Scalars:
        """(m,) noise of each marker; NaN where it was seen too rarely."""
        blocks = [*self._blocks, *self._open_block()]
        return median_of_blocks(np.stack(blocks) if blocks else np.zeros((0, self._markers)))

    def _open_block(self) -> list[Scalars]:
        return [block_noise_px(np.stack(self._positions_px))] if self._positions_px else []


class EndShift:
    """How far the markers are from their rest positions at the end, while no contact is found."""

    def __init__(self, sensor: Sensor) -> None:
        self._rest_px = rest_px(sensor)
        self._pitch_px = float(np.nanmean(pitch_px(sensor)))
        self._frames = 0
        self._last_px: deque[Points2] = deque(maxlen=END_FRAMES)

    def add(self, reading: Reading) -> None:
        """Add a frame; one with a contact or without usable markers begins the end again."""
        self._frames += 1
        if reading.contacts.contacts:
            self._last_px.clear()
        elif reading.status is Status.OK:
            self._last_px.append(reading.grid.position_px)

    def warnings(self, noise_px: float | None) -> list[str]:
        """A warning if most markers are not at rest at the end, although nothing was found to touch."""
        if len(self._last_px) < END_FRAMES or self._frames < 4 * END_FRAMES or noise_px is None:
            return []
        seen = np.isfinite(np.stack(self._last_px)).all(axis=(0, 2))
        if not seen.any():
            return []
        place_px = np.median(np.stack(self._last_px)[:, seen], axis=0)
        shift_px = float(np.median(np.linalg.norm(place_px - self._rest_px[seen], axis=1)))
        if shift_px <= max(END_STDS * noise_px, END_SHIFT_PITCHES * self._pitch_px):
            return []
        return [
            f"the markers are {shift_px:.1f} px (median) away from their rest positions at the end, although "
            "no contact is found there: the sensor or the camera has moved, or something still touches. "
            "Depths and forces after that may be wrong: fix the camera and the sheet, or process the parts "
            "of the recording separately"
        ]
