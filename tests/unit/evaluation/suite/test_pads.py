"""Bonded pads in the accuracy suite: pictures, truth, and figures apart from those of sheets."""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from manytouch.evaluation.metrics.comparison import figures
from manytouch.evaluation.report.pad_goals import goal_rows, goal_sentences
from manytouch.evaluation.report.report_data import contents, part
from manytouch.evaluation.suite.cases import HOLD_FRAMES, REST_FRAMES
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.pads.cases import OwnPadCase, pads
from manytouch.evaluation.suite.pads.pad_sensors import given_pad, true_pad
from manytouch.evaluation.suite.pads.presses import PRESSES
from manytouch.evaluation.suite.pads.recording import pad_states, simulate_pad
from manytouch.evaluation.suite.recordings import FemSimulation
from manytouch.evaluation.suite.runner import Evaluation, Trial, process_case
from manytouch.evaluation.suite.solutions import Solutions
from manytouch.evaluation.suite.suite import cases
from manytouch.session import pipeline_for
from manytouch.simulation.fem.contact.indenters import ConvexBody


@pytest.mark.parametrize("case", tuple(pads("pads")), ids=lambda case: case.name)
def test_every_press_ships_and_grows_with_its_depth(case: OwnPadCase) -> None:
    states = pad_states(case)
    force_N = [-markers.contacts[0].force_N[2] for markers, _ in states]
    assert len(states) == 3
    assert force_N[0] < force_N[1]
    if case.press.drag_mm == (0.0, 0.0) and case.press.twist_deg == 0.0:
        assert force_N[1] < force_N[2]
    else:
        assert force_N[2] == pytest.approx(force_N[1], rel=0.2)
    assert 0.01 < force_N[0] < force_N[-1] < 20.0
    for markers, face in states:
        deepest_mm = -face.face_mm[..., 2].min()
        assert max(contact.depth_mm for contact in markers.contacts) == pytest.approx(deepest_mm, rel=0.02)
        assert -markers.face_mm[..., 2].min() < deepest_mm


@pytest.mark.parametrize("case", tuple(pads("pads")), ids=lambda case: case.name)
def test_what_ships_is_what_is_pressed(case: OwnPadCase) -> None:
    loading, kept = case.press.loading(case.thickness_mm)
    states = pad_states(case)
    for number, (markers, _) in zip(kept, states, strict=True):
        assert len(markers.contacts) == len(loading.touches) + len(loading.patches)
        for touch, contact in zip(loading.touches, markers.contacts, strict=False):
            depth_mm = case.thickness_mm - touch.position_mm[number, 2]
            # a corner that is rounded ends above the sharp one
            rounded_mm = 0.5 if isinstance(touch.indenter, ConvexBody) else 0.0
            assert 0.9 * depth_mm - 0.03 - rounded_mm < contact.depth_mm < 1.1 * depth_mm + 0.03
        for patch, contact in zip(loading.patches, markers.contacts, strict=False):
            np.testing.assert_allclose(contact.force_N, patch.force_N[number], rtol=0.02)


def test_a_drag_takes_small_steps_and_ends_where_it_should() -> None:
    press = PRESSES["ball-4-mm-dragged"]
    loading, kept = press.loading(4.0)
    (touch,) = loading.touches
    np.testing.assert_allclose(touch.position_mm[kept[1]], [-1.5, 1.0, 3.25])
    np.testing.assert_allclose(touch.position_mm[kept[2]], [-1.0, 1.25, 3.25])
    step_mm = np.linalg.norm(np.diff(touch.position_mm[:, :2], axis=0), axis=1)
    assert 0.1 < step_mm.max() <= 0.125
    (twisted,) = PRESSES["punch-3-mm-twisted"].loading(3.0)[0].touches
    assert np.rad2deg(twisted.rotation_vector[-1, 2]) == pytest.approx(10.0)


def test_the_files_are_small() -> None:
    folder = files("manytouch.evaluation") / "deformations"
    sizes = [len((folder / case.solution).read_bytes()) for case in pads("pads")]
    assert sum(sizes) < 400_000


