"""Layouts of markers, and the grid that a tracker returns of them; the only ones in the tests."""

from collections.abc import Sequence

import numpy as np

from manytouch.values import Layout, Status, TrackedGrid


def marker_layout(
    place_mm: np.ndarray,
    *,
    pitch_mm: float | Sequence[float] = 1.0,
    radius_mm: float | np.ndarray = 1.0,
    row_column: np.ndarray | None = None,
    polarity: str = "light",
    missing: Sequence[int] = (),
    colour_weights: np.ndarray | None = None,
) -> Layout:
    """Markers at places (m, 2) of the sheet; `missing` are numbers of markers."""
    count = len(place_mm)
    return Layout(
        rest_mm=np.column_stack([place_mm, np.zeros(count)]),
        row_column=row_column,
        pitch_mm=np.broadcast_to(np.asarray(pitch_mm, dtype=np.float64), (2,)).copy(),
        radius_mm=np.broadcast_to(np.asarray(radius_mm, dtype=np.float64), (count,)).copy(),
        polarity=polarity,
        colour_weights=colour_weights,
        is_missing=np.isin(np.arange(count), missing),
    )


def rows_and_columns(rows: int, columns: int) -> np.ndarray:
    """(m, 2) row and column of each marker of a rectangle."""
    return np.column_stack([index.ravel() for index in np.indices((rows, columns))]).astype(np.int64)


def lattice_layout(
    rows: int,
    columns: int,
    pitch_mm: float | Sequence[float],
    *,
    radius_mm: float = 1.0,
    polarity: str = "light",
    missing: Sequence[int] = (),
) -> Layout:
    """A rectangle of markers around the origin of the sheet; pitches along x and y, or one for both."""
    row_column = rows_and_columns(rows, columns)
    middle = np.array([columns - 1, rows - 1]) / 2
    return marker_layout(
        (row_column[:, ::-1] - middle) * pitch_mm,
        pitch_mm=pitch_mm,
        radius_mm=radius_mm,
        row_column=row_column,
        polarity=polarity,
        missing=missing,
    )


def grid_at(
    position_px: np.ndarray,
    *,
    std_px: float = 0.02,
    noise_px: float = 0.0,
    seed: int = 0,
    unseen: np.ndarray | None = None,
    area_px2: np.ndarray | None = None,
    status: Status = Status.OK,
) -> TrackedGrid:
    """The grid of markers at positions (m, 2); those that are NaN, or in the mask `unseen`, are not seen.

    `std_px` is the deviation that the grid states, `noise_px` that of what is added to the positions.
    """
    place_px = position_px + np.random.default_rng(seed).normal(0.0, noise_px, position_px.shape)
    is_seen = np.isfinite(position_px).all(axis=1)
    if unseen is not None:
        is_seen &= ~unseen
    return TrackedGrid(
        position_px=np.where(is_seen[:, None], place_px, np.nan),
        covariance_px2=np.where(is_seen[:, None, None], std_px**2 * np.eye(2), np.nan),
        is_seen=is_seen,
        frames_unseen=np.where(is_seen, 0, 1).astype(np.int64),
        area_px2=area_px2,
        status=status,
    )
