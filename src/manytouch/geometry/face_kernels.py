"""Displacement of the camera-side face of a bent sheet, compiled.

The face lies half a deformed thickness from the middle surface, along the sheet's fibres. Derivation:
docs/derivations/mechanics.md, "Markers".
"""

# ruff: noqa: PLR0917 - compiled functions are called with positional arguments

import math

import numpy as np

from manytouch.compilation import kernel, no_type_check

THINNEST, THICKEST = 0.5, 1.3  # limits of deformed over undeformed thickness, as in mechanics.markers


@kernel()
@no_type_check
def displace_face(
    coefficient_mm: np.ndarray,
    node: np.ndarray,
    weight: np.ndarray,
    thickness_mm: float,
    poisson: float,
    pretension_mm: float,
    out: np.ndarray,
) -> None:
    """Displacement (k, 3) of k points of the camera-side face.

    Args:
        coefficient_mm: (nodes, 3) of a `SheetSpline`.
        node: (k, 16) nodes whose basis functions are not 0 at each point.
        weight: (k, 6, 16) of these: value, d/dx and d/dy of the displacements along x and y; deflection, and
            slopes along x and y of the surface that fibres are normal to.
        thickness_mm, poisson: of the sheet.
        pretension_mm: membrane force per length at rest over Young's modulus.
        out: (k, 3) the result, in the sheet frame.
    """
    field = np.empty((3, 3))
    for k in range(len(node)):
        field[:] = 0.0
        for n in range(16):
            source = node[k, n]
            for j in range(3):
                value, table = coefficient_mm[source, j], 3 if j == 2 else 0
                for part in range(3):
                    field[part, j] += weight[k, table + part, n] * value
        field[1, 0] += 1.0
        field[2, 1] += 1.0
        stretch = -1.0
        for j in range(3):
            stretch += 0.5 * (field[1, j] ** 2 + field[2, j] ** 2)
        ratio = min(max(1.0 - poisson / (1.0 - poisson) * stretch, THINNEST), THICKEST)
        normal_x = field[1, 1] * field[2, 2] - field[1, 2] * field[2, 1]
        normal_y = field[1, 2] * field[2, 0] - field[1, 0] * field[2, 2]
        normal_z = field[1, 0] * field[2, 1] - field[1, 1] * field[2, 0]
        length = math.sqrt(normal_x**2 + normal_y**2 + normal_z**2)
        half_mm = 0.5 * thickness_mm
        # that of the middle surface by the pressure on the other face: see `mechanics.markers.kernels.levers`
        squeezed_mm = 0.5 * (1.0 + poisson) * (half_mm * (1.0 - ratio) + poisson * pretension_mm)
        in_plane = (half_mm * ratio + squeezed_mm) / length
        out[k, 0] = field[0, 0] - in_plane * normal_x
        out[k, 1] = field[0, 1] - in_plane * normal_y
        out[k, 2] = field[0, 2] - half_mm * ratio / length * normal_z + half_mm
