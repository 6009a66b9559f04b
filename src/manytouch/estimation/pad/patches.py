"""Patches of pressure on a pad, and guesses of patches from others: one as two halves, two as one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse.csgraph import connected_components

from manytouch.estimation.pad.patch_forces import FORCE, PARAMETER_COUNT, RADIAL_SHEAR, TORQUE
from manytouch.estimation.pad.patch_kernels import ROOT_XX, ROOT_YX, ROOT_YY, SHAPE, Profile
from manytouch.values.arrays import Mask, Points2, read_only

_WIDER = 2.5
"""Root of a guess over that of a contact that explains the images badly; chosen on one ring, in
`test_patch_search.py`."""
_LEAST_MOMENT_SHARE = 0.05  # least ratio of the principal moments of a half, so that it is not 0; a choice
_NEAR = 3.0  # distance of centres over the sum of the mean roots, from which on contacts do not overlap


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Patches:
    """Patches of pressure on a pad, one for each contact.

    Attributes:
        parameters: (c, PARAMETER_COUNT) of each: its shape, mm (`patch_kernels.SHAPE`), then its loads
            (`patch_forces.LOAD_COUNT`).
        profile: (c,) profiles of the pressure, as numbers of `Profile`.
    """

    parameters: Float64[np.ndarray, "c 10"]
    profile: Int64[np.ndarray, " c"]

    def __len__(self) -> int:
        return len(self.parameters)

    def without(self, numbers: int | Sequence[int] | np.ndarray) -> "Patches":
        """The patches but those with these numbers."""
        return Patches(
            parameters=read_only(np.delete(self.parameters, numbers, axis=0)),
            profile=read_only(np.delete(self.profile, numbers)),
        )

    def with_more(self, parameters: Float64[np.ndarray, "n 10"], profile: Profile) -> "Patches":
        """The patches, then further ones with one profile."""
        return Patches(
            parameters=read_only(np.vstack([self.parameters, parameters])),
            profile=read_only(np.append(self.profile, np.full(len(parameters), profile, dtype=np.int64))),
        )

    def with_profile(self, number: int, profile: Profile) -> "Patches":
        """The patches, one of them with another profile."""
        changed = self.profile.copy()
        changed[number] = profile
        return Patches(parameters=self.parameters, profile=read_only(changed))

    def are_near(self, place_mm: Points2, reach_mm: float) -> Mask:
        """(k,) whether places (k, 2) have the centre of a patch nearby."""
        away_mm = np.linalg.norm(place_mm[:, None] - self.parameters[:, :2], axis=2)
        return np.asarray(away_mm.min(axis=1, initial=np.inf) < reach_mm)


NO_PATCHES = Patches(
    parameters=read_only(np.zeros((0, PARAMETER_COUNT))), profile=read_only(np.zeros(0, dtype=np.int64))
)


def _overlap(patches: Patches) -> Float64[np.ndarray, "c c"]:
    """Distances of centres over the sums of the mean roots; infinite on the diagonal."""
    centre, root = patches.parameters[:, :2], np.abs(patches.parameters[:, ROOT_XX:SHAPE])
    reach = np.sqrt(0.5 * (root**2).sum(axis=1))
    overlap = np.linalg.norm(centre[:, None] - centre, axis=2) / (reach[:, None] + reach)
    overlap[np.diag_indices(len(centre))] = np.inf
    return np.asarray(overlap)


def nearest_pair(patches: Patches) -> tuple[int, int] | None:
    """Two patches that overlap most; None if none do."""
    overlap = _overlap(patches)
    first, second = np.unravel_index(int(np.argmin(overlap)), overlap.shape)
    return None if overlap[first, second] > _NEAR else (int(first), int(second))


def near_groups(patches: Patches) -> list[tuple[int, ...]]:
    """The two patches that overlap most, and those that are linked by overlaps; none if none overlap."""
    if len(patches) < 2 or (pair := nearest_pair(patches)) is None:
        return []
    _, group = connected_components(_overlap(patches) <= _NEAR, directed=False)
    linked = tuple(int(number) for number in np.flatnonzero(group == group[pair[0]]))
    return [pair] if len(linked) == 2 else [pair, linked]


def halved_or_wider(patches: Patches) -> list[Patches]:
    """The guesses with the widest patch as two, and with it `_WIDER` times as wide, with each profile."""
    widest = int(np.argmax((patches.parameters[:, ROOT_XX:SHAPE] ** 2).sum(axis=1)))
    return [_halved(patches, widest), *widened(patches, widest, _WIDER)]


def _halved(patches: Patches, number: int) -> Patches:
    """The guesses with one patch as two domes along its longer axis."""
    parameters = patches.parameters[number]
    root = np.array([[parameters[ROOT_XX], 0.0], [parameters[ROOT_YX], parameters[ROOT_YY]]])
    size, axes = np.linalg.eigh(root @ root.T)
    arm, narrow = axes[:, 1] * np.sqrt(size[1]), float(np.sqrt(max(size[0], _LEAST_MOMENT_SHARE * size[1])))
    half = parameters.copy()
    half[ROOT_XX:SHAPE], half[FORCE:RADIAL_SHEAR] = (
        (narrow, 0.0, narrow),
        0.5 * parameters[FORCE:RADIAL_SHEAR],
    )
    halves = np.stack([half, half])
    halves[0, :2] += arm
    halves[1, :2] -= arm
    return patches.without(number).with_more(halves, Profile.DOME)


def widened(patches: Patches, number: int, times: float) -> list[Patches]:
    """The guesses with one patch `times` as wide as the mean of its roots, with each profile.

    It has the force of the patch, without torque and radial shear, which explain what is wrong with a width.
    """
    parameters = patches.parameters[number].copy()
    root = times * float(np.sqrt(0.5 * (parameters[ROOT_XX:SHAPE] ** 2).sum()))
    parameters[ROOT_XX:SHAPE] = root, 0.0, root
    parameters[TORQUE:] = 0.0
    return [patches.without(number).with_more(parameters[None], profile) for profile in Profile]


def joined(patches: Patches, numbers: Sequence[int]) -> Patches:
    """The guesses with some patches as one dome with their force, centre and moments; it is the last."""
    parts = patches.parameters[list(numbers)]
    press = np.maximum(parts[:, FORCE], 1e-9)
    share = press / press.sum()
    centre = share @ parts[:, :2]
    spread = np.zeros((2, 2))
    for weight, parameters in zip(share, parts, strict=True):
        root = np.array([[parameters[ROOT_XX], 0.0], [parameters[ROOT_YX], parameters[ROOT_YY]]])
        arm = parameters[:2] - centre
        spread += weight * (root @ root.T + np.outer(arm, arm))
    root = np.linalg.cholesky(spread)
    load = parts[:, FORCE:].sum(axis=0)
    one = np.array([*centre, root[0, 0], root[1, 0], root[1, 1], *load])
    one[RADIAL_SHEAR] = share @ parts[:, RADIAL_SHEAR]
    return patches.without(numbers).with_more(one[None], Profile.DOME)
