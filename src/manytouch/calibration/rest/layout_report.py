"""Report on the layout in the first frames of a recording: is the recording usable?"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from manytouch.calibration.rest.first_frames import arrange_rest_dots, find_rest_dots, image_size
from manytouch.calibration.rest.local_bulge import bulge_in_pitches
from manytouch.tracking.lattice.find import predict_positions
from manytouch.values import Frame, Roi


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LayoutReport:
    """Properties of the markers in the first frames.

    Attributes:
        dots: number of dots that belong to the pattern.
        rows, columns: of the lattice, None when the markers form no rectangle.
        markers: places of the layout.
        missing: places without a dot.
        pitch_px: spacing along x and y.
        residual_px: median distance of a marker from the position that its neighbours predict; NaN without
            rows.
        noise_px: median noise of a centre over the rest frames; NaN below three of them.
        still_frames: number of frames without motion.
        bulge_pitches: local bulge (`bulge_in_pitches`); above 0.15 the sheet was probably pressed.
    """

    dots: int
    rows: int | None
    columns: int | None
    markers: int
    missing: int
    pitch_px: tuple[float, float]
    residual_px: float
    noise_px: float
    still_frames: int
    bulge_pitches: float


def examine(
    frames: Sequence[Frame],
    *,
    roi_px: Roi | None = None,
    spread: Callable[[], Sequence[Frame]] | None = None,
) -> LayoutReport:
    """Find the layout in the first frames and report on it; arguments and errors as `sensor_from_rest`."""
    width, height = image_size(frames, roi_px)
    _, still, _ = find_rest_dots(frames, roi_px, spread)
    arrangement = arrange_rest_dots(still, width, height, roi_px)
    rows = columns = None
    residual = float("nan")
    if arrangement.row_column is not None:
        rows, columns = (int(number) + 1 for number in arrangement.row_column.max(axis=0))
        position = np.where((arrangement.dot >= 0)[:, None], arrangement.centre_px, np.nan)
        guess, votes = predict_positions(position.reshape(rows, columns, 2))
        error = np.linalg.norm(position.reshape(rows, columns, 2) - guess, axis=-1)[votes >= 3]
        error = error[np.isfinite(error)]
        residual = float(np.median(error)) if len(error) else residual
    noise = still.noise_px[np.isfinite(still.noise_px)]
    return LayoutReport(
        dots=len(still.centre_px),
        rows=rows,
        columns=columns,
        markers=len(arrangement.dot),
        missing=int((arrangement.dot < 0).sum()),
        pitch_px=(float(arrangement.pitch_px[0]), float(arrangement.pitch_px[1])),
        residual_px=residual,
        noise_px=float(np.median(noise)) if len(noise) else float("nan"),
        still_frames=len(still.frames),
        bulge_pitches=bulge_in_pitches(arrangement),
    )
