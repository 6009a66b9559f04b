"""An elastic slab in plane strain under a sinusoidal load on one face, exact, by the transfer matrix.

u = U(z) sin kx, w = W(z) cos kx, with the nominal tractions S sin kx (along x) and T cos kx (along z) on
planes z = const: the state (U, W, S, T) of small motions on top of a stretched neo-Hookean slab obeys a
linear differential equation across the thickness (R. W. Ogden, Non-linear Elastic Deformations, 1984, ch. 6).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from manytouch.simulation.fem.elements.material import NeoHooke

STEP = 1e-5


@dataclass(frozen=True, kw_only=True)
class Face:
    """Amplitudes on the face that is not loaded, for a pressure of 1 on the other one, over E.

    Attributes:
        stiffness_per_mm: pressure over E and deflection.
        in_plane: displacement along x over that along z.
    """

    stiffness_per_mm: float
    in_plane: float


def nominal_stress(gradient: np.ndarray, rubber: NeoHooke) -> np.ndarray:
    """First Piola-Kirchhoff stress (3, 3) under a deformation gradient (3, 3)."""
    volume, inverse = np.linalg.det(gradient), np.linalg.inv(gradient).T
    isochoric = gradient - (gradient**2).sum() / 3.0 * inverse
    shear, bulk = rubber.shear_MPa, rubber.bulk_MPa
    return np.asarray(shear * volume ** (-2.0 / 3.0) * isochoric + bulk * (volume - 1.0) * volume * inverse)


def moduli(rubber: NeoHooke, stretch: np.ndarray) -> np.ndarray:
    """(3, 3, 3, 3) change of the nominal stress [i, j] by the gradient [k, l], in the stretched state."""
    base, found = np.diag(stretch), np.empty((3, 3, 3, 3))
    for k in range(3):
        for m in range(3):
            step = np.zeros((3, 3))
            step[k, m] = STEP
            slope = (nominal_stress(base + step, rubber) - nominal_stress(base - step, rubber)) / (2.0 * STEP)
            found[:, :, k, m] = slope * stretch * stretch[m] / np.prod(stretch)
    return found


def free_face(
    wave_per_mm: float, thickness_mm: float, poisson: float, tension_over_E_mm: float = 0.0
) -> Face:
    """The free face at z = 0 of a slab that is loaded at z = t; thickness and tension are those mounted."""
    k, t, x, z = wave_per_mm, thickness_mm, 0, 2
    rubber = NeoHooke(young_MPa=1.0, poisson=poisson)
    stretch = rubber.prestretch(tension_over_E_mm, t) if tension_over_E_mm else np.ones(3)
    a = moduli(rubber, np.asarray(stretch))
    along = np.array([0.0, k * a[x, z, z, x], 1.0, 0.0]) / a[x, z, x, z]  # dU/dz
    across = np.array([-k * a[z, z, x, x], 0.0, 0.0, 1.0]) / a[z, z, z, z]  # dW/dz
    change = np.stack(
        [
            along,
            across,
            k * (a[x, x, z, z] * across + [k * a[x, x, x, x], 0.0, 0.0, 0.0]),
            k * ([0.0, k * a[z, x, z, x], 0.0, 0.0] - a[z, x, x, z] * along),
        ]
    )
    passed = expm(change * t)
    u, w = np.linalg.solve(passed[2:, :2], [0.0, 1.0])
    return Face(stiffness_per_mm=1.0 / float(w), in_plane=float(u / w))
