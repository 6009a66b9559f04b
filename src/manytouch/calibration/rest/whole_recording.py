"""The rest of a recording that may begin touched: the stillest and most common of its arrangements.

The arrangements and their scores are those of `marker_arrangements`. The positions of the first frames stay
the rest unless another arrangement differs from them by more than what a soft sheet keeps of a press. The
constants are explained in ADR 51.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import islice, pairwise

import numpy as np

from manytouch.calibration.marker_arrangements import (
    FEWEST_MARKERS,
    FEWEST_STILL,
    STILL_PITCHES,
    MarkerComparison,
    RestArrangement,
    find_arrangements,
    least_pressed,
    least_pressed_part,
)
from manytouch.calibration.rest.local_bulge import PRESSED_PITCHES, START_IS_REST, local_bulge_px
from manytouch.estimation.local_motion import largest_of_still
from manytouch.geometry.camera import mm_per_px
from manytouch.pipeline import track_frames
from manytouch.tracking import MarkerTracker
from manytouch.values import Frame, Roi, Sensor, Status, TrackedGrid
from manytouch.values.arrays import Points2, read_only

DOUBTFUL_REST = (
    "The rest is doubtful: {reason}. Contacts are relative to it: use a recording that begins and ends "
    "untouched, or tare while nothing touches the sheet."
)
WHOLE_RECORDING = "whole recording"
"""Value of the key `from` of `[provenance]` where the rest positions are not those of the first frames."""
MOST_READ = 20_000
"""Number of frames, from the first one, among which those that are tracked are chosen."""
MOST_TRACKED = 400
"""Largest number of frames that are tracked."""
_MOST_COMPARED = 48
"""Largest number of frames of which every pair is compared."""
_STILL_SHARE = 0.8
"""Share of the first frames of a live source that must be still."""
_UNMOVED_SHARE = 0.9
"""If more than this share of the compared frames are like the first ones, these are the rest: a choice."""
_OF_FIRST_FRAMES = {"rest_frames", "unmoved_frames"}  # keys of provenance
_SHOWN_SHARE = 0.5
"""Share of the markers that a picture of the same sensor shows, and of the pictures that show them."""


class RestDoubt(Enum):
    """Why the rest positions may be those of a touched sheet, as a part of a sentence."""

    NEVER_STILL = "the markers are not still in any part of the recording"
    NEVER_TWICE = "no arrangement of the markers is seen twice"
    EQUALLY_COMMON = "two arrangements of the markers are about as common"
    MOVED_START = "the markers moved at the start"
    UNEVEN_START = "the markers are uneven at one place, by their pattern or by a touch"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SettledRest:
    """The rest that a whole recording shows.

    Attributes:
        sensor: with its rest positions; its assumptions state where they are from, and the doubt.
        still_frames: indices of the frames with these positions; empty where those of the first frames stay.
        doubt: None if there is none.
    """

    sensor: Sensor
    still_frames: tuple[int, ...] = ()
    doubt: RestDoubt | None = None


def rest_of_recording(
    sensor: Sensor, frames: Iterable[Frame], *, frame_count: int | None = None, roi_px: Roi | None = None
) -> SettledRest:
    """The rest that a whole recording shows.

    Args:
        sensor: from the first frames.
        frames: of the recording from its beginning.
        frame_count: expected number of frames; None when not known.
        roi_px: x, y, width, height of the region of interest.
    """
    return settle_rest(sensor, *_tracked_pairs(sensor, frames, frame_count, roi_px))


def arrangements_of_recording(
    sensor: Sensor, frames: Iterable[Frame], *, frame_count: int | None = None, roi_px: Roi | None = None
) -> list[RestArrangement]:
    """The arrangements of the markers that a whole recording shows in `FEWEST_STILL` frames or more.

    Args:
        sensor: from the first frames, with `rest_px`.
        frames, frame_count, roi_px: see `rest_of_recording`.
    """
    layout = sensor.layout
    if layout is None or layout.rest_px is None or len(layout.rest_px) < FEWEST_MARKERS:
        return []
    grids, indices = _tracked_pairs(sensor, frames, frame_count, roi_px)
    place_px = [_places_px(each) for each in grids]
    compare = MarkerComparison(layout.rest_px)
    compared = _compared_frames(grids, indices, place_px, compare)
    if not compared:
        return []
    sample = np.stack([place_px[k] for k in compared])
    found = find_arrangements(sample, compare.motions(sample), STILL_PITCHES)
    return [
        replace(each, frames=tuple(indices[compared[k]] for k in each.frames))
        for each in found
        if len(each.frames) >= FEWEST_STILL
    ]


def _tracked_pairs(
    sensor: Sensor, frames: Iterable[Frame], frame_count: int | None, roi_px: Roi | None
) -> tuple[list[TrackedGrid], list[int]]:
    """Markers and indices of pairs of consecutive frames, spread evenly over the first `MOST_READ` frames."""
    from manytouch.detection import DotSearch

    stride = 2 * max(1, -(-min(frame_count or MOST_READ, MOST_READ) // MOST_TRACKED))
    pairs = (frame for k, frame in enumerate(islice(frames, MOST_READ)) if k % stride < 2)
    tracked = track_frames(DotSearch(roi_px=roi_px), MarkerTracker(roi_px=roi_px), pairs, sensor)
    found = [(each.frame.index, each.grid) for each in tracked]
    return [grid for _, grid in found], [index for index, _ in found]


def _places_px(grid: TrackedGrid) -> Points2:
    """(m, 2) places of the markers, NaN where not seen."""
    return np.where(grid.is_seen[:, None], grid.position_px, np.nan)


def _compared_frames(
    grids: Sequence[TrackedGrid],
    indices: Sequence[int],
    place_px: Sequence[Points2],
    compare: MarkerComparison,
) -> list[int]:
    """Still frames, at most `_MOST_COMPARED` of them; none if fewer than two are still."""
    usable = [k for k, each in enumerate(grids) if each.status is Status.OK]
    still = [
        k
        for k, after in pairwise(usable)
        if indices[after] == indices[k] + 1
        and compare.usual_motion(place_px[k], place_px[after]) < STILL_PITCHES
    ]
    if len(still) < 2:
        return []
    return [still[k] for k in np.unique(np.linspace(0, len(still) - 1, _MOST_COMPARED).round().astype(int))]


def with_unrelated_pictures(sensor: Sensor, frames: Sequence[Frame], roi_px: Roi | None = None) -> Sensor:
    """The sensor, with a sentence if most of some pictures of a folder do not show its markers."""
    from manytouch.detection import DotSearch

    tracked = track_frames(DotSearch(roi_px=roi_px), MarkerTracker(roi_px=roi_px), frames, sensor)
    shown = sum(
        each.grid.status is Status.OK and each.grid.is_seen.mean() >= _SHOWN_SHARE for each in tracked
    )
    if shown > _SHOWN_SHARE * len(frames):
        return sensor
    sentence = (
        f"Only {shown} of {len(frames)} pictures spread over the folder show the markers of the first "
        "ones: they seem to be of different sensors or views; process each kind in a folder of its own."
    )
    return replace(sensor, assumptions=(*sensor.assumptions, sentence))


def settle_rest(sensor: Sensor, grids: Sequence[TrackedGrid], indices: Sequence[int]) -> SettledRest:
    """The rest that frames of a whole recording show.

    Args:
        sensor: from the first frames, with `rest_px`.
        grids: of frames spread over the recording, with pairs of consecutive ones among them.
        indices: of these frames.
    """
    layout = sensor.layout
    if layout is None or layout.rest_px is None or len(layout.rest_px) < FEWEST_MARKERS:
        return SettledRest(sensor=sensor)
    place_px = [_places_px(each) for each in grids]
    usable = [k for k, each in enumerate(grids) if each.status is Status.OK]
    compare = MarkerComparison(layout.rest_px)
    compared = _compared_frames(grids, indices, place_px, compare)
    if not compared:
        return _doubtful(sensor, RestDoubt.NEVER_STILL)
    sample = np.stack([place_px[k] for k in compared])
    first_px = layout.rest_px
    from_first = np.array([compare.group_motion(first_px, each) for each in sample])
    steps = [compare.group_motion(place_px[k], place_px[k + 1]) for k in compared]
    limit = min(STILL_PITCHES, largest_of_still(steps))
    if np.mean(from_first < limit) > _UNMOVED_SHARE:
        return SettledRest(sensor=sensor)
    motion = compare.motions(sample)
    best, is_doubtful = least_pressed(find_arrangements(sample, motion, STILL_PITCHES), compare)
    if best is None:
        return _doubtful(sensor, RestDoubt.NEVER_TWICE)
    best = least_pressed_part(best, sample, motion, limit, compare)
    some_px = (place_px[k] for k in usable[:: max(1, len(usable) // 200)])
    if compare.is_kept_of_a_press(best.position_px, first_px, some_px):
        return SettledRest(sensor=sensor)
    frames = tuple(indices[compared[k]] for k in best.frames)
    doubt = RestDoubt.EQUALLY_COMMON if is_doubtful else None
    settled = _with_doubt(_with_rest(sensor, best.position_px, frames), doubt)
    return SettledRest(sensor=settled, still_frames=frames, doubt=doubt)


def _with_rest(sensor: Sensor, position_px: Points2, frames: Sequence[int]) -> Sensor:
    """The sensor with other rest positions; a marker without one is moved as the others are."""
    layout = sensor.layout
    assert layout is not None
    assert layout.rest_px is not None
    seen = np.isfinite(position_px[:, 0])
    rest_px = np.where(seen[:, None], position_px, layout.rest_px)
    rest_px[~seen] += np.median(rest_px[seen] - layout.rest_px[seen], axis=0)
    at_rest = replace(sensor, layout=replace(layout, rest_px=read_only(rest_px)))
    sentence = (
        f"The sheet is at rest in {len(frames)} of the frames {min(frames)} to {max(frames)}, in which the "
        "markers are stillest and most often in the same places."
    )
    if (bulge := _bulge_in_pitches(at_rest)) > PRESSED_PITCHES:
        sentence += (
            f" They depart from a regular lattice by {bulge:.2f} pitches at one place in them: the pattern "
            "is uneven there, or the sheet was touched."
        )
    kept = tuple(
        each
        for each in sensor.assumptions
        if not (each.startswith("The sheet is at rest in") or each.endswith(START_IS_REST))
    )
    return replace(
        at_rest,
        assumptions=(*kept, sentence),
        provenance={
            **{name: value for name, value in sensor.provenance.items() if name not in _OF_FIRST_FRAMES},
            "from": WHOLE_RECORDING,
            "still_frames": list(frames),
        },
    )


def _doubtful(sensor: Sensor, doubt: RestDoubt) -> SettledRest:
    """The rest of the first frames, which stays although it is doubtful."""
    return SettledRest(sensor=_with_doubt(sensor, doubt), doubt=doubt)


def _with_doubt(sensor: Sensor, doubt: RestDoubt | None) -> Sensor:
    if doubt is None:
        return sensor
    sentence = DOUBTFUL_REST.format(reason=doubt.value)
    return replace(sensor, rest_is_doubtful=True, assumptions=(*sensor.assumptions, sentence))


def is_still(sensor: Sensor, frames: int) -> bool:
    """Whether the markers did not move in the frames that a sensor was found in."""
    unmoved = sensor.provenance.get("unmoved_frames")
    return isinstance(unmoved, int) and unmoved >= _STILL_SHARE * frames


def with_doubt_of_start(sensor: Sensor, frames: int) -> Sensor:
    """The sensor, with a doubtful rest if the markers moved at the start, or are uneven."""
    if not is_still(sensor, frames):
        return _with_doubt(sensor, RestDoubt.MOVED_START)
    if _bulge_in_pitches(sensor) > PRESSED_PITCHES:
        return _with_doubt(sensor, RestDoubt.UNEVEN_START)
    return sensor


def _bulge_in_pitches(sensor: Sensor) -> float:
    """The bulge of the rest positions (`rest.local_bulge`)."""
    layout = sensor.layout
    if layout is None or layout.row_column is None or layout.rest_px is None:
        return 0.0
    pitch_px = float(np.sqrt(np.prod(layout.pitch_mm))) / mm_per_px(sensor.camera)
    return local_bulge_px(layout.row_column, layout.rest_px, ~layout.is_missing) / pitch_px
