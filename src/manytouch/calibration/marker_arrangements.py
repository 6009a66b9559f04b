"""Arrangements of the markers in the frames of a recording, and which of them is the least pressed.

An arrangement is the set of frames between which no group of markers has moved. A sheet returns to its rest
again and again, so the score of an arrangement is the number of its frames times the number of its separate
visits. Of two arrangements with similar scores, the pressed one is that in which the markers of one place
have spread apart: an incompressible pad swells sideways under a press, and what comes nearer to the camera
grows in the image. The constants are explained in ADR 51, ADR 131, ADR 143 and ADR 178.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import in_threads
from manytouch.estimation.local_motion import LocalMotion, marker_groups
from manytouch.estimation.uncalibrated.marker_spacing import marker_spacing
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.tracking.lattice.find import local_spacing
from manytouch.values.arrays import Points2

FEWEST_MARKERS = 6
"""Fewer markers than this show no arrangement: a choice."""
STILL_PITCHES = 0.005
"""Most markers of a still frame move by less until the next frame, and any group of them by less within an
arrangement: between untouched frames (98 % are below 0.0036) and faint touches (0.012)."""
FEWEST_STILL = 3
"""Least number of compared frames of such an arrangement; a slow press is still for two."""
_RIVAL_SHARE = 0.15
"""An arrangement may be the rest instead of the most common one if its score is at least this share of it."""
_CLEAR_SKEWNESS = 0.25
"""Skewness of the change of areas from one arrangement to another, above which the other is known to be
pressed: nine of ten presses on gel pads exceed 0.3; of membranes, the skewness scatters around 0."""
_DOUBT_SHARE = 0.5
"""The rest is doubtful if another arrangement has a larger share of the score of the chosen one, and neither
is clearly pressed."""


_CLEAR_VISITS = 3
"""A sheet that returned so often to an arrangement, nearly, rests there, not where it was once: a choice."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RestArrangement:
    """Frames that show the markers at the same positions.

    Attributes:
        frames: numbers of its frames, among those that were compared or of the recording.
        score: their number times that of their separate visits.
        position_px: (m, 2) median, NaN where not seen.
    """

    frames: tuple[int, ...]
    score: int
    position_px: Points2


class MarkerComparison:
    """How positions (m, 2) of the markers of one layout, px, differ; NaN where a marker is not seen."""

    def __init__(self, rest_px: Points2) -> None:
        self._pitch_px = float(np.median(local_spacing(rest_px)))
        self._motion = LocalMotion(refinements=4)
        self._groups = marker_groups(rest_px, self._pitch_px)
        self._spacing = marker_spacing(rest_px, rest_px.mean(axis=0), nearest_neighbours(rest_px))

    @property
    def creep_share(self) -> float:
        """Share of a press that a sheet may keep after it."""
        return self._motion.creep_share

    def usual_motion(self, before_px: Points2, after_px: Points2) -> float:
        """Length in pitches that 80 % of the motions do not exceed; infinite where too few are seen."""
        moved = np.linalg.norm(after_px - before_px, axis=1)
        moved = moved[np.isfinite(moved)] / self._pitch_px
        return float(np.quantile(moved, 0.8)) if len(moved) >= FEWEST_MARKERS else float("inf")

    def group_motion(self, before_px: Points2, after_px: Points2) -> float:
        """Largest motion of a group of markers in pitches; infinite where too few are seen."""
        moved = after_px - before_px
        is_seen = np.isfinite(moved[:, 0])
        if is_seen.sum() < FEWEST_MARKERS:
            return float("inf")
        return float(self._motion(self._groups, moved, is_seen).max())

    def motions(self, sample: Float64[np.ndarray, "f m 2"]) -> Float64[np.ndarray, "f f"]:
        """`group_motion` between every two frames."""
        count = len(sample)

        def motions_of_later(frame: int) -> list[float]:
            return [self.group_motion(sample[later], sample[frame]) for later in range(frame + 1, count)]

        motion = np.zeros((count, count))
        for frame, found in enumerate(in_threads(motions_of_later, range(count))):
            motion[frame, frame + 1 :] = motion[frame + 1 :, frame] = found
        return motion

    def area_skewness(self, before_px: Points2, after_px: Points2) -> float:
        """Skewness, from -1 to 1, of the change of the areas between markers.

        It is positive if the markers of one place have spread apart, and negative if they have contracted.
        """
        moved = np.nan_to_num(after_px - before_px)
        area, _ = self._spacing(moved)
        area = area - np.median(area)
        return float((area.max() + area.min()) / max(float(area.max() - area.min()), 1e-12))

    def is_kept_of_a_press(self, rest_px: Points2, first_px: Points2, place_px: Iterable[Points2]) -> bool:
        """Whether the first positions differ from the rest only by what the sheet keeps of its presses.

        Args:
            rest_px: (m, 2) the rest.
            first_px: (m, 2) the first positions.
            place_px: (m, 2) positions in frames of the whole recording.
        """
        away, share = self.group_motion(rest_px, first_px), self._motion.creep_share
        if away <= self._motion.floor_pitch or self.area_skewness(rest_px, first_px) >= _CLEAR_SKEWNESS:
            return False
        # only positions up to the first one that is far enough are compared
        return any(away <= share * self.group_motion(rest_px, each) for each in place_px)


