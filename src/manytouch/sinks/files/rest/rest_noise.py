"""Noise of the marker positions while nothing touches the sheet."""

import numpy as np

from manytouch.geometry.centre_noise import BLOCK_FRAMES, block_noise_px, median_of_blocks
from manytouch.values import Reading, Status
from manytouch.values.arrays import Points2, Scalars

MAX_BLOCKS = 400
"""Blocks of which the noise is the median: 200 s at 30 frames per second. Later frames are not used."""


class RestNoise:
    """`geometry.centre_noise` of the frames without contact, in blocks that no contact interrupts."""

    def __init__(self, markers: int) -> None:
        self._markers = markers
        self._blocks: list[Scalars] = []
        self._positions_px: list[Points2] = []

    def add(self, reading: Reading) -> None:
        """Add a frame; a contact or a status other than `ok` ends the block."""
        if len(self._blocks) >= MAX_BLOCKS:
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
