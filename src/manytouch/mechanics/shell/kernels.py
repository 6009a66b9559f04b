"""Energy of the shell and what its forces and tangent share, compiled.

Derivation and symbols: docs/derivations/mechanics.md. Local nodes are numbered 4 a + b with a along the slow
and b along the fast axis. Nodes outside the grid were dropped; their coefficients are 0.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import inlined_kernel, kernel, no_type_check
from manytouch.mechanics.shell.material import MIN_AREA_RATIO_2, energy_density
from manytouch.mechanics.shell.tangent_kernels import Coefficients

POINTS = 9  # of 3 x 3 Gauss
LOCAL = 16

Local = Float64[np.ndarray, "3 16"]
Table = Float64[np.ndarray, "9 16"]


class Elements(NamedTuple):
    """The elements of a patch.

    Attributes:
        slow, fast: (elements along the axis, 3 points, 4, 4) value and three derivatives of the 4 basis
            functions of the displacements along x and y.
        bending_slow, bending_fast: the same of the bending deflection.
        weight: (9,) of the Gauss points, mm^2.
        shape: number of nodes along the slow and the fast axis.
        dropped: number of coefficients along each side that are 0 and not nodes.
        is_x_slow: whether x is the slow axis.
    """

    slow: Float64[np.ndarray, "slow 3 4 4"]
    fast: Float64[np.ndarray, "fast 3 4 4"]
    bending_slow: Float64[np.ndarray, "slow 3 4 4"]
    bending_fast: Float64[np.ndarray, "fast 3 4 4"]
    weight: Float64[np.ndarray, "9"]
    shape: tuple[int, int]
    dropped: int
    is_x_slow: bool


class Stiffness(NamedTuple):
    """Properties of a sheet: moduli, tension and shear stiffness over E; the others are lengths and an area.

    Attributes:
        thickness: mm.
        mu, bulk: shear and bulk modulus over E.
        tension: membrane force at rest over E, mm.
        lever: distance from the middle surface of the two points across the thickness at which the energy is
            evaluated, mm; t / sqrt(12) for a homogeneous sheet.
        stretch: Q, curvatures k of the strain stretch the sheet by Q k^2 / 2, mm^2.
        shear: a in the deflection w = b - a lap b, mm^2.
        shear_stiffness: of grad lap b over E, mm^5.
    """

    thickness: float
    mu: float
    bulk: float
    tension: float
    lever: float
    stretch: float
    shear: float
    shear_stiffness: float


class Tables(NamedTuple):
    """Derivatives (9, 16) of the basis functions of an element at its Gauss points.

    Attributes:
        x, y: first derivatives of the functions of the displacements along x and y.
        wx, wy: of the deflection w, by the bending deflection b.
        xx, yy, xy: second derivatives of b.
        lx, ly: first derivatives of its Laplacian.
        uxx, uyy, uxy: second derivatives of the functions of the displacements along x and y.
    """

    x: Table
    y: Table
    wx: Table
    wy: Table
    xx: Table
    yy: Table
    xy: Table
    lx: Table
    ly: Table
    uxx: Table
    uyy: Table
    uxy: Table


@kernel(fastmath=True)
@no_type_check
def new_tables() -> Tables:
    return Tables(
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
        np.empty((POINTS, LOCAL)),
    )


@inlined_kernel(fastmath=True)
@no_type_check
def gather(coefficient: Coefficients, elements: Elements, es: int, ef: int, local: Local) -> None:
    """Coefficients of the 16 nodes of element (es, ef), into `local`."""
    shape = elements.shape
    for a in range(4):
        s = es + a - elements.dropped
        for b in range(4):
            f = ef + b - elements.dropped
            inside = 0 <= s < shape[0] and 0 <= f < shape[1]
            for i in range(3):
                local[i, 4 * a + b] = coefficient[s * shape[1] + f, i] if inside else 0.0


@inlined_kernel(fastmath=True)
@no_type_check
def tabulate(elements: Elements, es: int, ef: int, shear: float, tables: Tables) -> None:
    """Derivatives of the 16 functions at the 9 points of element (es, ef), into `tables`."""
    slow, fast, is_x_slow = elements.slow[es], elements.fast[ef], elements.is_x_slow
    bend_slow, bend_fast = elements.bending_slow[es], elements.bending_fast[ef]
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly, uxx, uyy, uxy = tables
    for p in range(3):
        for q in range(3):
            at = 3 * p + q
            for a in range(4):
                s0, s1, s2 = slow[p, 0, a], slow[p, 1, a], slow[p, 2, a]
                b0, b1, b2, b3 = (
                    bend_slow[p, 0, a],
                    bend_slow[p, 1, a],
                    bend_slow[p, 2, a],
                    bend_slow[p, 3, a],
                )
                for b in range(4):
                    f0, f1, f2 = fast[q, 0, b], fast[q, 1, b], fast[q, 2, b]
                    c0, c1 = bend_fast[q, 0, b], bend_fast[q, 1, b]
                    c2, c3 = bend_fast[q, 2, b], bend_fast[q, 3, b]
                    k = 4 * a + b
                    by_slow, by_fast = b3 * c0 + b1 * c2, b2 * c1 + b0 * c3
                    if is_x_slow:
                        nx[at, k], ny[at, k] = s1 * f0, s0 * f1
                        nxx[at, k], nyy[at, k] = b2 * c0, b0 * c2
                        uxx[at, k], uyy[at, k] = s2 * f0, s0 * f2
                        lx[at, k], ly[at, k] = by_slow, by_fast
                        wx[at, k], wy[at, k] = b1 * c0 - shear * by_slow, b0 * c1 - shear * by_fast
                    else:
                        nx[at, k], ny[at, k] = s0 * f1, s1 * f0
                        nxx[at, k], nyy[at, k] = b0 * c2, b2 * c0
                        uxx[at, k], uyy[at, k] = s0 * f2, s2 * f0
                        lx[at, k], ly[at, k] = by_fast, by_slow
                        wx[at, k], wy[at, k] = b0 * c1 - shear * by_fast, b1 * c0 - shear * by_slow
                    nxy[at, k], uxy[at, k] = b1 * c1, s1 * f1


@kernel(fastmath=True, inline="always")
@no_type_check
def strain(
    local: Local, tables: Tables, at: int
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """Components of a1 and a2, curvatures xx, yy, twice xy, and grad lap b, at Gauss point `at`."""
    nx, ny, wx, wy, nxx, nyy, nxy, lx, ly, _, _, _ = tables
    a10, a11, a12, a20, a21, a22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
    k1, k2, k3, g1, g2 = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(LOCAL):
        u, v, w = local[0, k], local[1, k], local[2, k]
        a10 += nx[at, k] * u
        a11 += nx[at, k] * v
        a12 += wx[at, k] * w
        a20 += ny[at, k] * u
        a21 += ny[at, k] * v
        a22 += wy[at, k] * w
        k1 += nxx[at, k] * w
        k2 += nyy[at, k] * w
        k3 += 2.0 * nxy[at, k] * w
        g1 += lx[at, k] * w
        g2 += ly[at, k] * w
    return a10, a11, a12, a20, a21, a22, k1, k2, k3, g1, g2


@kernel(fastmath=True, inline="always")
@no_type_check
def plane_second_derivatives(
    local: Local, tables: Tables, at: int
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Second derivatives xx, yy and twice xy of u and of v at Gauss point `at`."""
    uxx, uyy, uxy = tables.uxx, tables.uyy, tables.uxy
    u1 = u2 = u3 = v1 = v2 = v3 = 0.0
    for k in range(LOCAL):
        u, v = local[0, k], local[1, k]
        xx, yy, xy = uxx[at, k], uyy[at, k], 2.0 * uxy[at, k]
        u1 += xx * u
        u2 += yy * u
        u3 += xy * u
        v1 += xx * v
        v2 += yy * v
        v3 += xy * v
    return (u1, u2, u3), (v1, v2, v3)


