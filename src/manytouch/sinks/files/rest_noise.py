"""Noise of the marker positions while nothing touches the sheet."""

import numpy as np

from manytouch.values import Reading, Status
from manytouch.values.arrays import Points2, Scalars


class RestNoise:
    """RMS of every marker about its mean, over the frames without contact.

    Frames without contact come in runs. Each run has its own mean, so that a rest position
    that changes after a press does not count as noise. One value per marker: the root of the mean of
    the variances along x and y. Movement of the whole view is part of it.
    """

    def __init__(self, markers: int) -> None:
        self._squares = np.zeros((markers, 2))
        self._freedom = np.zeros(markers)
        self._run = _Run(markers)

    def add(self, reading: Reading) -> None:
        """Take in a frame; one with a contact, or one that failed, ends the run."""
        if reading.status is not Status.OK or reading.contacts.contacts:
            self._end_run()
            return
        self._run.add(np.where(reading.grid.is_seen[:, None], reading.grid.position_px, np.nan))

    def per_marker_px(self) -> Scalars:
        """(m,) noise of each marker; NaN where it was seen too rarely."""
        squares = self._squares + self._run.squares()
        freedom = self._freedom + self._run.freedom()
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(np.where(freedom > 0, squares.mean(axis=1) / freedom, np.nan))

    def _end_run(self) -> None:
        self._squares += self._run.squares()
        self._freedom += self._run.freedom()
        self._run = _Run(len(self._freedom))


class _Run:
    """Sums over one unbroken run, about its first positions to keep the digits."""

    def __init__(self, markers: int) -> None:
        self._origin = np.full((markers, 2), np.nan)
        self._sum = np.zeros((markers, 2))
        self._sum_of_squares = np.zeros((markers, 2))
        self._count = np.zeros(markers)

    def add(self, position_px: Points2) -> None:
        seen = np.isfinite(position_px[:, 0])
        fresh = seen & (self._count == 0)
        self._origin[fresh] = position_px[fresh]
        away = position_px[seen] - self._origin[seen]
        self._sum[seen] += away
        self._sum_of_squares[seen] += away**2
        self._count[seen] += 1

    def squares(self) -> Points2:
        """(m, 2) sum of the squares about the run's mean."""
        mean = self._sum / np.maximum(self._count, 1)[:, None]
        return np.asarray(np.maximum(self._sum_of_squares - mean * self._sum, 0.0))

    def freedom(self) -> Scalars:
        """(m,) observations less the one that the mean takes."""
        return np.asarray(np.maximum(self._count - 1, 0))
