"""Decks of pads for CalculiX: shapes, parts of the text, and what is read out of the results."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.evaluation.suite.pads.calculix import CalculixCase, calculix_pads
from manytouch.simulation.scene.deformation import Deformation
from manytouch.values.arrays import read_only

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not part of a wheel", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

from calculix_pads import (  # noqa: E402
    body,
    deck,
    mesh,
    states,
    tables,
    true_contact,
    ways_mm,
)
from calculix_shapes import SHAPES  # noqa: E402

CASES = {case.name: case for case in calculix_pads()}


@pytest.fixture(scope="module", params=["sphere-10-mm", "sphere-10-mm-dragged"])
def case(request: pytest.FixtureRequest) -> CalculixCase:
    return CASES[request.param]


def height_mm(shape: str, *place_mm: tuple[float, float]) -> np.ndarray:
    height, _, _ = SHAPES[shape]  # type: ignore[index]
    return np.asarray(height(np.array(place_mm)))


@pytest.mark.parametrize("shape", SHAPES)
def test_the_lowest_point_of_each_shape_has_height_zero_and_its_outline_is_high(shape: str) -> None:
    height, half_mm, _ = SHAPES[shape]  # type: ignore[index]
    line_mm = np.linspace(-half_mm, half_mm, 401)
    found_mm = height(np.stack(np.meshgrid(line_mm, line_mm), axis=-1).reshape(-1, 2)).reshape(401, 401)
    assert found_mm.min() == pytest.approx(0.0, abs=2e-3)
    assert min(found_mm[0].min(), found_mm[-1].min(), found_mm[:, [0, -1]].min()) > 0.6


def test_edges_are_rounded() -> None:
    """A ball of 1 mm rolls over the face: at 0.6 mm from the flat part it is 0.2 mm higher."""
    assert height_mm("sphere_10", (3.0, 0.0)) == pytest.approx([1.0])
    assert height_mm("cylinder_8", (3.0, 0.0), (0.0, 3.6)) == pytest.approx([0.0, 0.2])
    assert height_mm("cuboid_7", (2.4, -2.4), (3.1, 0.0), (0.0, -3.1)) == pytest.approx([0.0, 0.2, 0.2])
    assert height_mm("polygon_6_10", (0.0, 4.0), (0.0, 4.6)) == pytest.approx([0.0, 0.2])
    assert height_mm("triangle_8", (0.0, -1.309), (0.0, -1.909)) == pytest.approx([0.0, 0.2], abs=1e-3)
    assert height_mm("cylinder_10_7", (4.25, 0.0), (4.72, 0.0)) == pytest.approx([0.0, 0.14])


def test_faces_rise_by_their_angles() -> None:
    found_mm = height_mm("pyramid_10", (2.0, 0.0), (3.0, 0.0), (0.0, 0.3), (1.0, 1.0), (2.0, 2.0))
    assert found_mm[1] - found_mm[0] == pytest.approx(np.tan(np.pi / 6))
    assert found_mm[2] == pytest.approx(1.0 - np.sqrt(1.0 - 0.09))  # on the tip
    assert found_mm[4] - found_mm[3] == pytest.approx(np.tan(np.pi / 6))  # on the ridge
    low_mm, high_mm = height_mm("sloping_cuboid_10", (0.0, 1.0), (0.0, 0.0))
    assert high_mm - low_mm == pytest.approx(np.tan(np.deg2rad(10.0)))


def test_the_body_touches_the_pad_at_its_place_and_has_no_element_inside_out(case: CalculixCase) -> None:
    rest = body(case)
    lowest = rest.node_mm[rest.node_mm[:, 2].argmin()]
    np.testing.assert_allclose(lowest, [*case.press.at_mm, case.thickness_mm], atol=1e-9)
    corner = rest.node_mm[rest.element]
    first, second, third = (corner[:, n] - corner[:, 0] for n in (1, 3, 4))
    assert (np.einsum("ei,ei->e", np.cross(first, second), third) > 0.0).all()
    np.testing.assert_allclose((corner[:, 2] - corner[:, 0])[:, :2], (first + second)[:, :2], atol=1e-9)


def test_a_place_is_inside_above_the_turned_lower_face() -> None:
    turned = CASES["cuboid-7-mm"]
    there = body(turned).moved((0.0, 0.0, -0.3))
    along = 3.2 * np.array([np.cos(np.deg2rad(75.0)), np.sin(np.deg2rad(75.0))])  # near a corner
    place_mm = np.array([*(np.array(turned.press.at_mm) + along), turned.thickness_mm])
    above, below = place_mm - [0.0, 0.0, 0.29], place_mm - [0.0, 0.0, 0.31]
    assert there.is_inside(np.array([above, below])).tolist() == [True, False]
    assert not there.is_inside(np.array([[9.0, 9.0, 10.0]])).any()


def test_the_deck_states_material_contact_and_the_way_of_the_body(case: CalculixCase) -> None:
    rest = body(case)
    pad = mesh(case, rest)
    text = deck(case, pad, rest)
    lines = text.splitlines()
    assert lines[lines.index("*HYPERELASTIC, NEO HOOKE") + 1] == "0.0725, 0."
    assert "*CONTACT PAIR, INTERACTION=PRESS, TYPE=SURFACE TO SURFACE" in lines
    assert lines.count("*END STEP") == 3
    assert sum(line.endswith(", S2") for line in lines) == len(pad.touched)
    assert sum(line.endswith(", S1") for line in lines) == len(rest.element)
    last = {line for line in text.split("*STEP")[-1].splitlines() if line.startswith("BODY, ")}
    if case.press.friction:
        assert lines[lines.index("*FRICTION") + 1] == "0.6, 10"
        assert last == {"BODY, 1, 1, 0.4", "BODY, 2, 2, 0.2", "BODY, 3, 3, -0.75"}
    else:
        assert "*FRICTION" not in lines
        assert last == {"BODY, 1, 1, 0", "BODY, 2, 2, 0", "BODY, 3, 3, -1"}
    assert max(len(line) for line in lines) < 132
    stiff = deck(case, pad, rest, stiffness=2.0).splitlines()
    at = lines.index("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR") + 1
    assert float(stiff[at]) == 2.0 * float(lines[at])


def test_the_pad_has_lines_at_its_markers_and_small_elements_below_the_body(case: CalculixCase) -> None:
    pad = mesh(case, body(case))
    assert case.thickness_mm - case.marker_depth_mm in pad.lines_mm[2]
    assert len(pad.lines_mm[2]) >= 5
    for axis, middle_mm in enumerate(case.press.at_mm):
        line_mm = pad.lines_mm[axis]
        at = np.searchsorted(line_mm, middle_mm)
        assert np.diff(line_mm)[at - 2 : at + 2].max() <= 0.7 + 1e-9
        np.testing.assert_allclose(line_mm[[0, -1]], [-0.5 * case.size_mm[axis], 0.5 * case.size_mm[axis]])


def test_tables_are_read_by_quantity_and_set() -> None:
    text = """
 displacements (vx,vy,vz) for set PAD and time  0.1000000E+01

         1  1.000000E+00  0.000000E+00 -2.000000E-01
         3  0.000000E+00  0.000000E+00  5.000000E-01

 forces (fx,fy,fz) for set BODY and time  0.1000000E+01

         7  0.000000E+00  0.000000E+00  3.000000E+00

 forces (fx,fy,fz) for set BODY and time  0.2000000E+01

         7  0.000000E+00  0.000000E+00  4.000000E+00
