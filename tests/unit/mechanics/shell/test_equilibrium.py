"""The sheet under loads."""

import numpy as np
import pytest

from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.shell.equilibrium import compliances_at_rest, equilibrium
from manytouch.mechanics.shell.shell import Shell


@pytest.mark.parametrize("elements", [(9, 6), (8, 7)])
def test_compliances_are_deflections_under_small_forces(elements: tuple[int, int]) -> None:
    patch = SplinePatch(size_mm=(36.0, 24.0), elements=elements)
    shell = Shell(patch=patch, thickness_mm=2.0, pretension_over_E_mm=0.05)
    tangent = shell.empty_tangent()
    shell.tangent_at(np.zeros((patch.node_count, 3)), tangent)
    found_per_mm = compliances_at_rest(shell, tangent)
    slow, fast = shell.patch.shape
    outline = np.ones((slow, fast), dtype=bool)
    outline[1:-1, 1:-1] = False
    assert (found_per_mm > 0.0).all()
    assert found_per_mm[outline.ravel()].max() < 0.1 * found_per_mm.max()
    force_mm2 = 1e-6
    for node in (fast + 2, 3 * fast + 3, (slow - 3) * fast + 2, (slow - 2) * fast + fast - 3):
        place_mm = shell.patch.place_mm[node : node + 1]
        load = shell.patch.load(place_mm, np.array([[0.0, 0.0, force_mm2]]))
        solved = equilibrium(shell, load)
        assert solved.status == "ok"
        deflection_mm = shell.patch.at(place_mm).displacement(solved.coefficient_mm)[0, 2]
        assert deflection_mm / force_mm2 == pytest.approx(found_per_mm[node], rel=1e-4)
