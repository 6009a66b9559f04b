"""The dots of the first frames, of a sheet that moves in them."""

import numpy as np
import pytest

from clips import COLUMNS, PITCH_PX, ROWS, picture
from manytouch.calibration.rest.first_frames import find_rest_dots
from manytouch.values import Frame

MARGIN_PX = 40


@pytest.mark.parametrize("pitches", [0.4, 0.5, 0.6])
def test_all_dots_are_found_where_the_sheet_moves_before_it_rests(pitches: float) -> None:
    """The survey sees the first frame, in which the dots are elsewhere than in the frames at rest."""
    still = 3
    shifts = np.concatenate([np.linspace(pitches * PITCH_PX[0], 0.0, 9), np.zeros(still - 1)])
    frames = [
        Frame(
            index=k,
            timestamp_ns=k * 40_000_000,
            camera="drawn",
            image=np.roll(
                np.pad(picture(seed=k), ((0, 0), (MARGIN_PX, MARGIN_PX), (0, 0)), "edge"), round(shift), 1
            ),
        )
        for k, shift in enumerate(shifts)
    ]
    _, dots, _ = find_rest_dots(frames, None)
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    expected_px = np.column_stack(
        [
            MARGIN_PX + 160.0 + (column - (COLUMNS - 1) / 2) * PITCH_PX[0],
            120.0 + (row - (ROWS - 1) / 2) * PITCH_PX[1],
        ]
    )
    distance = np.linalg.norm(dots.centre_px[:, None] - expected_px[None], axis=2)
    assert len(dots.centre_px) == ROWS * COLUMNS
    assert distance.min(axis=0).max() < 2.0
