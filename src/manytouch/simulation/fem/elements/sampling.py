"""Displacement and its gradient at any point of the camera-side face, through the shape functions."""

import numpy as np
from jaxtyping import Float64

from manytouch.simulation.fem.elements.mesh import HexMesh, Nodal, shape_functions


def sample_camera_side(
    mesh: HexMesh, displacement_mm: Nodal, place_mm: Float64[np.ndarray, "m 2"]
) -> tuple[Float64[np.ndarray, "m 3"], Float64[np.ndarray, "m 3 3"]]:
    """Displacement (m, 3) and deformation gradient F = dx/dX (m, 3, 3) at undeformed places x, y, z = 0.

    A dot's disc of radius r around X is, to first order, the image of the unit disc under r F[:, :2].
    The displacement is continuous; F jumps a little from element to element. NaN outside the sheet.
    """
    lines = mesh.lines_mm[:2]
    cell = [
        np.clip(np.searchsorted(line, place_mm[:, axis], side="right") - 1, 0, len(line) - 2)
        for axis, line in enumerate(lines)
    ]
    low = np.column_stack([line[index] for line, index in zip(lines, cell, strict=True)])
    width = np.column_stack([line[index + 1] for line, index in zip(lines, cell, strict=True)]) - low
    local = np.column_stack([(place_mm - low) / width, np.zeros(len(place_mm))])
    height_mm = mesh.lines_mm[2][1] - mesh.lines_mm[2][0]
    value, slope = shape_functions(local)
    slope = slope / np.column_stack([width, np.full(len(place_mm), height_mm)])[:, None, :]
    owner = mesh.camera_side[cell[0] * (len(lines[1]) - 1) + cell[1]]
    nodal = displacement_mm[mesh.element[owner]]  # (m, 20, 3)
    displacement = np.einsum("mn,mni->mi", value, nodal)
    gradient = np.eye(3) + np.einsum("mni,mnj->mij", nodal, slope)
    inside = np.all((local[:, :2] >= -1e-9) & (local[:, :2] <= 1.0 + 1e-9), axis=1)
    displacement[~inside] = np.nan
    gradient[~inside] = np.nan
    return displacement, gradient
