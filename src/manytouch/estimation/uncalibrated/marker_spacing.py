"""Changes of the distances between neighbouring markers, along and across the rays."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.geometry.neighbours import Neighbours
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MarkerSpacing:
    """From displacements to the changes of spacings.

    Attributes:
        neighbour: (m, k) markers around each marker.
        slope: (m, k, 2) weights of the neighbours' displacements, minus the marker's own, in the slope along
            x and y of the plane that fits them best; near neighbours have more weight.
        across: (m, 2) unit vectors perpendicular to the direction from the foot of the optical axis.
        least: smallest remaining share of an area or length; a sheet that folds is not followed further.
    """

    neighbour: Int64[np.ndarray, "m k"]
    slope: Float64[np.ndarray, "m k 2"]
    across: Points2
    least: float = 0.2

    def __call__(self, displacement_mm: Points2) -> tuple[Scalars, Scalars]:
        """(m,) logarithm of the change of the area between neighbours, and twice that of lengths across.

        Args:
            displacement_mm: (m, 2) of all markers.
        """
        from manytouch.estimation.uncalibrated.marker_spacing_kernels import SpacingStencil, log_stretch

        stencil = SpacingStencil(self.neighbour, self.slope, self.across, self.least)
        area, across = log_stretch(displacement_mm, stencil)
        return area, across

    @property
    def noise(self) -> float:
        """Median variance of a change of area for displacements of variance 1 along each axis."""
        own = self.slope.sum(axis=1)
        return float(np.median((self.slope**2).sum(axis=(1, 2)) + (own**2).sum(axis=1)))


def marker_spacing(
    rest_mm: Points2, axis_mm: Float64[np.ndarray, "2"], neighbours: Neighbours
) -> MarkerSpacing:
    """For markers at rest (m, 2) in the plane of the sheet, and the foot of the optical axis there."""
    offset = rest_mm[neighbours.index] - rest_mm[:, None]
    weight = np.exp(-0.5 * (neighbours.distance / np.median(neighbours.distance)) ** 2)
    # Least squares of a plane through each marker and its neighbours, the marker itself with weight 1.
    middle = np.einsum("mk,mka->ma", weight / (1.0 + weight.sum(axis=1, keepdims=True)), offset)
    centred = offset - middle[:, None]
    gram = np.einsum("mk,mka,mkb->mab", weight, centred, centred) + np.einsum("ma,mb->mab", middle, middle)
    slope = weight[:, :, None] * np.einsum("mka,mab->mkb", centred, np.linalg.pinv(gram))
    radial = rest_mm - axis_mm
    across = np.column_stack([-radial[:, 1], radial[:, 0]])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(length > 0.0, across / np.where(length > 0.0, length, 1.0), [1.0, 0.0])
    return MarkerSpacing(neighbour=neighbours.index, slope=read_only(slope), across=read_only(across))
