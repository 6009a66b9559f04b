"""Pads that CalculiX solved: what ships, and the cases of the group."""

from importlib.resources import files

import numpy as np
import pytest

from manytouch.evaluation.report.pad_goals import GOALS
from manytouch.evaluation.suite.cases import PAD_GROUPS
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.pads.calculix import HELD_OUT, CalculixCase, calculix_pads
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.evaluation.suite.pads.recording import pad_states
from manytouch.evaluation.suite.suite import cases

CASES = tuple(calculix_pads())


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_press_ships_and_is_what_is_pressed(case: CalculixCase) -> None:
    states = pad_states(case)
    assert len(states) == len(case.press.levels)
    force_N = [-markers.contacts[0].force_N[2] for markers, _ in states]
    assert 0.01 < force_N[0] < force_N[1] < 20.0
    if case.press.drag_mm == (0.0, 0.0):
        assert force_N[1] < force_N[2] < 20.0
    else:
        assert force_N[2] == pytest.approx(force_N[1], rel=0.1)
    for level_mm, (markers, face) in zip(case.press.levels, states, strict=True):
        (contact,) = markers.contacts
        # a tip or ridge is flattened by the facets of the body and the elements of the pad
        assert level_mm - 0.03 < contact.depth_mm < level_mm + 0.01
        assert contact.depth_mm == pytest.approx(-face.face_mm[..., 2].min(), rel=0.03, abs=0.01)
        assert -markers.face_mm[..., 2].min() < contact.depth_mm
        half_mm = np.sqrt(np.linalg.eigvalsh(np.array(contact.moment_mm2)[[0, 2, 2, 1]].reshape(2, 2)))
        assert (half_mm > 0.1).all()
        assert contact.region_mm2 > np.pi * np.prod(half_mm)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_shear_is_that_of_friction(case: CalculixCase) -> None:
    """Along the way of a drag, at most that of Coulomb's law; next to nothing where nothing drags.

    The sloping face pushes the pad aside, and a side of the pad gives way.
    """
    last = pad_states(case)[-1][0].contacts[0]
    shear_N, normal_N = last.force_N[:2], last.normal_force_N
    way_mm = np.array(case.press.drag_mm)
    if way_mm.any():
        assert np.linalg.norm(shear_N) <= 1.05 * case.press.friction * normal_N
        along = shear_N @ way_mm / np.linalg.norm(shear_N) / np.linalg.norm(way_mm)
        assert along > 0.99
        assert np.linalg.norm(shear_N) > 0.15 * normal_N
    else:
        assert np.linalg.norm(shear_N) < 0.2 * normal_N


def test_files_are_small() -> None:
    folder = files("manytouch.evaluation") / "deformations"
    assert sum(len((folder / case.solution).read_bytes()) for case in CASES) < 300_000


def test_markers_of_the_pads() -> None:
    counts = []
    for case in CASES:
        layout, sheet = true_pad(case).layout, given_sensor(case).sheet
        assert layout is not None
        assert sheet is not None
        half_mm = 0.5 * np.array(case.size_mm)
        assert (np.abs(layout.rest_mm[:, :2]) < half_mm).all()
        assert (sheet.young_MPa, sheet.poisson) == (case.young_MPa, case.poisson)
        assert (sheet.young_std_MPa, sheet.poisson_std) == (0.0, 0.0)
        counts.append(len(layout.rest_mm))
    assert sorted(counts) == [63] * 8 + [400] * 4


def test_material_is_that_of_the_deck() -> None:
    """Shear modulus 2 C10, bulk modulus 20 times as large."""
    case = CASES[0]
    shear_MPa = case.young_MPa / (2.0 * (1.0 + case.poisson))
    bulk_MPa = case.young_MPa / (3.0 * (1.0 - 2.0 * case.poisson))
    assert shear_MPa == pytest.approx(0.145)
    assert bulk_MPa == pytest.approx(2.9)


def test_a_third_is_held_out_in_a_group_with_goals_and_seeds_of_its_own() -> None:
    assert {case.name for case in CASES if not case.looked_at} == set(HELD_OUT)
    assert cases(("pads_calculix",)) == CASES
    assert set(GOALS) == set(PAD_GROUPS)
    others = {case.seed for case in cases() if case.group != "pads_calculix"}
    assert not others & {case.seed for case in CASES}
