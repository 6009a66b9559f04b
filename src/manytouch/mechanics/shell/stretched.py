"""Moduli of a neo-Hookean sheet that was stretched in its plane before it was clamped.

Derivation: docs/derivations/mechanics.md, "Tension". Symbols and the law are those of `material`.
"""

from dataclasses import dataclass

LEAST_TENSION, MOST_TENSION = -0.1, 0.4
"""Bounds of the membrane force per length over E t. The upper one stretches a sheet by 30 to 60 %; beyond it
the stresses by small further strains are not those of a neo-Hookean sheet with any Poisson's ratio."""
_BISECTIONS = 50
_STEPS = 60
_TOLERANCE = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True)
class StretchedModuli:
    """Moduli of the mounted sheet for small strains in its plane.

    Attributes:
        young: Young's modulus over that of the material.
        poisson: Poisson's ratio.
    """

    young: float
    poisson: float


def stretched_moduli(poisson: float, tension_over_Et: float) -> StretchedModuli:
    """Moduli of a sheet of mounted thickness t under a membrane force per length, equal in all directions.

    Args:
        poisson: of the material, 0 to less than 0.5.
        tension_over_Et: membrane force per length over E t. Beyond `LEAST_TENSION` and `MOST_TENSION` the
            moduli are those at these bounds.
    """
    mu, bulk = 0.5 / (1.0 + poisson), 1.0 / (3.0 * (1.0 - 2.0 * poisson))
    stretch = _stretch(min(max(tension_over_Et, LEAST_TENSION), MOST_TENSION), mu, bulk)
    y, slope = _root_of_volume_ratio(stretch, mu, bulk)
    m, z = mu / y**2, y**6 / stretch**4
    along, coupled = 2.0 * m * z / stretch**4, m * z / stretch**4
    thinned = 2.0 * m / y * mu / (3.0 * slope) * (1.0 + 2.0 * z / stretch**2) ** 2
    to_mounted = 2.0 * stretch**4 / y**3
    first, second = to_mounted * (along - thinned), to_mounted * (coupled - thinned)
    ratio = second / first
    return StretchedModuli(young=first * (1.0 - ratio**2), poisson=ratio)


def _stretch(tension_over_Et: float, mu: float, bulk: float) -> float:
    """The stretch in the plane with this stress, by bisection; the stress increases with the stretch."""
    low, high = 0.8, 2.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if _stress(middle, mu, bulk) < tension_over_Et:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _stress(stretch: float, mu: float, bulk: float) -> float:
    """Stress in the plane over E, of the stretched state."""
    y, _ = _root_of_volume_ratio(stretch, mu, bulk)
    return stretch**2 / y**3 * mu / y**2 * (1.0 - y**6 / stretch**6)


def _root_of_volume_ratio(stretch: float, mu: float, bulk: float) -> tuple[float, float]:
    """y and dG/dy where the stress across the thickness is 0; `material.root_of_volume_ratio`."""
    y, d, slope = 1.0, stretch**4, 1.0
    for _ in range(_STEPS):
        slope = 4.0 * mu / d * y**5 + bulk * (8.0 * y**7 - 5.0 * y**4)
        off = 2.0 * mu / (3.0 * d) * y**6 - 2.0 * mu * stretch**2 / 3.0 + bulk * (y**8 - y**5)
        y -= off / slope
        if abs(off) <= _TOLERANCE:
            break
    return y, slope
