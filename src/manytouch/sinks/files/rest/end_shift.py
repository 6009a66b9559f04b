"""Whether the markers are back at their rest positions at the end of a recording."""

from collections import deque

import numpy as np

from manytouch.sinks.files.sensor_description import pitch_px, rest_px
from manytouch.values import Reading, Sensor, Status
from manytouch.values.arrays import Points2

END_FRAMES = 15
"""The last frames, all without a contact, over which positions are averaged."""
MIN_FRAMES = 4 * END_FRAMES
"""A recording with fewer frames gets no warning: its end is too near to the frames of its rest."""
SHIFT_STDS = 5.0
"""A median shift of up to this many noise deviations of a marker gives no warning."""
SHIFT_PITCHES = 0.02
"""Nor does one of up to this many pitches: less remains for a while where a soft sheet was pressed."""


class EndShift:
    """How far the markers are from their rest positions at the end, while no contact is found."""

    def __init__(self, sensor: Sensor) -> None:
        self._rest_px = rest_px(sensor)
        self._pitch_px = float(np.nanmean(pitch_px(sensor)))
        self._frames = 0
        self._last_px: deque[Points2] = deque(maxlen=END_FRAMES)

    def add(self, reading: Reading) -> None:
        """Add a frame.

        A contact discards the frames before it; a frame with a status other than `ok` is ignored.
        """
        self._frames += 1
        if reading.contacts.contacts:
            self._last_px.clear()
        elif reading.status is Status.OK:
            self._last_px.append(reading.grid.position_px)

    def warnings(self, noise_px: float | None) -> list[str]:
        """A warning if most markers are not at rest at the end, although nothing was found to touch."""
        if len(self._last_px) < END_FRAMES or self._frames < MIN_FRAMES or noise_px is None:
            return []
        seen = np.isfinite(np.stack(self._last_px)).all(axis=(0, 2))
        if not seen.any():
            return []
        place_px = np.median(np.stack(self._last_px)[:, seen], axis=0)
        shift_px = float(np.median(np.linalg.norm(place_px - self._rest_px[seen], axis=1)))
        if shift_px <= max(SHIFT_STDS * noise_px, SHIFT_PITCHES * self._pitch_px):
            return []
        return [
            f"the markers are {shift_px:.1f} px (median) away from their rest positions at the end, although "
            "no contact is found there: the sensor or the camera has moved, or something still touches. "
            "Depths and forces after that may be wrong: fix the camera and the sheet, or process the parts "
            "of the recording separately"
        ]
