"""Few dots before a cluttered scene, which moves: what stays in place and lies on a lattice.

A transparent skin shows its dots and whatever is behind it. Round spots of several pictures are compared:
a dot is at the same place in most of them, a thing behind the skin in few. Of the lasting spots of similar
size, the largest set is taken that is a lattice with smooth lines, as a camera with any lens shows it. What
does not lie on these lines is no marker.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from manytouch.calibration.rest_dots import RestDots
from manytouch.tracking.lattice.find import find_lattice, local_spacing, predict_positions
from manytouch.values import Frame, Polarity, Roi
from manytouch.values.arrays import Mask, Points2, Scalars, read_only
from manytouch.values.images.grey_levels import level_scale

MOST_PICTURES = 16
_POLARITIES: tuple[Polarity, ...] = ("dark", "light")
_FEWEST = 12  # dots; fewer may lie on a lattice by chance
_LASTING = 0.4  # share of the pictures in which a dot is visible
_SMALLEST_PX, _LARGEST_PX, _BANDS, _BAND_WIDTH = 1.2, 40.0, 13, 3.2  # radii; a fisheye shows unequal dots
_CONTRASTS = (0.0, 0.15, 0.3, 0.45)  # least ones tried, over the upper quartile
_MOST_SPOTS = 400
_MEMBERS = 0.6  # least share of the similar spots that lie on the lattice
_SMOOTH = 0.12  # largest RMS deviation from smooth lines, over the spacing
_MARGIN = 2  # lattice lines beyond those of the well outlined dots
_GATE = 0.2  # of the spacing, around the predicted place of a dot
_STRAY = 3.0  # times this deviation a spot is no marker


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Spots:
    """Spots that last over pictures: medians (n, 2), (n,) and the number of pictures that show them.

    `is_round` are those that are well outlined in most of these.
    """

    place_px: Points2
    radius_px: Scalars
    contrast: Scalars
    is_round: Mask
    times: np.ndarray

    def at(self, chosen: np.ndarray) -> "_Spots":
        return _Spots(
            place_px=self.place_px[chosen],
            radius_px=self.radius_px[chosen],
            contrast=self.contrast[chosen],
            is_round=self.is_round[chosen],
            times=self.times[chosen],
        )


def find_sparse_dots(frames: Sequence[Frame], roi_px: Roi | None) -> tuple[Polarity, RestDots] | None:
    """Polarity and rest positions of few dots before a cluttered scene; None if there is no lattice of them.

    Args:
        frames: pictures of a sheet that nearly rests, far apart in time if possible.
        roi_px: x, y, width, height of the region of interest.
    """
    from manytouch.detection.appearance.channel import find_spots
    from manytouch.detection.images import crop

    pictures = [k for k, frame in enumerate(frames) if frame.image is not None]
    even = np.linspace(0, len(pictures) - 1, min(len(pictures), MOST_PICTURES)).round().astype(int)
    pictures = [pictures[k] for k in even]
    best: tuple[float, Polarity, _Spots] | None = None
    for polarity in _POLARITIES:
        tables = []
        for k in pictures:
            image = frames[k].image
            assert image is not None
            part, corner = crop(image, roi_px)
            if min(part.shape[:2]) < 16:
                return None
            spots, is_round = find_spots(part, level_scale(image), polarity)
            tables.append(
                np.column_stack([spots.place_px + corner, spots.radius_px, spots.contrast, is_round])
            )
        found = _largest_lattice(_lasting_spots(tables))
        if found is not None and (best is None or found[0] > best[0]):
            best = found[0], polarity, found[1]
    if best is None:
        return None
    dots = best[2]
    return best[1], RestDots(
        centre_px=read_only(dots.place_px),
        area_px2=read_only(np.pi * dots.radius_px**2),
        contrast=read_only(dots.contrast),
        noise_px=read_only(np.full(len(dots.times), np.nan)),
        times_seen=read_only(dots.times),
        frames=tuple(pictures),
        unmoved=len(pictures),
        moved=False,
    )


def _lasting_spots(tables: list[Float64[np.ndarray, "_ 5"]]) -> _Spots:
    """The well outlined spots that most of the pictures show, then others that are not at the same places."""
    sure = _lasting([table[table[:, 4] > 0] for table in tables])
    every = _lasting(tables)
    if len(sure.times) and len(every.times):
        distance, nearest = cKDTree(sure.place_px).query(every.place_px)
        every = every.at(np.flatnonzero(distance > np.maximum(sure.radius_px[nearest], every.radius_px)))
    return _Spots(
        place_px=np.concatenate([sure.place_px, every.place_px]),
        radius_px=np.concatenate([sure.radius_px, every.radius_px]),
        contrast=np.concatenate([sure.contrast, every.contrast]),
        is_round=np.arange(len(sure.times) + len(every.times)) < len(sure.times),
        times=np.concatenate([sure.times, every.times]),
    )


def _lasting(tables: list[Float64[np.ndarray, "_ 5"]]) -> _Spots:
    """The spots that most of the pictures show; each table has x, y, radius, contrast, is round."""
    every = np.concatenate(tables)
    picture = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
    left, rows, times = np.ones(len(every), dtype=np.bool_), [], []
    near = cKDTree(every[:, :2]).query_ball_point(every[:, :2], np.maximum(0.6 * every[:, 2], 1.0))
    for k in np.argsort([-len(set(picture[each])) for each in near], kind="stable"):
        members = np.array([j for j in near[k] if left[j]], dtype=np.int64)
        if not left[k]:
            continue
        left[members] = False
        seen = len(set(picture[members]))
        if seen >= _LASTING * len(tables):
            rows.append(np.median(every[members], axis=0))
            times.append(seen)
    table = np.array(rows).reshape(-1, 5)
    return _Spots(
        place_px=table[:, :2].copy(),
        radius_px=table[:, 2].copy(),
        contrast=table[:, 3].copy(),
        is_round=table[:, 4] >= 0.5,
        times=np.array(times, dtype=np.int64),
    )


def _largest_lattice(spots: _Spots) -> tuple[float, _Spots] | None:
    """The similar spots that lie on the largest smooth lattice, with a score."""
    best: tuple[float, np.ndarray] | None = None
    for low in np.geomspace(_SMALLEST_PX, _LARGEST_PX, _BANDS):
        is_similar = (spots.radius_px >= low) & (spots.radius_px < _BAND_WIDTH * low)
        band = np.flatnonzero(is_similar & spots.is_round)
        if len(band) < _FEWEST:
            continue
        usual = np.quantile(spots.contrast[band], 0.75)
        sizes = set()
        for share in _CONTRASTS:
            similar = band[spots.contrast[band] >= share * usual]
            count = len(similar)
            if count in sizes or not _FEWEST <= count <= _MOST_SPOTS:
                continue
            sizes.add(count)
            place_px = spots.place_px[similar]
            lattice = find_lattice(place_px)
            if lattice is None or lattice.is_closed:
                continue
            member = _smooth_members(place_px, lattice.place, lattice.is_member)
            number = int(member.sum())
            score = number**2 / count
            if number >= max(_FEWEST, _MEMBERS * count) and (best is None or score > best[0]):
                best = score, _completed(spots, similar[member], lattice.place[member])
    return None if best is None else (best[0], spots.at(best[1]))


def _completed(spots: _Spots, members: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The members of a lattice, and spots of any outline where its lines continue."""
    grid = np.full(np.ptp(place, axis=0) + 1 + 2 * _MARGIN, -1)
    grid[tuple((place - place.min(axis=0) + _MARGIN).T)] = members
    for _ in range(_MARGIN):
        position = spots.place_px[np.maximum(grid, 0)]
        position[grid < 0] = np.nan
        guess, votes = predict_positions(position)
        rows, columns = np.nonzero((grid < 0) & (votes >= 1))
        free = np.setdiff1d(np.arange(len(spots.times)), grid)
        if len(rows) == 0 or len(free) == 0:
            break
        inside = grid[grid >= 0]
        distance, nearest = cKDTree(spots.place_px[free]).query(guess[rows, columns])
        candidate = free[nearest]
        _, near = cKDTree(spots.place_px[inside]).query(spots.place_px[candidate], k=4)
        usual = [np.median(each[inside][near], axis=1) for each in (spots.radius_px, spots.contrast)]
        size, contrast = spots.radius_px[candidate] / usual[0], spots.contrast[candidate] / usual[1]
        spacing = np.median(local_spacing(spots.place_px[inside])[near], axis=1)
        fits = (distance < _GATE * spacing) & (size > 0.65) & (size < 1.8) & (contrast > 0.3)
        order = np.flatnonzero(fits)[np.argsort(distance[fits] / spacing[fits], kind="stable")]
        _, first = np.unique(candidate[order], return_index=True)
        chosen = order[first]
        if len(chosen) == 0:
            break
        grid[rows[chosen], columns[chosen]] = candidate[chosen]
    return np.asarray(grid[grid >= 0])