def test_a_nominal_file_is_off_and_states_wide_deviations() -> None:
    exact, nominal = (next(pads(group)) for group in ("pads", "pads_nominal"))
    true, given = true_pad(nominal).sheet, given_sensor(nominal).sheet
    assert true is not None
    assert given is not None
    assert given.young_MPa == pytest.approx(1.2 * true.young_MPa)
    assert given.young_std_MPa is not None
    assert abs(given.young_MPa - true.young_MPa) < given.young_std_MPa
    assert given.poisson < true.poisson
    unchanged = given_pad(exact).sheet
    assert unchanged is not None
    assert (unchanged.young_MPa, unchanged.young_std_MPa) == (true.young_MPa, None)


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    case = next(pads("pads"))
    simulation = FemSimulation(solutions=Solutions(folder=tmp_path_factory.mktemp("none")))
    assert simulation.refusal(case) is None
    return process_case(case, {"mechanics": pipeline_for("mechanics")}, simulation.simulate(case))


def test_truth_is_that_of_the_contact_face() -> None:
    case = next(pads("pads"))
    sensor, frames, truths = simulate_pad(case)
    assert len(frames) == len(truths) == case.frame_count == REST_FRAMES + 3 * HOLD_FRAMES
    assert frames[0].image is not None
    assert frames[0].image.shape == (480, 640)
    assert not truths[REST_FRAMES - 1].contacts.touching
    held = truths[REST_FRAMES]
    assert sensor.layout is not None
    place_mm = np.ascontiguousarray(sensor.layout.rest_mm[:, :2])
    expected_mm = pad_states(case)[0][1].displacement_mm(place_mm)
    np.testing.assert_allclose(held.surface.displacement_mm, expected_mm)
    assert len(held.contacts.touching) == 1


@pytest.mark.slow
def test_a_pad_is_scored_as_everything_else_and_its_figures_stand_apart(trial: Trial, tmp_path: Path) -> None:
    (found,) = trial.comparisons
    figured = figures(found)
    assert figured["contacts"]["recall_percent"] == 100
    assert figured["contacts"]["position_median_mm"] < 0.1
    assert figured["force"]["normal_median_percent"] < 15
    sheet = Trial(title="nominal/any", case=None, comparisons=(replace(found, frames=1),))
    both = Evaluation(
        title="any", truth_description="any", methods=("mechanics",), trials=(trial, sheet), settings={}
    )
    everything, apart = part(both, "mechanics"), part(both, "mechanics", "pads")
    assert everything is not None
    assert apart is not None
    assert (everything.frames, apart.frames) == (1, found.frames)
    assert part(both, "mechanics", "pads_nominal") is None
    assert set(contents(both)["figures"]["mechanics"]) == {"all", "pads"}
    rows = goal_rows(both)
    assert [row["goal"] for row in rows[:3]] == ["goal ≥ 97 %", "goal ≥ 95 %", "goal ≤ 0.25 mm"]
    assert all(row["cells"][0][1] for row in rows[:3])
    (sentence,) = goal_sentences(both)
    assert sentence.startswith("bonded pads, true sensor file, mechanics: precision 100 % (goal ≥ 97 %)")


def test_a_figure_beyond_its_goal_is_not_reached(trial: Trial) -> None:
    (found,) = trial.comparisons
    worse = replace(found.contacts, force_N=2.0 * found.contacts.force_N)
    bad = replace(trial, comparisons=(replace(found, contacts=worse),))
    evaluation = Evaluation(
        title="any", truth_description="any", methods=("mechanics",), trials=(bad,), settings={}
    )
    reached = {row["label"]: row["cells"][0][1] for row in goal_rows(evaluation)}
    assert not reached["normal force error, relative, median"]
    assert reached["precision"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("group", "missed"), [("pads", set()), ("pads_calculix", {"normal force error, relative, median"})]
)
def test_presses_on_pads_reach_their_goals(group: str, missed: set[str], tmp_path: Path) -> None:
    simulation, pipelines = (
        FemSimulation(solutions=Solutions(folder=tmp_path)),
        {"mechanics": pipeline_for("mechanics")},
    )
    trials = tuple(process_case(case, pipelines, simulation.simulate(case)) for case in cases((group,)))
    evaluation = Evaluation(
        title="any", truth_description="any", methods=("mechanics",), trials=trials, settings={}
    )
    rows = goal_rows(evaluation)
    assert len(rows) == 9
    assert {row["label"] for row in rows if not row["cells"][0][1]} <= missed
