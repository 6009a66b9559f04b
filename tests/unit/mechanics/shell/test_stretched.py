"""Moduli of stretched sheets against the nominal stress of the material."""

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq

from manytouch.mechanics.shell.stretched import LEAST_TENSION, MOST_TENSION, stretched_moduli
from manytouch.simulation.fem.elements.material import NeoHooke
from slab import nominal_stress

H = 1e-4


def mounted_stress(rubber: NeoHooke, stretch: float, strain: tuple[float, float]) -> float:
    """Second Piola-Kirchhoff stress 11 in the mounted state after two more strains, without one across."""
    first, second = (stretch * np.sqrt(1.0 + 2.0 * each) for each in strain)

    def across(x: float, y: float, z: float) -> float:
        return float(nominal_stress(np.diag([x, y, z]), rubber)[2, 2])

    at_rest = brentq(lambda z: across(stretch, stretch, z), 0.3, 1.3, xtol=1e-14)
    now = brentq(lambda z: across(first, second, z), 0.3, 1.3, xtol=1e-14)
    nominal = nominal_stress(np.diag([first, second, now]), rubber)[0, 0]
    return float(nominal * stretch / (stretch**2 * at_rest) / (first / stretch))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45, 0.49])
@pytest.mark.parametrize("stretch", [0.99, 1.0, 1.03, 1.15])
def test_moduli_are_the_derivatives_of_the_stress(poisson: float, stretch: float) -> None:
    rubber = NeoHooke(young_MPa=1.0, poisson=poisson)
    tension = mounted_stress(rubber, stretch, (0.0, 0.0))
    own, other = (
        (mounted_stress(rubber, stretch, way) - mounted_stress(rubber, stretch, (-way[0], -way[1])))
        / (2.0 * H)
        for way in ((H, 0.0), (0.0, H))
    )
    found = stretched_moduli(poisson, tension)
    assert found.poisson == pytest.approx(other / own, abs=1e-5)
    assert found.young == pytest.approx(own - other**2 / own, rel=1e-5)


def test_an_unstretched_sheet_has_the_moduli_of_its_material() -> None:
    found = stretched_moduli(0.4, 0.0)
    assert found.young == pytest.approx(1.0, rel=1e-12)
    assert found.poisson == pytest.approx(0.4, rel=1e-12)


@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.4, 0.499])
def test_no_pretension_gives_moduli_that_no_material_has(poisson: float) -> None:
    tensions = [-10.0, *np.linspace(LEAST_TENSION, MOST_TENSION, 51), 1.0, 100.0, 1e6]
    found = [stretched_moduli(poisson, tension) for tension in tensions]
    assert all(each.young > 0.1 and -0.5 < each.poisson < 0.5 for each in found)
    assert all(a.young >= b.young for a, b in itertools.pairwise(found[1:]))
