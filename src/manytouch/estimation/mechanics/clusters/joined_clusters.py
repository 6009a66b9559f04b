"""Joins clusters of forces to one, with the moments that follow from those of the parts."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from manytouch.estimation.mechanics.clusters.face_fits import CORNERS
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.inversion.force_nodes import ForceNodes
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.shell import Shell
from manytouch.values.arrays import Points2, Scalars

_PLACES = np.linspace(0.0, 1.0, 17)
"""Where the sheet is compared with the line between two clusters, over their distance."""
_ROW = 0.1  # largest width of a row of clusters over its length


def join_clusters(
    result: Clusters,
    clusters: Clusters,
    own: Int64[np.ndarray, " k"],
    edge: tuple[float, float],
    *,
    is_one_as_before: bool,
) -> Clusters:
    """`result` with some clusters joined to the first of them as one face; the others get no force.

    Args:
        result: the clusters, of which others may have been joined already.
        clusters: the same without joins.
        own: numbers of the clusters to join, none of which has been joined.
        edge: `edge_share` and `max_edge_mm` of `RigidFaces`.
        is_one_as_before: of the joined cluster; see `Clusters`.
    """
    share = clusters.normal_mm2[own] / clusters.normal_mm2[own].sum()
    centre_mm, spread = _joint_moments(clusters, own)
    corner_points_mm = (
        _rectangle(centre_mm, spread) if len(own) == 2 else _corner_points(clusters, own, *edge)
    )
    arm = clusters.centre_mm[own] - centre_mm
    force_mm2 = clusters.force_mm2[own].sum(axis=0)
    turned = arm[:, 0] * clusters.force_mm2[own, 1] - arm[:, 1] * clusters.force_mm2[own, 0]
    covariance = _joint_covariance(clusters.covariance[own], share)
    first, others = own[0], own[1:]

    def changed(old: np.ndarray, new: np.ndarray | float) -> np.ndarray:
        copy = old.copy()
        copy[first] = new
        return copy

    force = changed(result.force_mm2, force_mm2)
    force[others] = 0.0
    label = result.label.copy()
    label[np.isin(label, others)] = first
    return replace(
        result,
        centre_mm=changed(result.centre_mm, centre_mm),
        force_mm2=force,
        torque_mm3=changed(result.torque_mm3, float((clusters.torque_mm3[own] + turned).sum())),
        spread_mm2=changed(result.spread_mm2, spread),
        covariance=changed(result.covariance, covariance),
        label=label,
        is_face=changed(result.is_face, True),
        corner_points_mm=(
            *result.corner_points_mm[:first],
            corner_points_mm,
            *result.corner_points_mm[first + 1 :],
        ),
        is_one_as_before=changed(result.is_one_as_before, is_one_as_before),
    )


def _joint_moments(
    clusters: Clusters, own: Int64[np.ndarray, " k"]
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2 2"]]:
    """Centre (mm) and second moment (mm^2) of the pressure of several clusters."""
    share = clusters.normal_mm2[own] / clusters.normal_mm2[own].sum()
    centre_mm = share @ clusters.centre_mm[own]
    arm = clusters.centre_mm[own] - centre_mm
    spread = np.einsum("k,kij->ij", share, clusters.spread_mm2[own] + arm[:, :, None] * arm[:, None, :])
    return centre_mm, spread


def moments_of_pair(clusters: Clusters, own: Int64[np.ndarray, "2"]) -> tuple[Scalars, Scalars]:
    """Second moments (2,) of the pressure of two clusters along and across the line between them, mm^2."""
    x, y = clusters.centre_mm[own[1]] - clusters.centre_mm[own[0]]
    axes = np.array([[x, y], [-y, x]]) / np.hypot(x, y)
    along_mm2, across_mm2 = np.einsum("ai,kij,aj->ak", axes, clusters.spread_mm2[own], axes)
    return along_mm2, across_mm2


def _rectangle(
    centre_mm: Float64[np.ndarray, "2"], spread_mm2: Float64[np.ndarray, "2 2"]
) -> Float64[np.ndarray, "4 2"]:
    """Corners of the rectangular face under a pressure with these second moments.

    Two places do not show the width of a face. A side has the length of 2 roots of the second moment if only
    the corners press, and of 2 sqrt(3) roots if the pressure is even; this is the geometric mean.
    """
    size, axes = np.linalg.eigh(spread_mm2)
    half_mm = 3.0**0.25 * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(centre_mm + (CORNERS * half_mm) @ axes.T)


def _joint_covariance(each: Float64[np.ndarray, "k 6 6"], share: Scalars) -> Float64[np.ndarray, "6 6"]:
    """Covariance of the sum of forces, and of the means of the other estimates, with independent errors."""
    if np.isnan(each).any():
        return np.full((6, 6), np.nan)
    total = np.zeros((6, 6))
    scale = np.ones((len(share), 6))
    scale[:, 1:] = share[:, None]
    for part, covariance in zip(scale, each, strict=True):
        total += part[:, None] * covariance * part
    return total


def depths_and_rises(
    shell: Shell, coefficient_mm: Nodal, centre_mm: Points2
) -> tuple[Scalars, Float64[np.ndarray, "c c"]]:
    """Depths (c,) of the sheet at two places or more (c, 2), and by how much it is less deep between two.

    The latter (c, c), in mm, is the most by which the sheet is less deep than the straight line between two
    places: 0 where it is nowhere less deep, infinite for a place and itself.
    """
    count = len(centre_mm)
    first, second = np.triu_indices(count, 1)
    along_mm = centre_mm[first, None] + _PLACES[:, None] * (centre_mm[second] - centre_mm[first])[:, None]
    face = Face(shell=shell, point_mm=np.ascontiguousarray(along_mm.reshape(-1, 2)))
    found_mm = -face.displacement(coefficient_mm)[:, 2].reshape(len(first), len(_PLACES))
    line_mm = found_mm[:, :1] + _PLACES * (found_mm[:, -1:] - found_mm[:, :1])
    rise_mm, depth_mm = np.full((count, count), np.inf), np.empty(count)
    rise_mm[first, second] = rise_mm[second, first] = (line_mm - found_mm).max(axis=1)
    depth_mm[first], depth_mm[second] = found_mm[:, 0], found_mm[:, -1]
    return depth_mm, rise_mm


def off_plane(place_mm: Points2, depth_mm: Scalars) -> tuple[bool, float]:
    """Whether places (c, 2) are in a row; most that depths (c,) are off a plane, or off a line on a row."""
    arm_mm = place_mm - place_mm.mean(axis=0)
    extent_mm = np.linalg.svd(arm_mm, compute_uv=False)
    is_row = bool(extent_mm[1] <= _ROW * extent_mm[0])
    off_mm = depth_mm - depth_mm.mean()
    off_mm -= arm_mm @ np.linalg.lstsq(arm_mm, off_mm, rcond=_ROW if is_row else None)[0]
    return is_row, float(np.abs(off_mm).max())


def is_in_none(faces: list[Int64[np.ndarray, " k"]], count: int) -> Bool[np.ndarray, " c"]:
    """(c,) whether each of `count` clusters is in no face."""
    is_left = np.ones(count, dtype=np.bool_)
    for face in faces:
        is_left[face] = False
    return is_left


def connected_groups(is_joined: Bool[np.ndarray, "c c"], least: int = 2) -> list[Int64[np.ndarray, " k"]]:
    """Groups of so many clusters or more that pairs connect."""
    if not is_joined.any():
        return []
    groups, label = connected_components(csr_array(is_joined), directed=False)
    found = [np.flatnonzero(label == group) for group in range(groups)]
    return [own for own in found if len(own) >= least]


def with_enclosed(
    clusters: Clusters, nodes: ForceNodes, own: Int64[np.ndarray, " k"], group: Int64[np.ndarray, " g"]
) -> Int64[np.ndarray, " _"]:
    """The clusters of a face with those of the group within the ellipse of its pressure."""
    centre_mm, spread = _joint_moments(clusters, own)
    arm_mm = clusters.centre_mm[group] - centre_mm
    spread += np.diag(nodes.own_spread_mm2)
    within = np.einsum("ki,ki->k", arm_mm, np.linalg.solve(spread, arm_mm.T).T) <= 4.0
    return np.union1d(own, group[within])


def without_weak(
    alone_mm: Scalars, own: Int64[np.ndarray, " k"], least: int, min_ratio: float
) -> Iterator[Int64[np.ndarray, " _"]]:
    """The group, then without its weakest cluster, and so on while that is much weaker than the first.

    Errors of the sensor file cause weak forces near a face, or between its ends.

    Args:
        alone_mm: (c,) depths that the forces of the clusters would cause one by one.
        own: numbers of those of the group.
        least: number of clusters that remain.
        min_ratio: of such a depth to the largest one, above which a cluster is not weak.
    """
    own = own[np.argsort(-alone_mm[own], kind="stable")]
    for count in range(len(own), least - 1, -1):
        yield own[:count]
        if alone_mm[own[count - 1]] >= min_ratio * alone_mm[own[0]]:
            return


def _corner_points(
    clusters: Clusters, own: Int64[np.ndarray, " k"], edge_share: float, max_edge_mm: float
) -> Float64[np.ndarray, "_ 2"]:
    """Points around each place where a face presses.

    The pressure is highest at the edge, so that only a part of its extent lies within the face.

    Args:
        clusters: of a frame.
        own: numbers of those of the face.
        edge_share, max_edge_mm: that part, see `RigidFaces`.
    """
    size, axes = np.linalg.eigh(clusters.spread_mm2[own])
    half_mm = edge_share * 2.0 * np.sqrt(np.maximum(size, 0.0))
    arm_mm = axes.transpose(0, 2, 1) * np.minimum(half_mm, max_edge_mm)[:, :, None]
    around_mm = clusters.centre_mm[own][:, None] + np.concatenate([arm_mm, -arm_mm], axis=1)
    return np.asarray(around_mm.reshape(-1, 2))


def is_between(
    point_mm: Float64[np.ndarray, "p 2"],
    ends_mm: Float64[np.ndarray, "2 2"],
    reach_mm: float,
    least_share: float,
) -> Bool[np.ndarray, " p"]:
    """(p,) whether points are within a distance of the line between two ends, and away from both.

    Args:
        point_mm: (p, 2).
        ends_mm: (2, 2) the ends.
        reach_mm: the distance.
        least_share: least distance from either end, over their distance.
    """
    along_mm = ends_mm[1] - ends_mm[0]
    arm_mm = point_mm - ends_mm[0]
    share = arm_mm @ along_mm / float(along_mm @ along_mm)
    away_mm = np.linalg.norm(arm_mm - share[:, None] * along_mm, axis=1)
    return np.asarray((away_mm <= reach_mm) & (share >= least_share) & (share <= 1.0 - least_share))