@kernel(fastmath=True, inline="always")
@no_type_check
def fibre_normal(
    a1: tuple[float, float, float], a2: tuple[float, float, float]
) -> tuple[float, float, float]:
    """a1 x a2, of base vectors whose third components are the slopes of b; fibres have its direction."""
    return a1[1] * a2[2] - a1[2] * a2[1], a1[2] * a2[0] - a1[0] * a2[2], a1[0] * a2[1] - a1[1] * a2[0]


@kernel(fastmath=True, inline="always")
@no_type_check
def curvatures(
    normal: tuple[float, float, float],
    deflection: tuple[float, float, float],
    in_plane: tuple[tuple[float, float, float], tuple[float, float, float]],
) -> tuple[float, float, float, float]:
    """Curvatures 11, 22 and twice 12 of the strain, and 1 over the squared length of the normal.

    Args:
        normal: `fibre_normal`.
        deflection: second derivatives xx, yy and twice xy of b.
        in_plane: of u and v.
    """
    nx, ny, nz = normal
    c = 1.0 / max(nx * nx + ny * ny + nz * nz, MIN_AREA_RATIO_2)
    w1, w2, w3 = deflection
    (u1, u2, u3), (v1, v2, v3) = in_plane
    return (
        c * (nz * w1 + nx * u1 + ny * v1),
        c * (nz * w2 + nx * u2 + ny * v2),
        c * (nz * w3 + nx * u3 + ny * v3),
        c,
    )


