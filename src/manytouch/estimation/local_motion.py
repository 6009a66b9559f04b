"""How far groups of neighbouring markers have moved, compared with all others: whether the sheet is touched.

A touch moves several neighbouring markers; an error of measurement moves one, and the camera moves all. The
motion of the view (a homography, linear in its change) is fitted with weights that leave out markers that
move differently (A. E. Beaton, J. W. Tukey 1974, doi:10.1080/00401706.1974.10489171). The local motion at a
marker is a length that most of the group of it and its neighbours exceed. It is compared with the noise, and
with what a soft sheet keeps of earlier presses while it creeps back.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from manytouch.estimation.frame_interval import remaining
from manytouch.estimation.kernels import lengths_without_view
from manytouch.geometry.neighbours import nearest_neighbours
from manytouch.values.arrays import Mask, Points2, Scalars, read_only, read_only_view

_AROUND = 5  # neighbours of a marker in its group
_STEPS = 2.0
"""Largest local motion of a still sheet over that between successive frames: a choice (ADR 143)."""
_LEAST_MOTION = 0.0005
"""Least such motion in pitches, where frames hardly differ: a choice, a tenth of what counts as motion."""
_FEWEST = 12  # markers for a motion of the view with eight parameters; fewer only shift


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerGroups:
    """What a local motion needs of the layout.

    Attributes:
        rest_mm: (m, 2) markers in the plane of the sheet.
        group: (m, k) each marker and its nearest neighbours, the nearest first.
        view: (2, m, p) displacements of the markers along x and y for each parameter of a motion of the view.
        pitch_mm: geometric mean of the pitches.
    """

    rest_mm: Points2
    group: np.ndarray
    view: Float64[np.ndarray, "2 m p"]
    pitch_mm: float

    def at(self, local: Scalars, point_mm: Float64[np.ndarray, "... 2"]) -> Float64[np.ndarray, "..."]:
        """The local motion (m,) of the marker that is nearest to each point (..., 2)."""
        return np.asarray(local[cKDTree(self.rest_mm).query(point_mm)[1]])

    def near(
        self, local: Scalars, point_mm: Float64[np.ndarray, "c 2"], reach: float
    ) -> Float64[np.ndarray, " c"]:
        """The largest of the local motions (m,) within some pitches of each point (c, 2)."""
        distance_mm = np.linalg.norm(point_mm[:, None] - self.rest_mm, axis=2)
        return np.asarray(np.where(distance_mm <= reach * self.pitch_mm, local, 0.0).max(axis=1, initial=0.0))


def marker_groups(rest_mm: Points2, pitch_mm: float) -> MarkerGroups:
    """For markers at rest (m, 2) in the plane of the sheet; any unit of length, the same for both."""
    neighbours = nearest_neighbours(rest_mm).index[:, :_AROUND]
    x, y = ((rest_mm - rest_mm.mean(axis=0)) / max(float(rest_mm.std()), 1e-12)).T
    one, zero = np.ones(len(rest_mm)), np.zeros(len(rest_mm))
    if len(rest_mm) < _FEWEST:
        view = [np.column_stack([one, zero]), np.column_stack([zero, one])]
    else:
        view = [
            np.column_stack([one, zero, x, y, zero, zero, x * x, x * y]),
            np.column_stack([zero, one, zero, zero, x, y, x * y, y * y]),
        ]
    return MarkerGroups(
        rest_mm=rest_mm,
        group=read_only(np.concatenate([np.arange(len(rest_mm))[:, None], neighbours], axis=1)),
        view=read_only(np.stack(view)),
        pitch_mm=pitch_mm,
    )


def largest_of_still(steps: Sequence[float]) -> float:
    """Largest local motion in pitches between two frames of a sheet that does not move.

    Args:
        steps: largest local motion between successive frames, most of which are still; those that are 0 are
            of frames that were recorded twice.
    """
    different = [each for each in steps if each > 0.0]
    usual = float(np.quantile(different, 0.25)) if different else float("inf")
    return max(_LEAST_MOTION, _STEPS * usual)


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchMemory:
    """Local motions of the frames before, in pitches.

    Attributes:
        strongest: the largest one.
        lowest: the smallest one since the last press of at least half of that.
        recent: the largest one, which fades.
    """

    strongest: float = 0.0
    lowest: float = 0.0
    recent: float = 0.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LocalMotion:
    """Motion of groups of markers, and whether it is a touch.

    Attributes:
        floor_pitch: no local motion below this begins a touch, in pitches.
        rest_pitch: no local motion below this is a touch that lasts. Untouched rubber and gel show up to it.
        lasting_share: a touch lasts above this share of the limit above which one begins: limits contain the
            noise, which varies from frame to frame.
        noise_stds: no local motion below this many of its standard deviations is a touch; the motion of a
            marker is reduced by so many of its own, as far as they exceed the median.
        creep_share: share of the strongest press that a sheet may keep after it.
        creep_growth: largest ratio of what it keeps to the smallest local motion since that press.
        sure_share: share of a recent press that a pad keeps, whatever the fit of a contact shows: twice that
            of gels. Only the estimator of pads fits contacts.
        fade_s: time constant with which a press becomes less recent: a choice.
        exceeded_by: share of a group that moves at least as far as its local motion.
        reach: residual over the median residual at which a marker has no weight in the motion of the view.
        refinements: rounds of weighting.
        contact_reach: distance from a contact within which it moves markers, in pitches.
    """

    floor_pitch: float = 0.006
    rest_pitch: float = 0.003
    lasting_share: float = 0.9
    noise_stds: float = 3.0
    creep_share: float = 0.2
    creep_growth: float = 2.0
    sure_share: float = 0.06
    fade_s: float = 6.6
    exceeded_by: float = 0.66
    reach: float = 3.0
    refinements: int = 6
    contact_reach: float = 1.5

    def __call__(
        self, groups: MarkerGroups, displacement_mm: Points2, is_seen: Mask, std_mm: Scalars | None = None
    ) -> Scalars:
        """(m,) local motion at each marker in pitches; 0 where fewer than half of the group are seen.

        Args:
            groups: of the layout.
            displacement_mm: (m, 2); those of markers that are not seen are not used.
            is_seen: (m,) at least one.
            std_mm: (m,) standard deviations of the displacements along an axis; None: not known.
        """
        moved = np.where(is_seen[:, None], displacement_mm, 0.0) / groups.pitch_mm
        only_read = read_only_view(is_seen)
        size = lengths_without_view(groups.view, moved, only_read, self.refinements, self.reach)
        if std_mm is not None:
            beyond = std_mm - np.median(std_mm[is_seen])
            size = np.maximum(size - self.noise_stds * np.maximum(beyond, 0.0) / groups.pitch_mm, 0.0)
        size[~is_seen] = np.nan
        of_group = np.sort(size[groups.group], axis=1)  # NaN last
        seen = np.isfinite(of_group).sum(axis=1)
        place = ((1.0 - self.exceeded_by) * seen).astype(np.int64)
        local = of_group[np.arange(len(of_group)), place]
        return np.asarray(np.where(2 * seen >= of_group.shape[1], np.nan_to_num(local), 0.0))

    def limits(
        self, memory: TouchMemory, std_pitch: float, *, was_touched: bool = False
    ) -> tuple[float, float]:
        """Local motions in pitches above which anything has moved, and above which the sheet is touched.

        Args:
            memory: of the frames before.
            std_pitch: standard deviation of a displacement along an axis.
            was_touched: whether something touched in the frame before.
        """
        floor_pitch = self.rest_pitch if was_touched else self.floor_pitch
        least = max(floor_pitch, self.noise_stds * std_pitch)
        return least, max(least, self.kept(memory))

    def is_touched(self, local_pitch: float, memory: TouchMemory, std_pitch: float, *, lasts: bool) -> bool:
        """Whether the sheet is touched; `lasts`: whether a contact was found in the frame before."""
        limit = self.limits(memory, std_pitch)[1]
        return local_pitch > (self.lasting_share * limit if lasts else limit)

    def kept(self, memory: TouchMemory) -> float:
        """Largest local motion in pitches that a sheet may keep of earlier presses."""
        return min(self.creep_share * memory.strongest, self.creep_growth * memory.lowest)

    def is_surely_kept(self, local_pitch: float, memory: TouchMemory) -> bool:
        """Whether a local motion that may be kept is also what any pad keeps of a recent press."""
        return local_pitch <= self.sure_share * memory.recent

    def remember(self, memory: TouchMemory, largest: float, *, elapsed_s: float) -> TouchMemory:
        """The memory after a frame with this largest local motion, so long after the frame before."""
        strongest = max(memory.strongest, largest)
        lowest = largest if largest >= 0.5 * strongest else min(memory.lowest, largest)
        recent = max(remaining(elapsed_s, self.fade_s) * memory.recent, largest)
        return TouchMemory(strongest=strongest, lowest=lowest, recent=recent)
