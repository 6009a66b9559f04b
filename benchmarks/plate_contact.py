"""A rigid plate that lies on the face of a bonded pad: it presses and cannot pull.

The face follows the six motions of the plate. Where the plate would have to pull, nodes have no normal force
and are below it. They follow it sideways all the same: if their shear ended with the pressure, forces would
not be continuous in the motion, and in general only a small part of the face is not pressed. Which nodes
these are follows uniquely from the motion, since the stiffness is positive definite.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from manytouch.estimation.pad.pad_model import BondedPadModel
from manytouch.values.arrays import Mask, Points2

MODES = 6
_ROUNDS = 30
_NONE = 1e-9
"""Pulling force over the largest force, and height over the largest motion, that count as none."""


@dataclass(frozen=True)
class PlateContact:
    """A pad of n nodes and m markers under a plate. Motions of the plate are in mm.

    Attributes:
        place_mm: (n, 2) of the nodes.
        stiffness: (3 n, 3 n) nodal forces over E by motions of the nodes, mm.
        held: (3 n, MODES) nodal forces over E by motions of the plate if it holds all nodes, mm: along x,
            along y, inwards, outwards in proportion to x and to y, and about the normal. The last three are
            over half the longer side of the pad.
        by_force: (3 n, 2 m) marker images by nodal forces over E, px / mm^2.
    """

    place_mm: Points2
    stiffness: Float64[np.ndarray, "n3 n3"]
    held: Float64[np.ndarray, "n3 6"]
    by_force: Float64[np.ndarray, "n3 m2"]

    def nodal(self, is_free: Mask) -> Float64[np.ndarray, "n3 6"]:
        """Nodal forces over E by each motion of the plate, mm; free nodes have no normal one."""
        free = 3 * np.flatnonzero(is_free) + 2
        return np.asarray(self.held + self.stiffness[free].T @ self._off(free, self.held))

    def images(self, nodal: Float64[np.ndarray, "n3 6"]) -> Float64[np.ndarray, "6 m2"]:
        """(MODES, 2 m) marker images by `nodal`, px / mm."""
        return np.asarray(nodal.T @ self.by_force)

    def forces(self, nodal: Float64[np.ndarray, "n3 6"]) -> Float64[np.ndarray, "3 6"]:
        """(3, MODES) forces over E of the plate by `nodal`, mm; normal positive in compression."""
        total = nodal.reshape(-1, 3, MODES).sum(axis=0)
        return np.asarray(total * np.array([1.0, 1.0, -1.0])[:, None])

    def free_nodes(self, motion_mm: Float64[np.ndarray, " 6"], guess: Mask) -> Mask:
        """(n,) the nodes that a plate does not press after a motion; those of a guess are tried first."""
        held, is_free = self.held @ motion_mm, guess
        tried: set[bytes] = set()
        for _ in range(_ROUNDS):
            tried.add(is_free.tobytes())
            free = 3 * np.flatnonzero(is_free) + 2
            off_mm = self._off(free, held)
            force = (held + self.stiffness[free].T @ off_mm).reshape(-1, 3)[:, 2]
            height_mm = np.zeros(len(is_free))
            height_mm[is_free] = off_mm
            pulls = force > _NONE * np.abs(force).max()
            stays_free = height_mm <= _NONE * np.abs(motion_mm).max()
            found: Bool[np.ndarray, " n"] = np.where(is_free, stays_free, pulls)
            if found.tobytes() in tried:
                break
            is_free = found
        return is_free

    def _off(self, free: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Motions of the free components from where the plate would hold them, mm."""
        return np.asarray(-np.linalg.solve(self.stiffness[np.ix_(free, free)], held[free]))


def plate_contact(pad: BondedPadModel) -> PlateContact:
    """A plate on all of the face of a pad."""
    nodes = len(pad.face)
    place = pad.patch.place_mm / (0.5 * max(pad.patch.size_mm))
    rigid = np.zeros((nodes, 3, MODES))
    rigid[:, 0, 0], rigid[:, 1, 1], rigid[:, 2, 2] = 1.0, 1.0, -1.0
    rigid[:, 2, 3], rigid[:, 2, 4] = place[:, 0], place[:, 1]
    rigid[:, 0, 5], rigid[:, 1, 5] = -place[:, 1], place[:, 0]
    stiffness = np.linalg.inv(pad.face.reshape(3 * nodes, 3 * nodes))
    stiffness = 0.5 * (stiffness + stiffness.T)
    image = np.einsum("mij,ncmj->ncmi", pad.slope_px, pad.marker)
    return PlateContact(
        place_mm=pad.patch.place_mm,
        stiffness=stiffness,
        held=stiffness @ rigid.reshape(3 * nodes, MODES),
        by_force=image.reshape(3 * nodes, -1),
    )
