"""The finite elements against an independent program, where it is installed."""

import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from check_calculix import calculix, compare, pad, sheet  # noqa: E402
from ship_calculix_pads import ball_against_own  # noqa: E402

pytest.importorskip("skfem")


@pytest.mark.slow
@pytest.mark.skipif(calculix() is None, reason="CalculiX is not installed: apt-get install calculix-ccx")
def test_calculix_comes_to_the_same_shape_as_its_mesh_gets_finer(tmp_path: Path) -> None:
    coarse, fine = (compare(sheet(size), "C3D20R", folder=tmp_path) for size in (2.5, 1.25))
    assert coarse.depth_mm[0] == pytest.approx(fine.depth_mm[0], rel=3e-3)  # ours is there already
    assert abs(fine.percent) < 1.0
    assert fine.apart_mm < 0.05
    assert coarse.apart_mm > 2.5 * fine.apart_mm  # what is left is CalculiX's mesh


@pytest.mark.slow
@pytest.mark.skipif(calculix() is None, reason="CalculiX is not installed: apt-get install calculix-ccx")
def test_calculix_comes_to_the_same_shape_of_a_pad(tmp_path: Path) -> None:
    """Pressed by a ninth of its thickness and sheared."""
    coarse, fine = (compare(pad(size), "C3D20R", folder=tmp_path) for size in (1.4, 1.0))
    assert abs(fine.percent) < 1.0
    assert fine.apart_mm < 0.02
    assert coarse.apart_mm > 2.5 * fine.apart_mm


@pytest.mark.slow
@pytest.mark.skipif(calculix() is None, reason="CalculiX is not installed: apt-get install calculix-ccx")
def test_calculix_presses_a_ball_into_a_pad_with_the_same_force(tmp_path: Path) -> None:
    """Contact, penalty and elements of both are independent; the face is equally deep."""
    found = ball_against_own(tmp_path)
    assert [round(one.depth_mm, 1) for one in found] == [0.3, 0.5, 1.0]
    for one in found:
        assert abs(one.percent) < 2.0
        assert one.apart_mm < 0.02 * one.largest_mm
