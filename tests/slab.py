"""An elastic slab in plane strain under a sinusoidal load on one face, exact, by the transfer matrix.

u = U(z) sin kx, w = W(z) cos kx, with the tractions S sin kx (xz) and T cos kx (zz) on planes z = const:
the state (U, W, S, T) of the linear theory, with a membrane force N as initial stress N / t along x, obeys a
linear differential equation across the thickness.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm


@dataclass(frozen=True, kw_only=True)
class Face:
    """Amplitudes on the face that is not loaded, for a pressure of 1 on the other one, over E.

    Attributes:
        stiffness_per_mm: pressure over E and deflection.
        in_plane: displacement along x over that along z.
    """

    stiffness_per_mm: float
    in_plane: float


def free_face(
    wave_per_mm: float, thickness_mm: float, poisson: float, tension_over_E_mm: float = 0.0
) -> Face:
    """The free face at z = 0 of a slab that is loaded at z = t."""
    k, t, nu = wave_per_mm, thickness_mm, poisson
    mu, lame = 0.5 / (1.0 + nu), nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    initial = tension_over_E_mm / t
    across = lame + 2.0 * mu
    change = np.zeros((4, 4))
    change[0] = [0.0, k, 1.0 / mu, 0.0]
    change[1] = [-lame * k / across, 0.0, 0.0, 1.0 / across]
    change[2] = [k * k * (across - lame**2 / across), 0.0, 0.0, k * lame / across]
    change[3] = [0.0, initial * k * k, -k, 0.0]
    passed = expm(change * t)
    u, w = np.linalg.solve(passed[2:, :2], [0.0, 1.0])
    return Face(stiffness_per_mm=1.0 / float(w), in_plane=float(u / w))
