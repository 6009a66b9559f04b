"""Dots of the frames without motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import Delaunay, QhullError, cKDTree

from manytouch.estimation.local_motion import LocalMotion, TouchMemory, largest_of_still, marker_groups
from manytouch.geometry.centre_noise import centre_noise_px
from manytouch.tracking.lattice.find import find_lattice, local_spacing
from manytouch.values import Detections, Status
from manytouch.values.arrays import Counts, Points2, Scalars, read_only

_GATE_SPACINGS = 0.35  # distance within which two dots are the same, in spacings of the dots
_MAX_ADDED_SHARE = 0.15
"""Dots that only the search by size finds, over those of the survey; of more, none counts."""
_AROUND = 9  # a dot and its eight neighbours on a lattice
_FEWEST_AGREE = 0.25
"""Share of the frames below which those that agree are no rest: a choice, as dots that move all the time are
nearly at the same place in two or three frames."""
_FEWEST_STILL = 3
"""Least number of frames that can be the rest, but for the first group of frames that agree."""
_FEWEST_DOTS = 6
_NOISE_STDS = 4.0
"""Local motions of noise alone are below 2.8 of its standard deviations in 99 % of frames (35 to 2400 dots);
the steadiest pair of frames, which determines it, has a little less noise than the others."""
_MEDIAN_LENGTH = 1.1774  # of a vector whose components have a standard deviation of 1 (Rayleigh)
_OUTLINE_FACTOR = 1.03  # by which the outline of the surveyed dots is enlarged about their mean


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RestDots:
    """Dots that at least two fifths of the rest frames show, each with its medians over them.

    Attributes:
        centre_px: (n, 2).
        area_px2: (n,).
        contrast: (n,) grey levels of 255.
        noise_px: (n,) noise of a centre (`geometry.centre_noise`); NaN below three frames.
        times_seen: (n,) number of rest frames that show the dot.
        frames: indices of the rest frames among the given frames, which agree as closely as noise allows.
        unmoved: number of the given frames in which no group of dots has moved by more than still sheets do.
        moved: whether more than a fifth of the usable frames do not agree with the rest frames.
    """

    centre_px: Points2
    area_px2: Scalars
    contrast: Scalars
    noise_px: Scalars
    times_seen: Counts
    frames: tuple[int, ...]
    unmoved: int
    moved: bool


def merge_rest_dots(detections: Sequence[Detections]) -> RestDots:
    """Merge the dots of the frames that agree with one frame: the first of `rest_arrangements`."""
    return rest_arrangements(detections)[0]


def rest_arrangements(detections: Sequence[Detections]) -> tuple[RestDots, ...]:
    """Merge the dots of frames that agree, one or more groups of frames, the most probable rest first.

    The first group agrees with the earliest frame with which at least 60 % as many frames agree as with any
    other. Where fewer than a quarter of the frames agree with any, the dots move all the time; it is then the
    frame with the most evenly spaced dots, since a touch spreads the dots at one place and contracts them
    next to it. Further groups are the largest of the frames left over, with `_FEWEST_STILL` or more.

    Of frames that agree, a press at one place may move the dots of the later ones by up to a tenth of their
    spacing: only those are used that do not differ from the earliest one of which this is true for
    `_FEWEST_STILL` frames.

    Frames with a bad status are left out unless there is no other. A dot counts when at least two
    fifths of the group's frames show it.
    """
    usable = [k for k, each in enumerate(detections) if each.status is Status.OK and len(each.centre_px) > 0]
    usable = usable or [k for k, each in enumerate(detections) if len(each.centre_px) > 0]
    if not usable:
        return (_merge([], (), moved=False),)
    centres = [detections[k].centre_px for k in usable]
    agrees = _agreement_of_frames(centres)
    sizes = agrees.sum(axis=1)
    chosen = int(np.argmax(sizes >= 0.6 * sizes.max()))
    if sizes.max() < _FEWEST_AGREE * len(usable):
        chosen = int(np.argmin([_unevenness(each) for each in centres]))
    found: list[RestDots] = []
    while True:
        group = np.flatnonzero(agrees[chosen])
        frames = tuple(usable[k] for k in group)
        moved = bool(len(group) < 0.8 * len(usable))
        found.append(_merge([detections[k] for k in frames], frames, moved=moved))
        agrees[group] = agrees[:, group] = False
        sizes = agrees.sum(axis=1)
        chosen = int(np.argmax(sizes))
        if sizes[chosen] < _FEWEST_STILL:
            return tuple(found)


def _unevenness(centre_px: np.ndarray) -> float:
    """Usual difference between the spacing at a dot and that around it, in logarithms; inf for few dots.

    A median: some of the dots that a search by size finds are glints.
    """
    if len(centre_px) < _AROUND:
        return float("inf")
    distance, index = cKDTree(centre_px).query(centre_px, k=_AROUND)
    spacing = np.log(np.maximum(distance[:, 1:5].mean(axis=1), 1e-9))
    return float(np.median(np.abs(spacing - np.median(spacing[index], axis=1))))


def confirm_rest_dots(still: RestDots, known: RestDots, *, is_same_time: bool) -> RestDots:
    """Return the rest dots that belong to the pattern of the `known` dots of one frame.

    A search by size alone also finds glints and stripes. A dot is accepted if the survey found it, or if it
    lies on the lattice inside the surveyed pattern, unless there are many such dots. Known dots that the
    search missed are added if they were measured in the same frames.

    Args:
        still: dots that were found by their size in the rest frames.
        known: dots that the survey found in one frame.
        is_same_time: whether that is one of the rest frames.
    """
    if len(known.centre_px) < 2 or len(still.centre_px) < 2:
        return known if is_same_time else still
    gate = _GATE_SPACINGS * local_spacing(known.centre_px)
    _, again = match_mutual_nearest(known.centre_px, still.centre_px, gate)
    is_known = np.isin(np.arange(len(still.centre_px)), again)
    distance, nearest = cKDTree(known.centre_px).query(still.centre_px)
    lattice = find_lattice(still.centre_px)
    is_more = np.zeros(len(is_known), dtype=bool)
    if lattice is not None and not lattice.is_closed and lattice.is_member.sum() > 0.6 * len(known.centre_px):
        is_more = lattice.is_member & ~is_known & (distance > gate[nearest]) & _is_inside(still, known)
    keep = is_known if is_more.sum() > _MAX_ADDED_SHARE * len(known.centre_px) else is_known | is_more
    parts = [(still, keep)]
    if is_same_time:
        distance_px, _ = cKDTree(still.centre_px[keep]).query(known.centre_px) if keep.any() else (gate, None)
        parts.append((known, distance_px >= gate))
    return replace(
        still,
        centre_px=read_only(np.concatenate([each.centre_px[chosen] for each, chosen in parts])),
        area_px2=read_only(np.concatenate([each.area_px2[chosen] for each, chosen in parts])),
        contrast=read_only(np.concatenate([each.contrast[chosen] for each, chosen in parts])),
        noise_px=read_only(np.concatenate([each.noise_px[chosen] for each, chosen in parts])),
        times_seen=read_only(np.concatenate([each.times_seen[chosen] for each, chosen in parts])),
    )


def _is_inside(still: RestDots, known: RestDots) -> np.ndarray:
    """(n,) whether each rest dot lies inside the slightly enlarged outline of the known dots."""
    middle = known.centre_px.mean(axis=0)
    try:
        outline = Delaunay(middle + _OUTLINE_FACTOR * (known.centre_px - middle))
    except QhullError:  # all on one line
        return np.zeros(len(still.centre_px), dtype=bool)
    return np.asarray(outline.find_simplex(still.centre_px) >= 0)


def match_mutual_nearest(
    first: np.ndarray | cKDTree, second: np.ndarray | cKDTree, gate_px: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of points (n, 2) and (k, 2) that are mutual nearest neighbours, within gates (n,).

    A tree of the points can be given instead of them, for points that are matched more than once.
    """
    first, second = (each if isinstance(each, cKDTree) else cKDTree(each) for each in (first, second))
    if first.n == 0 or second.n == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    distance, forth = second.query(first.data)
    _, back = first.query(second.data)
    mutual = (back[forth] == np.arange(first.n)) & (distance < gate_px)
    return np.flatnonzero(mutual), forth[mutual]


