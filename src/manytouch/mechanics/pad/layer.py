"""The response of an unbounded elastic layer that is bonded to a rigid base, exact for each wave number.

For tractions exp(i k x) on the face z = h of a layer with u = 0 at z = 0, displacements along the wave vector
are i U(z) and normal ones W(z) with

    W = (A + B z) e^(k z) + (C + D z) e^(-k z)
    U = (A + (3 - 4 nu) B / k + B z) e^(k z) + (-C + (3 - 4 nu) D / k - D z) e^(-k z)

which satisfy Navier's equations; those across it are sinh(k z) / (mu k cosh(k h)). On the face this is the
closed form of R. Merkel et al. 2007 (doi:10.1529/biophysj.107.107904).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.special import j0, j1, jn, jvp, roots_legendre

from manytouch.mechanics.pad.axes import lame_constants
from manytouch.values.arrays import Scalars

_WAVES = 700  # of the quadrature of `radial_table`
_LARGEST = 7.0  # wave number times root, beyond which a Gaussian has no part
_LARGEST_OF_DIFFERENCE = 20.0  # wave number times thickness, beyond which a layer is a half-space


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LayerResponse:
    """Displacements at a depth for tractions on the face with wave numbers (k,), times Young's modulus, mm.

    Attributes:
        across: of shear across the wave vector.
        along, normal: of shear along it, and of normal traction, each in its own direction.
        squeezed: displacement along the wave vector over i, by a normal traction.
        lifted: normal displacement over -i, by shear along the wave vector.
    """

    across: Scalars
    along: Scalars
    normal: Scalars
    squeezed: Scalars
    lifted: Scalars


def layer_response(
    wave_per_mm: Scalars, thickness_mm: float, poisson: float, depth_mm: float = 0.0
) -> LayerResponse:
    """The response at a depth below the face.

    Args:
        wave_per_mm: (k,) wave numbers, positive.
        thickness_mm: of the layer.
        poisson: its Poisson's ratio, below 1/2.
        depth_mm: below the face.

    Raises:
        ZeroDivisionError: a Poisson's ratio of 1/2.
    """
    k, high, kappa = wave_per_mm, thickness_mm, 3.0 - 4.0 * poisson
    lam, mu = lame_constants(poisson)

    def rows(z: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """U, W, U', W' of the four solutions, the first two over e^(k h)."""
        up, down, one = np.exp(k * (z - high)), np.exp(-k * z), np.ones_like(k)
        w = np.stack([up, z * up, down, z * down], axis=-1)
        u = np.stack([up, (kappa / k + z) * up, -down, (kappa / k - z) * down], axis=-1)
        dw = np.stack([k * up, (one + k * z) * up, -k * down, (one - k * z) * down], axis=-1)
        du = np.stack([k * up, (kappa + one + k * z) * up, k * down, (-kappa - one + k * z) * down], axis=-1)
        return u, w, du, dw

    u, w, _, _ = rows(0.0)
    u_face, w_face, du_face, dw_face = rows(high)
    normal = lam * (dw_face - k[:, None] * u_face) + 2.0 * mu * dw_face
    tangential = mu * (du_face + k[:, None] * w_face)
    matrix = np.stack([u, w, tangential, normal], axis=1)
    right = np.zeros((len(k), 4, 2))
    right[:, 2, 0] = right[:, 3, 1] = 1.0
    solution = np.linalg.solve(matrix, right)
    u, w, _, _ = rows(high - depth_mm)
    found_u, found_w = (np.einsum("ks,kst->kt", each, solution) for each in (u, w))
    z = high - depth_mm
    across = (np.exp(k * (z - high)) - np.exp(-k * (z + high))) / (1.0 + np.exp(-2.0 * k * high))
    return LayerResponse(
        across=across / (mu * k),
        along=found_u[:, 0],
        normal=found_w[:, 1],
        squeezed=found_u[:, 1],
        lifted=found_w[:, 0],
    )


def radial_table(
    distance_mm: Float64[np.ndarray, " n"],
    root_mm: Float64[np.ndarray, " g"],
    thickness_mm: float,
    poisson: float,
    depth_mm: float = 0.0,
    *,
    dot_radius_mm: float = 0.0,
) -> Float64[np.ndarray, "g n 5"]:
    """Displacements of dots around Gaussian tractions with unit force, times Young's modulus, 1/mm.

    A camera sees the centroid of a dot, which moves by the mean displacement over its disc and, to first
    order, by the mean of the place from its middle times the divergence: where the pad expands, there is more
    of the dot. In a wave with the number k a dot of radius r moves by 2 J1(kr) / (kr) of the displacement at
    its middle, along k by 2 J1'(kr).

    The last axis: radial and normal displacement by a normal traction along z; even part and part with
    cos 2 phi of the displacement along a shear traction; normal displacement over cos phi by it.

    Args:
        distance_mm: (n,) from the centre.
        root_mm: (g,) roots of the second moments along each axis.
        thickness_mm, poisson: of the layer.
        depth_mm: below the face.
        dot_radius_mm: radius of the dots; 0: points.
    """
    most = _LARGEST / float(root_mm.min())
    place, weight = roots_legendre(_WAVES)
    k = most * (0.5 * (place + 1.0)) ** 2  # denser where k is small
    dk = 0.5 * most * (place + 1.0) * weight
    response = layer_response(k, thickness_mm, poisson, depth_mm)
    part = np.exp(-0.5 * (k * root_mm[:, None]) ** 2) * (k * dk / (2.0 * np.pi))
    along_k, other = 2.0 * jvp(1, k * dot_radius_mm), jvp(1, k * dot_radius_mm) + jn(2, k * dot_radius_mm)
    phase = np.outer(distance_mm, k)
    zero, one = j0(phase), j1(phase)
    two = np.divide(2.0 * one, phase, out=zero.copy(), where=phase > 0.0) - zero
    along, across = along_k * response.along, 2.0 * other * response.across
    mean, half = 0.5 * (along + across), 0.5 * (along - across)
    return np.stack(
        [
            -(along_k * response.squeezed * part) @ one.T,
            (2.0 * other * response.normal * part) @ zero.T,
            (mean * part) @ zero.T,
            -(half * part) @ two.T,
            (2.0 * other * response.lifted * part) @ one.T,
        ],
        axis=-1,
    )


def point_depth(
    distance_mm: Float64[np.ndarray, " n"], thickness_mm: float, poisson: float
) -> Float64[np.ndarray, " n"]:
    """Normal displacement of the face by a unit normal force on a point of it, times distance and E.

    On a half-space it is (1 - nu^2) / pi at every distance (J. Boussinesq 1885); the difference decays with
    the wave number as exp(-2 k h).

    Args:
        distance_mm: (n,) from the force, at most some tens of thicknesses.
        thickness_mm, poisson: of the layer.
    """
    most = _LARGEST_OF_DIFFERENCE / thickness_mm
    place, weight = roots_legendre(_WAVES)
    k, dk = 0.5 * most * (place + 1.0), 0.5 * most * weight
    half_space = 2.0 * (1.0 - poisson**2)
    difference = (layer_response(k, thickness_mm, poisson).normal * k - half_space) * dk / (2.0 * np.pi)
    found = half_space / (2.0 * np.pi) + distance_mm * (j0(np.outer(distance_mm, k)) @ difference)
    return np.asarray(found)
