"""A neo-Hookean sheet in plane stress, compiled (docs/derivations/mechanics.md, "Membrane")."""

from manytouch.compilation import kernel, no_type_check

NEWTON_STEPS = 5
"""Relative error of y below 1e-6 for principal stretches in the plane from 2/3 to 3/2 and any Poisson's ratio
from 0 to 1/2; from 1/2 to 2, below 6e-3, and below 1e-3 from 0.45 on (`test_material.py`)."""
MIN_AREA_RATIO_2 = 1e-3
"""Lower limit of det C, the squared ratio of areas. A choice: no sheet is compressed to 3 % of its area, and
steps of the inversion that go further keep finite energies."""


@kernel(fastmath=True, inline="always")
@no_type_check
def root_of_volume_ratio(
    e1: float, e2: float, e3: float, mu: float, bulk: float
) -> tuple[float, float, float, float]:
    """Cube root y of the volume ratio at which the normal stress across the thickness is 0.

    G(y) = 2 mu y^6 / (3 d) - mu tr / 3 + bulk (y^8 - y^5) = 0, with d = det C and tr = tr C of C = 1 + 2 E.
    The thickness stretch is y^3 / sqrt(d). The moduli mu and bulk are those of the material over its Young's
    modulus, and so are energies and stresses.

    Returns:
        y, dG/dy, and d, tr.
    """
    c1, c2 = 1.0 + 2.0 * e1, 1.0 + 2.0 * e2
    d = max(c1 * c2 - e3 * e3, MIN_AREA_RATIO_2)
    tr = c1 + c2
    y = 1.0 + 0.1 * (d - 1.0) * mu / (bulk + mu)
    slope = 1.0
    for _ in range(NEWTON_STEPS):
        y2 = y * y
        y4 = y2 * y2
        y5 = y4 * y
        slope = 4.0 * mu / d * y5 + bulk * (8.0 * y5 * y2 - 5.0 * y4)
        y -= (2.0 / 3.0 * mu / d * y5 * y - mu * tr / 3.0 + bulk * (y4 * y4 - y5)) / slope
    y2 = y * y
    y5 = y2 * y2 * y
    slope = 4.0 * mu / d * y5 + bulk * (8.0 * y5 * y2 - 5.0 * y2 * y2)
    return y, slope, d, tr


@kernel(fastmath=True, inline="always")
@no_type_check
def energy_density(e1: float, e2: float, e3: float, mu: float, bulk: float) -> float:
    """Energy per volume for the strains E11, E22 and 2 E12."""
    y, _, d, tr = root_of_volume_ratio(e1, e2, e3, mu, bulk)
    y3 = y * y * y
    z = y3 * y3 / d
    return 0.5 * mu * ((tr + z) / (y * y) - 3.0) + 0.5 * bulk * (y3 - 1.0) ** 2


@kernel(fastmath=True, inline="always")
@no_type_check
def stress(e1: float, e2: float, e3: float, mu: float, bulk: float) -> tuple[float, float, float]:
    """S11, S22, S12 (second Piola-Kirchhoff)."""
    y, _, d, _ = root_of_volume_ratio(e1, e2, e3, mu, bulk)
    m = mu / (y * y)
    z = y**6 / d
    return (
        m * (1.0 - z * (1.0 + 2.0 * e2) / d),
        m * (1.0 - z * (1.0 + 2.0 * e1) / d),
        m * z * e3 / d,
    )


@kernel(fastmath=True, inline="always")
@no_type_check
def stress_and_tangent(
    e1: float, e2: float, e3: float, mu: float, bulk: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """S11, S22, S12 and D11, D22, D33, D12, D13, D23 = dS / d(E11, E22, 2 E12)."""
    y, slope, d, _ = root_of_volume_ratio(e1, e2, e3, mu, bulk)
    m = mu / (y * y)
    y3 = y * y * y
    z = y3 * y3 / d
    i1, i2, i3 = (1.0 + 2.0 * e2) / d, (1.0 + 2.0 * e1) / d, -e3 / d
    mz = m * z
    g = 2.0 * m / y * mu / (3.0 * slope)
    q1, q2, q3 = 1.0 + 2.0 * z * i1, 1.0 + 2.0 * z * i2, 2.0 * z * i3
    return (
        m - mz * i1,
        m - mz * i2,
        -mz * i3,
        2.0 * (2.0 * mz * i1 * i1 - g * q1 * q1),
        2.0 * (2.0 * mz * i2 * i2 - g * q2 * q2),
        mz * (3.0 * i3 * i3 + i1 * i2) - 2.0 * g * q3 * q3,
        2.0 * (mz * (i1 * i2 + i3 * i3) - g * q1 * q2),
        2.0 * (2.0 * mz * i1 * i3 - g * q1 * q3),
        2.0 * (2.0 * mz * i2 * i3 - g * q2 * q3),
    )