"""
    found = tables(text)
    ((nodes, moved_mm),) = found["displacements", "PAD"]
    assert nodes.tolist() == [1, 3]
    np.testing.assert_array_equal(moved_mm, [[1.0, 0.0, -0.2], [0.0, 0.0, 0.5]])
    assert [values[0, 2] for _, values in found["forces", "BODY"]] == [3.0, 4.0]


@pytest.fixture
def shifted() -> Deformation:
    """A face that moved by 0.5 mm along x and 0.3 mm down."""
    line_mm = read_only(np.linspace(-10.0, 10.0, 5))
    moved_mm = np.broadcast_to(np.float32([0.5, 0.0, -0.3]), (5, 5, 3))
    return Deformation(
        x_mm=line_mm, y_mm=line_mm, face_mm=read_only(moved_mm.copy()), contacts=(), status="ok"
    )


def test_a_contact_by_hand(shifted: Deformation) -> None:
    """Two nodes 2 mm apart along x press by 1 N and 3 N, the second one is also pulled along y."""
    there = body(CASES["sphere-10-mm"]).moved((0.0, 0.0, -0.5))
    small = replace(there, node_mm=np.array([[-1.0, 0.0, 3.6], [1.0, 0.0, 3.6], [0.0, 2.0, 4.0]]))
    force_N = np.array([[0.0, 0.0, -1.0], [0.0, 0.4, -3.0], [0.0, 0.0, 0.0]])
    found = true_contact(CASES["sphere-10-mm"], small, shifted, force_N)
    np.testing.assert_allclose(found.force_N, [0.0, 0.4, -4.0])
    np.testing.assert_allclose(found.centre_mm, [0.5 - 0.5, 0.0], atol=1e-6)  # undeformed
    assert found.torque_Nmm == pytest.approx(0.4 * 0.5)
    assert found.moment_mm2 == pytest.approx((0.75, 0.0, 0.0), abs=1e-6)
    assert found.depth_mm == pytest.approx(0.3)
    assert found.area_mm2 == pytest.approx(np.pi * (0.2 * 10.0), rel=0.03)  # the cap of 0.2 mm of the ball


def test_forces_out_of_balance_are_refused() -> None:
    case = CASES["sphere-10-mm"]
    rest = body(case)
    pad = mesh(case, rest)
    ids, count = np.arange(len(pad.node_mm)) + 1, len(pad.node_mm)
    still = (ids, np.zeros((count, 3)))
    body_N = (np.array([count + 1]), np.array([[0.0, 0.0, -1.0]]))
    for bonded_N, is_refused in ((1.004, False), (1.01, True)):
        found = {
            ("displacements", "PAD"): [still] * 3,
            ("forces", "BODY"): [body_N] * 3,
            ("forces", "BONDED"): [(np.array([1]), np.array([[0.0, 0.0, bonded_N]]))] * 3,
        }
        if is_refused:
            with pytest.raises(SystemExit, match="on the pad"):
                list(states(case, pad, rest, found))
        else:
            assert len(list(states(case, pad, rest, found))) == 3
    missing = {("forces", "BODY"): [body_N]}
    with pytest.raises(SystemExit, match="solved 1 of 3 steps"):
        list(states(case, pad, rest, missing))


def test_the_way_of_a_drag_is_that_of_the_last_level() -> None:
    found = ways_mm(CASES["sphere-10-mm-dragged"])
    assert found == [(0.0, 0.0, -0.3), (0.0, 0.0, -0.75), (0.4, 0.2, -0.75)]