def _smooth_members(place_px: Points2, place: np.ndarray, is_member: Mask) -> Mask:
    """(n,) members of a lattice, at rows and columns (n, 2), on its smooth lines; none if it has no such."""
    member = np.array(is_member)
    spacing = float(np.median(local_spacing(place_px[member])))
    for _ in range(4):
        inside = np.flatnonzero(member)
        terms = _polynomial(place[inside], 3 if len(inside) >= 16 else 2)
        if len(inside) < _FEWEST or np.linalg.matrix_rank(terms) < terms.shape[1]:
            return np.zeros(len(member), dtype=np.bool_)
        fitted, *_ = np.linalg.lstsq(terms, place_px[inside], rcond=None)
        off = np.linalg.norm(place_px[inside] - terms @ fitted, axis=1) / spacing
        off *= np.sqrt(len(inside) / (len(inside) - terms.shape[1]))
        usual = float(np.median(off)) * 1.2
        far = off > max(_STRAY * usual, 2.0 * _SMOOTH)
        if not far.any():
            break
        member[inside[far]] = False
    is_smooth = float(np.sqrt((off**2).mean())) < _SMOOTH
    return member if is_smooth else np.zeros(len(member), dtype=np.bool_)


def _polynomial(place: np.ndarray, degree: int) -> Float64[np.ndarray, "n t"]:
    """(n, t) products of powers of row and column up to a degree in total."""
    row, column = (place - place.mean(axis=0)).T / max(float(np.ptp(place)), 1.0)
    return np.column_stack(
        [row**a * column**b for a in range(degree + 1) for b in range(degree + 1 - a)]
    ).astype(np.float64)
