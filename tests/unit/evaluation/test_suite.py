"""The cases of the suite, and the sensor of a case."""

from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluationError
from manytouch.evaluation.suite.cases import (
    GROUPS,
    HOLD_FRAMES,
    OWN_PAD_GROUPS,
    PAD_GROUPS,
    REST_FRAMES,
    VARIED_GROUPS,
    Case,
    SensorPerturbation,
    Touch,
    pressure_share,
)
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.sensors import lattice, true_sensor
from manytouch.evaluation.suite.suite import APART_MM, FROM_CLAMP_MM, cases

SMALL = Case(
    group="nominal",
    name="small",
    seed=5,
    looked_at=True,
    touches=(Touch(at_mm=(5.0, -3.0), radius_mm=3.0, strength=1.0),),
    deepest_mm=1.0,
    size_mm=(48.0, 32.0),
    width_px=640,
)


def test_the_suite_is_the_same_every_time_and_has_no_name_twice() -> None:
    assert cases() == cases()
    titles = [case.title for case in cases()]
    assert len(set(titles)) == len(titles)


def test_half_of_each_group_is_held_out_and_a_third_of_the_varied_ones_and_of_pads() -> None:
    counts = Counter((case.group, case.looked_at) for case in cases())
    for group in set(GROUPS) - set(PAD_GROUPS) - set(VARIED_GROUPS):
        assert counts[group, True] == counts[group, False]
    for group in VARIED_GROUPS:
        assert (counts[group, True], counts[group, False]) == (80, 40)
    for group in OWN_PAD_GROUPS:
        assert (counts[group, True], counts[group, False]) == (15, 7)
    assert (counts["pads_calculix", True], counts["pads_calculix", False]) == (8, 4)
    assert {case.looked_at for case in cases(tuning=True)} == {True}


def test_nominal_is_what_the_suite_promises() -> None:
    found = cases(("nominal",))
    assert len(found) >= 40
    assert {case.size_mm for case in found} == {(120.0, 80.0), (160.0, 100.0), (70.0, 70.0)}
    assert {len(case.touches) for case in found} == {1, 2, 3, 4, 5, 6}
    assert (min(c.deepest_mm for c in found), max(c.deepest_mm for c in found)) == (0.3, 10.0)
    assert {(case.pitch_mm, case.noise) for case in found} == {(4.0, 2.5)}


@pytest.mark.parametrize("case", cases(("nominal", "stress")), ids=lambda case: case.title)
def test_touches_keep_apart_and_off_the_rim(case: Case) -> None:
    places = np.array([touch.at_mm for touch in case.touches])
    assert (np.abs(places) <= 0.5 * np.array(case.size_mm) - FROM_CLAMP_MM + 0.01).all()
    assert all(np.linalg.norm(a - b) >= APART_MM for a, b in combinations(places, 2))
    assert case.touches[0].strength == case.deepest_mm


def test_separation_pairs_have_their_distance_and_ratio_in_both_halves() -> None:
    found = cases(("separation",))
    for case in found:
        one, other = case.touches
        distance = float(np.linalg.norm(np.subtract(one.at_mm, other.at_mm)))
        assert case.name.startswith(f"{distance:.0f}mm-1to{other.strength:g}")
    assert {touch.strength for case in found for touch in case.touches} == {1.0, 0.3}
    for half in (True, False):
        distances = {case.name.split("-")[0] for case in found if case.looked_at == half}
        assert len(distances) == 12


def test_stress_goes_to_the_limits() -> None:
    found = cases(("stress",))
    assert {case.pitch_mm for case in found} >= {3.0, 8.0}
    assert max(case.noise for case in found) == 10
    assert max(len(case.touches) for case in found) == 8
    assert any(case.friction > 0 for case in found)
    assert any(case.missing_share > 0 for case in found)
    assert any(case.perturbation != SensorPerturbation() for case in found)


def test_quick_takes_some_of_each_group_from_both_halves() -> None:
    found = cases(quick=True)
    assert len(found) == 36
    assert {case.group for case in found} == set(GROUPS)
    assert len({case.looked_at for case in found}) == 2


def test_an_unknown_group_is_refused() -> None:
    with pytest.raises(EvaluationError, match="no group 'easy' of cases; there are: nominal, separation"):
        cases(("easy",))


def test_pressure_begins_after_the_rest_and_is_whole_while_held() -> None:
    assert pressure_share(REST_FRAMES - 1) == 0
    assert 0 < pressure_share(REST_FRAMES) < 0.1
    assert all(pressure_share(SMALL.frame_count - 1 - n) == 1 for n in range(HOLD_FRAMES))


# the sensor


@pytest.mark.parametrize("size_mm", [(120.0, 80.0), (160.0, 100.0), (70.0, 70.0)])
def test_the_picture_holds_the_sheet(size_mm: tuple[float, float]) -> None:
    camera = true_sensor(replace(SMALL, size_mm=size_mm)).camera
    per_mm = camera.fx_px / camera.translation_mm[2]
    assert size_mm[0] * per_mm < camera.width_px
    assert size_mm[1] * per_mm < camera.height_px


def test_the_lattice_is_centred_and_missing_dots_depend_on_the_seed() -> None:
    layout = lattice(replace(SMALL, missing_share=0.2))
    assert layout.shape == (8, 12)
    assert layout.rest_mm.mean(axis=0) == pytest.approx(0)
    assert 5 <= layout.is_missing.sum() <= 35
    assert (lattice(replace(SMALL, missing_share=0.2)).is_missing == layout.is_missing).all()


def test_the_given_sensor_has_the_perturbation_of_the_case() -> None:
    perturbation = SensorPerturbation(
        thickness_factor=1.1, young_factor=0.8, focal_factor=1.01, centre_off_px=5.0, is_lens_known=False
    )
    case = replace(SMALL, perturbation=perturbation, missing_share=0.3)
    true, wrong = true_sensor(case), given_sensor(case)
    assert wrong.sheet is not None
    assert wrong.layout is not None
    assert wrong.sheet.thickness_mm == pytest.approx(3.3)
    assert wrong.sheet.young_MPa == pytest.approx(0.8 * 3.1)
    assert wrong.camera.fx_px == pytest.approx(1.01 * true.camera.fx_px)
    assert wrong.camera.cx_px - true.camera.cx_px == pytest.approx(1.25)  # 5 px at 2560 px width
    assert not wrong.camera.distortion.any()
    assert not wrong.layout.is_missing.any()
