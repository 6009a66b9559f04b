"""How the distances between neighbouring markers have changed, along and across the rays."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.neighbours import Neighbours
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Spacing:
    """From displacements to the changes of spacings.

    Attributes:
        neighbour: (m, k) around each marker.
        slope: (m, k, 2) weights of the neighbours' displacements, less the marker's own, in the slope along
            x and y of the plane that fits them best, near ones counting more.
        across: (m, 2) unit vectors across the way from the foot of the optical axis.
    """

    neighbour: Int64[np.ndarray, "m k"]
    slope: Float64[np.ndarray, "m k 2"]
    across: Points2

    def __call__(self, shift_mm: Points2) -> tuple[Scalars, Scalars]:
        """(m,) change of the logarithm of the area between neighbours, and twice that of lengths across.

        Args:
            shift_mm: (m, 2) displacements of all markers.
        """
        from manytouch.estimation.uncalibrated.spacing_kernels import stretched

        area, across = stretched(shift_mm, self.neighbour, self.slope, self.across)
        return area, across

    @property
    def noise(self) -> float:
        """Usual variance of a change of area for displacements of variance 1 along each axis."""
        own = self.slope.sum(axis=1)
        return float(np.median((self.slope**2).sum(axis=(1, 2)) + (own**2).sum(axis=1)))


def spacing(rest_mm: Points2, eye_mm: Float64[np.ndarray, "2"], neighbours: Neighbours) -> Spacing:
    """For markers that rest at (m, 2) in the plane of the sheet, and the foot of the optical axis there."""
    away = rest_mm[neighbours.index] - rest_mm[:, None]
    near = np.exp(-0.5 * (neighbours.distance / np.median(neighbours.distance)) ** 2)
    # Least squares of a plane through each marker and its neighbours, the marker itself with weight 1.
    middle = np.einsum("mk,mka->ma", near / (1.0 + near.sum(axis=1, keepdims=True)), away)
    centred = away - middle[:, None]
    gram = np.einsum("mk,mka,mkb->mab", near, centred, centred) + np.einsum("ma,mb->mab", middle, middle)
    slope = near[:, :, None] * np.einsum("mka,mab->mkb", centred, np.linalg.pinv(gram))
    arm = rest_mm - eye_mm
    across = np.column_stack([-arm[:, 1], arm[:, 0]])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(length > 0.0, across / np.where(length > 0.0, length, 1.0), [1.0, 0.0])
    return Spacing(neighbour=neighbours.index, slope=read_only(slope), across=read_only(across))
