"""The conditions of a clamped outline against plane-strain finite elements."""

import importlib.util
from pathlib import Path

import pytest
import skfem

from manytouch.mechanics.shell.clamped_end import clamped_end

PATH = Path(__file__).parents[2] / "benchmarks" / "clamped_end.py"


@pytest.mark.parametrize("poisson", [0.3, 0.45])
def test_the_constants_are_those_of_a_slab(poisson: float) -> None:
    spec = importlib.util.spec_from_file_location("bench_clamped_end", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    e0, by_couple, by_force, e2, _ = module.end_constants(poisson, module.graded(10), skfem.ElementQuad2())
    assert by_couple == pytest.approx(by_force, abs=1e-5)
    expected = (e0, by_force, e2)
    assert clamped_end(1.0, poisson) == pytest.approx(expected, abs=0.0015)
    assert clamped_end(2.0, poisson)[2] == pytest.approx(8.0 * clamped_end(1.0, poisson)[2])
