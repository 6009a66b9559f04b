"""Noise of the marker positions while nothing touches the sheet."""

import numpy as np

from manytouch.values import Reading, Status
from manytouch.values.arrays import Points2, Scalars


class RestNoise:
    """RMS of every marker about its mean, over the frames without contact.

    Each uninterrupted run of such frames has its own mean, so that a rest position that changes after a
    press does not count as noise. The noise of a marker is the root of the mean of its variances along x
    and y; motion of the whole view is part of it.
    """

    def __init__(self, markers: int) -> None:
        self._squares = np.zeros((markers, 2))
        self._degrees_of_freedom = np.zeros(markers)
        self._run = _Run(markers)

    def add(self, reading: Reading) -> None:
        """Add a frame; a contact or a status other than `ok` ends the run."""
        if reading.status is not Status.OK or reading.contacts.contacts:
            self._end_run()
            return
        self._run.add(np.where(reading.grid.is_seen[:, None], reading.grid.position_px, np.nan))

    def per_marker_px(self) -> Scalars:
        """(m,) noise of each marker; NaN where it was seen too rarely."""
        squares = self._squares + self._run.squares()
        degrees = self._degrees_of_freedom + self._run.degrees_of_freedom()
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(np.where(degrees > 0, squares.mean(axis=1) / degrees, np.nan))

    def _end_run(self) -> None:
        self._squares += self._run.squares()
        self._degrees_of_freedom += self._run.degrees_of_freedom()
        self._run = _Run(len(self._degrees_of_freedom))


class _Run:
    """Sums over one run, relative to its first positions, which keeps them precise."""

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
        """(m, 2) sum of the squares about the mean of the run."""
        mean = self._sum / np.maximum(self._count, 1)[:, None]
        return np.asarray(np.maximum(self._sum_of_squares - mean * self._sum, 0.0))

    def degrees_of_freedom(self) -> Scalars:
        """(m,) number of observations minus one, for the mean."""
        return np.asarray(np.maximum(self._count - 1, 0))