def _agreement_of_frames(centres: list[np.ndarray]) -> np.ndarray:
    """(f, f) whether two frames show the same dots at the same positions."""
    number = len(centres)
    agrees = np.eye(number, dtype=bool)
    tree = [cKDTree(each) for each in centres]
    spacing = [
        local_spacing(each, tree[k]) if len(each) > 1 else np.array([np.inf])
        for k, each in enumerate(centres)
    ]
    for a in range(number):
        for b in range(a + 1, number):
            first, second = match_mutual_nearest(tree[a], tree[b], _GATE_SPACINGS * spacing[a])
            if len(first) < 0.6 * min(len(centres[a]), len(centres[b])):
                continue
            usual = float(np.median(spacing[a])) if np.isfinite(spacing[a]).all() else 10.0
            shift = np.linalg.norm(centres[a][first] - centres[b][second], axis=1)
            most, nearly_all = np.quantile(shift, [0.8, 0.97])
            agrees[a, b] = agrees[b, a] = most < 0.2 + 0.02 * usual and nearly_all < 0.3 + 0.1 * usual
    return agrees


def _merge(group: list[Detections], frames: tuple[int, ...], *, moved: bool) -> RestDots:
    """Medians of each dot over the frames of a group."""
    known = np.zeros((0, 2))
    rows: list[np.ndarray] = []  # per frame: (n, 4) x, y, area, contrast of each known dot
    for each in group:
        gate = _GATE_SPACINGS * (local_spacing(known) if len(known) > 1 else np.full(len(known), np.inf))
        first, second = match_mutual_nearest(known, each.centre_px, gate)
        fresh = np.setdiff1d(np.arange(len(each.centre_px)), second)
        # A new dot close to a known one is the same marker, split or shadowed.
        if len(known) > 1 and len(fresh):
            distance, nearest = cKDTree(known).query(each.centre_px[fresh])
            fresh = fresh[distance > gate[nearest]]
        values = np.column_stack([each.centre_px, each.area_px2, each.contrast])
        row = np.full((len(known) + len(fresh), 4), np.nan)
        row[first] = values[second]
        row[len(known) :] = values[fresh]
        known = np.concatenate([known, each.centre_px[fresh]])
        rows.append(row)
    table = np.full((len(group), len(known), 4), np.nan)
    for k, row in enumerate(rows):
        table[k, : len(row)] = row
    times = np.isfinite(table[..., 0]).sum(axis=0)
    table = table[:, times >= max(1.0, 0.4 * len(group))]
    still, unmoved = _still_frames(table[..., :2])
    part = table[still]
    is_lost = ~np.isfinite(part[..., 0]).any(axis=0)
    if is_lost.any():  # seen in other frames only
        part[0, is_lost] = np.nanmedian(table[:, is_lost], axis=0)
    return _medians_of_dots(part, tuple(frames[k] for k in still), unmoved=unmoved, moved=moved)


