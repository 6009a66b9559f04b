"""Patches of pressure on a pad, and guesses of patches from others: one as two halves, two as one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.estimation.pad.patch_forces import OWN
from manytouch.estimation.pad.patch_kernels import SHAPE, Profile
from manytouch.values.arrays import read_only

_NEAR = 3.0  # distance of centres over the sum of the mean roots, from which on contacts do not overlap


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Patches:
    """Patches of pressure on a pad, one for each contact.

    Attributes:
        own: (c, OWN) parameters.
        profile: (c,) profiles of the pressure, as numbers of `Profile`.
    """

    own: Float64[np.ndarray, "c 10"]
    profile: Int64[np.ndarray, " c"]

    def __len__(self) -> int:
        return len(self.own)

    def without(self, numbers: int | Sequence[int] | np.ndarray) -> "Patches":
        """The patches but those with these numbers."""
        return Patches(
            own=read_only(np.delete(self.own, numbers, axis=0)),
            profile=read_only(np.delete(self.profile, numbers)),
        )

    def with_more(self, own: Float64[np.ndarray, "n 10"], profile: Profile) -> "Patches":
        """The patches, then further ones with one profile."""
        return Patches(
            own=read_only(np.vstack([self.own, own])),
            profile=read_only(np.append(self.profile, np.full(len(own), profile, dtype=np.int64))),
        )

    def with_profile(self, number: int, profile: Profile) -> "Patches":
        """The patches, one of them with another profile."""
        changed = self.profile.copy()
        changed[number] = profile
        return Patches(own=self.own, profile=read_only(changed))


NO_PATCHES = Patches(own=read_only(np.zeros((0, OWN))), profile=read_only(np.zeros(0, dtype=np.int64)))


def nearest_pair(patches: Patches) -> tuple[int, int] | None:
    """Two patches that overlap most; None if none do."""
    centre, root = patches.own[:, :2], np.abs(patches.own[:, 2:SHAPE])
    reach = np.sqrt(0.5 * (root**2).sum(axis=1))
    away = np.linalg.norm(centre[:, None] - centre, axis=2)
    overlap = away / (reach[:, None] + reach)
    overlap[np.diag_indices(len(centre))] = np.inf
    first, second = np.unravel_index(int(np.argmin(overlap)), overlap.shape)
    return None if overlap[first, second] > _NEAR else (int(first), int(second))


def halved(patches: Patches, number: int) -> Patches:
    """The guesses with one patch as two domes along its longer axis."""
    own = patches.own[number]
    root = np.array([[own[2], 0.0], [own[3], own[4]]])
    size, axes = np.linalg.eigh(root @ root.T)
    arm, narrow = axes[:, 1] * np.sqrt(size[1]), float(np.sqrt(max(size[0], 0.05 * size[1])))
    half = own.copy()
    half[2:SHAPE], half[SHAPE : OWN - 1] = (narrow, 0.0, narrow), 0.5 * own[SHAPE : OWN - 1]
    halves = np.stack([half, half])
    halves[0, :2] += arm
    halves[1, :2] -= arm
    return patches.without(number).with_more(halves, Profile.DOME)


def joined(patches: Patches, first: int, second: int) -> Patches:
    """The guesses with two patches as one dome with their force, centre and moments."""
    pair = patches.own[[first, second]]
    press = np.maximum(pair[:, SHAPE], 1e-9)
    share = press / press.sum()
    centre = share @ pair[:, :2]
    spread = np.zeros((2, 2))
    for part, own in zip(share, pair, strict=True):
        xx, yx, yy = own[2:SHAPE]
        root = np.array([[xx, 0.0], [yx, yy]])
        arm = own[:2] - centre
        spread += part * (root @ root.T + np.outer(arm, arm))
    root = np.linalg.cholesky(spread)
    load = pair[:, SHAPE:].sum(axis=0)
    one = np.array([*centre, root[0, 0], root[1, 0], root[1, 1], *load])
    one[OWN - 1] = share @ pair[:, OWN - 1]
    return patches.without([first, second]).with_more(one[None], Profile.DOME)
