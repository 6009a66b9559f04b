"""Groups of markers that are apart in the image, such as the views of one sheet in two mirrors."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from manytouch.tracking.lattice.find import local_spacing
from manytouch.values import Roi
from manytouch.values.arrays import Points2

_APART = 3.5
"""Spacings between neighbours of one group, at most: two markers that are missing in a row leave three."""
_ADJACENT = 2.5
"""The limit that distinguishes groups from strays between them: one missing marker leaves two."""
_FEWEST = 12
"""Markers of a group: fewer may be glints."""
_MARGIN = 2.0
"""Spacings by which a region is larger than its group, so that the markers may move."""


def separate_regions(centre_px: Points2, width_px: int, height_px: int) -> tuple[Roi, ...]:
    """A region around each group of markers (n, 2) that are apart; none if all are one group.

    Regions are from left to right, as far as the image extends, and do not contain markers of other groups.
    """
    if len(centre_px) < 2 * _FEWEST:
        return ()
    spacing = local_spacing(centre_px)
    group = _connected(centre_px, spacing, _ADJACENT)
    is_many = np.bincount(group)[group] >= _FEWEST
    centre_px, spacing = centre_px[is_many], spacing[is_many]
    group = _connected(centre_px, spacing, _APART) if is_many.any() else group[:0]
    if len(set(group.tolist())) < 2:
        return ()
    regions = []
    for number in range(int(group.max()) + 1):
        inside = group == number
        margin = _MARGIN * float(np.median(spacing[inside]))
        low = np.maximum(np.floor(centre_px[inside].min(axis=0) - margin), 0).astype(int)
        high = np.ceil(centre_px[inside].max(axis=0) + margin).astype(int)
        high = np.minimum(high, [width_px - 1, height_px - 1])
        is_within = ((centre_px >= low) & (centre_px <= high)).all(axis=1)
        if (is_within & ~inside).any():
            return ()
        regions.append(Roi(int(low[0]), int(low[1]), *(high - low + 1).tolist()))
    return tuple(sorted(regions, key=lambda each: (each.x_px, each.y_px)))


def _connected(centre_px: Points2, spacing: np.ndarray, reach: float) -> np.ndarray:
    """(n,) number of the group of each marker: neighbours are nearer than `reach` of the smaller spacing."""
    pairs = cKDTree(centre_px).query_pairs(reach * float(spacing.max()), output_type="ndarray")
    length = np.linalg.norm(centre_px[pairs[:, 0]] - centre_px[pairs[:, 1]], axis=1)
    pairs = pairs[length < reach * spacing[pairs].min(axis=1)]
    count = len(centre_px)
    links = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1])