@kernel(fastmath=True, inline="always")
@no_type_check
def shear_ratio(e1: float, e2: float, e3: float) -> float:
    """Energy of shear over that of a sheet at rest: 1 over det C, by the strains of the middle surface."""
    return 1.0 / max((1.0 + 2.0 * e1) * (1.0 + 2.0 * e2) - e3 * e3, MIN_AREA_RATIO_2)


@kernel(fastmath=True, inline="always")
@no_type_check
def stretch_by_curvature(k1: float, k2: float, k3: float, stretch: float) -> tuple[float, float, float]:
    """Q k^2 / 2 as strains E11, E22 and 2 E12, of curvatures 11, 22 and twice 12 of the strain."""
    twist = 0.25 * k3 * k3
    half = 0.5 * stretch
    return half * (k1 * k1 + twist), half * (k2 * k2 + twist), half * k3 * (k1 + k2)


@kernel(fastmath=True)
@no_type_check
def energy(coefficient: Coefficients, elements: Elements, stiffness: Stiffness) -> float:
    """Energy over E, mm^3."""
    t, mu, bulk, tension, lever, stretch, shear, shear_stiffness = stiffness
    weight, tables, local = elements.weight, new_tables(), np.empty((3, LOCAL))
    total = 0.0
    for es in range(elements.slow.shape[0]):
        for ef in range(elements.fast.shape[0]):
            gather(coefficient, elements, es, ef, local)
            tabulate(elements, es, ef, shear, tables)
            for at in range(POINTS):
                a10, a11, a12, a20, a21, a22, w1, w2, w3, l1, l2 = strain(local, tables, at)
                e1 = 0.5 * (a10 * a10 + a11 * a11 + a12 * a12 - 1.0)
                e2 = 0.5 * (a20 * a20 + a21 * a21 + a22 * a22 - 1.0)
                e3 = a10 * a20 + a11 * a21 + a12 * a22
                g = shear_ratio(e1, e2, e3)
                normal = fibre_normal((a10, a11, a12 + shear * l1), (a20, a21, a22 + shear * l2))
                in_plane = plane_second_derivatives(local, tables, at)
                k1, k2, k3, _ = curvatures(normal, (w1, w2, w3), in_plane)
                h1, h2, h3 = stretch_by_curvature(k1, k2, k3, stretch)
                e1, e2, e3, z = e1 + h1, e2 + h2, e3 + h3, lever
                both = energy_density(e1 + z * k1, e2 + z * k2, e3 + z * k3, mu, bulk)
                both += energy_density(e1 - z * k1, e2 - z * k2, e3 - z * k3, mu, bulk)
                sheared = 0.5 * shear_stiffness * g * (l1 * l1 + l2 * l2)
                total += weight[at] * (0.5 * t * both + tension * (e1 + e2) + sheared)
    return total