def _still_frames(position_px: Float64[np.ndarray, "f n 2"]) -> tuple[Int64[np.ndarray, " k"], int]:
    """The frames in which no group of dots is elsewhere than in the earliest one of them.

    Also the number of frames that are like it but for what still sheets move by, which may be more. These
    are all frames where fewer than `_FEWEST_STILL` are like any of them, or fewer than `_FEWEST_DOTS` dots
    are in all: too few to distinguish a press from noise.
    """
    count = len(position_px)
    position_px = position_px[:, np.isfinite(position_px[..., 0]).all(axis=0)]
    dots = position_px.shape[1]
    if count < _FEWEST_STILL or dots < _FEWEST_DOTS:
        return np.arange(count), count
    spacing_px = float(np.median(local_spacing(position_px[0])))
    steps_px = np.linalg.norm(np.diff(position_px, axis=0), axis=2)
    std_pitch = float(np.median(steps_px, axis=1).min()) / (_MEDIAN_LENGTH * spacing_px)
    motion = LocalMotion(noise_stds=_NOISE_STDS)
    groups, is_seen = marker_groups(position_px[0], spacing_px), np.ones(dots, dtype=np.bool_)
    steps = [float(motion(groups, each, is_seen).max()) for each in np.diff(position_px, axis=0)]
    most, _ = motion.limits(TouchMemory(), std_pitch)
    for limit in (min(most, largest_of_still(steps)), most):
        for first_px in position_px[: count - _FEWEST_STILL + 1]:
            away = np.array([motion(groups, each - first_px, is_seen).max() for each in position_px])
            still = np.flatnonzero(away <= limit)
            if len(still) >= _FEWEST_STILL:
                return still, int((away <= most).sum())
    return np.arange(count), count


def _medians_of_dots(table: np.ndarray, frames: tuple[int, ...], *, unmoved: int, moved: bool) -> RestDots:
    times = np.isfinite(table[..., 0]).sum(axis=0)
    middle = np.nanmedian(table, axis=0) if table.size else np.zeros((0, 4))
    return RestDots(
        centre_px=read_only(np.ascontiguousarray(middle[:, :2])),
        area_px2=read_only(np.ascontiguousarray(middle[:, 2])),
        contrast=read_only(np.ascontiguousarray(middle[:, 3])),
        noise_px=read_only(centre_noise_px(table[..., :2])),
        times_seen=read_only(times.astype(np.int64)),
        frames=frames,
        unmoved=unmoved,
        moved=moved,
    )
