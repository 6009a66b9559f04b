"""Guesses of contacts on a pad from others: one as two halves, two as one."""

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.pad.patch_forces import OWN
from manytouch.estimation.pad.patch_kernels import SHAPE

_NEAR = 3.0  # distance of centres over the sum of the mean roots, from which on contacts do not overlap


def nearest_pair(contact: Float64[np.ndarray, "c 10"]) -> tuple[int, int] | None:
    """Two contacts whose pressures overlap most; None if none do."""
    centre, root = contact[:, :2], np.abs(contact[:, 2:SHAPE])
    reach = np.sqrt(0.5 * (root**2).sum(axis=1))
    away = np.linalg.norm(centre[:, None] - centre, axis=2)
    overlap = away / (reach[:, None] + reach)
    overlap[np.diag_indices(len(centre))] = np.inf
    first, second = np.unravel_index(int(np.argmin(overlap)), overlap.shape)
    return None if overlap[first, second] > _NEAR else (int(first), int(second))


def halved(contact: Float64[np.ndarray, "c 10"], number: int) -> Float64[np.ndarray, "_ 10"]:
    """The guesses with one contact as two halves along its longer axis."""
    own = contact[number]
    root = np.array([[own[2], 0.0], [own[3], own[4]]])
    size, axes = np.linalg.eigh(root @ root.T)
    arm, narrow = axes[:, 1] * np.sqrt(size[1]), float(np.sqrt(max(size[0], 0.05 * size[1])))
    half = own.copy()
    half[2:SHAPE], half[SHAPE : OWN - 1] = (narrow, 0.0, narrow), 0.5 * own[SHAPE : OWN - 1]
    halves = np.stack([half, half])
    halves[0, :2] += arm
    halves[1, :2] -= arm
    return np.vstack([np.delete(contact, number, axis=0), halves])


def joined(contact: Float64[np.ndarray, "c 10"], first: int, second: int) -> Float64[np.ndarray, "_ 10"]:
    """The guesses with two contacts as one with their force, centre and moments."""
    press = np.maximum(contact[[first, second], SHAPE], 1e-9)
    share = press / press.sum()
    centre = share @ contact[[first, second], :2]
    spread = np.zeros((2, 2))
    for part, number in zip(share, (first, second), strict=True):
        xx, yx, yy = contact[number, 2:SHAPE]
        root = np.array([[xx, 0.0], [yx, yy]])
        arm = contact[number, :2] - centre
        spread += part * (root @ root.T + np.outer(arm, arm))
    root = np.linalg.cholesky(spread)
    load = contact[[first, second], SHAPE:].sum(axis=0)
    one = np.array([*centre, root[0, 0], root[1, 0], root[1, 1], *load])
    one[OWN - 1] = share @ contact[[first, second], OWN - 1]
    return np.vstack([np.delete(contact, [first, second], axis=0), one])