def find_arrangements(
    sample: Float64[np.ndarray, "f m 2"], motion: Float64[np.ndarray, "f f"], most_pitches: float
) -> list[RestArrangement]:
    """The arrangements of the frames, the one with the highest score first.

    Args:
        sample: (f, m, 2) positions of the markers in each frame.
        motion: (f, f) between the frames, by `MarkerComparison.motions`.
        most_pitches: largest motion between frames of one arrangement.
    """
    left, found = np.ones(len(sample), dtype=np.bool_), []
    while True:
        agrees = (motion < most_pitches) & left & left[:, None]
        members = agrees[np.argmax(agrees.sum(axis=1))]
        if members.sum() < 2:
            break
        visits = int(members[0]) + int(np.count_nonzero(members[1:] & ~members[:-1]))
        found.append(
            RestArrangement(
                frames=tuple(np.flatnonzero(members).tolist()),
                score=int(members.sum()) * visits,
                position_px=_median(sample[members]),
            )
        )
        left &= ~members
    return sorted(found, key=lambda each: -each.score)


def least_pressed_part(
    whole: RestArrangement,
    sample: Float64[np.ndarray, "f m 2"],
    motion: Float64[np.ndarray, "f f"],
    most_pitches: float,
    compare: MarkerComparison,
) -> RestArrangement:
    """The least pressed of the parts of an arrangement whose frames agree as closely as noise allows.

    Args:
        whole: one of `find_arrangements`.
        sample, motion: see there.
        most_pitches: largest motion by noise.
        compare: for these markers.
    """
    own = list(whole.frames)
    parts = find_arrangements(sample[own], motion[np.ix_(own, own)], most_pitches)
    best, _ = least_pressed([each for each in parts if len(each.frames) >= FEWEST_STILL], compare)
    return whole if best is None else replace(best, frames=tuple(own[k] for k in best.frames))


def least_pressed(
    found: list[RestArrangement], compare: MarkerComparison
) -> tuple[RestArrangement | None, bool]:
    """The arrangement that is the rest, and whether another one may be it as well."""
    if not found:
        return None, False
    best, is_doubtful = found[0], False
    is_returned_to = _visits(found, best, compare) >= _CLEAR_VISITS
    for rival in found[1:]:
        if rival.score < _RIVAL_SHARE * found[0].score:
            break
        if len(rival.frames) < FEWEST_STILL:
            continue
        if is_returned_to and _visits(found, rival, compare) == 1:
            continue
        skewness = compare.area_skewness(best.position_px, rival.position_px)
        if skewness < -_CLEAR_SKEWNESS:
            best, is_doubtful = rival, False
        elif skewness < _CLEAR_SKEWNESS and rival.score > _DOUBT_SHARE * best.score:
            is_doubtful = True
    return best, is_doubtful


def _visits(found: list[RestArrangement], one: RestArrangement, compare: MarkerComparison) -> int:
    """Number of separate visits to an arrangement and to those that creep may separate from it."""
    away = [compare.group_motion(one.position_px, each.position_px) for each in found]
    reach = compare.creep_share * max((each for each in away if np.isfinite(each)), default=0.0)
    is_near = {frame: far <= reach for each, far in zip(found, away, strict=True) for frame in each.frames}
    in_order = [is_near[frame] for frame in sorted(is_near)]
    return int(in_order[0]) + sum(not before and now for before, now in pairwise(in_order))


def _median(position_px: Float64[np.ndarray, "f m 2"]) -> Points2:
    """(m, 2) medians over frames, each shifted to their common place; NaN for a marker that is never seen.

    Without these shifts, the median over frames before and after a motion of the camera would be a position
    between both views, which the markers may have had while the sheet was pressed.
    """
    seen = np.isfinite(position_px[..., 0]).any(axis=0)
    middle = np.full(position_px.shape[1:], np.nan)
    shift = np.nanmedian(position_px[:, seen] - np.nanmedian(position_px[:, seen], axis=0), axis=1)
    shift -= np.median(shift, axis=0)
    middle[seen] = np.nanmedian(position_px[:, seen] - shift[:, None], axis=0)
    return middle
