"""The paper's experiments: each figure on something whose answer is known by hand."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hollows import bumps
from layouts import lattice_layout
from manytouch.evaluation.published import material, places, spacing, stall
from manytouch.evaluation.published.formulas import FormulaError, formula_errors, law_mm
from manytouch.evaluation.published.page import Experiments, contents, deviations, row, write_page
from manytouch.evaluation.published.speed import Speed, plain_map, plotted_ms
from manytouch.evaluation.published.stall import StallTest, stall_tests
from manytouch.evaluation.suite.cases import GROUPS, Case
from manytouch.evaluation.suite.recordings import FemSimulation, SimulatedRecording, simulate_case
from manytouch.evaluation.suite.solutions import Solutions
from manytouch.geometry.inverse_distance import inverse_distance_plane
from manytouch.session import METHODS, pipeline_for
from manytouch.simulation.fem.cache import StateCache
from manytouch.sources.simulated import simulated_source

STIFFENING = material.Deflection(
    size_mm=(120.0, 80.0),
    force_over_E_mm2=np.array([0.001, 1.0, 2.0, 4.0]),
    depth_mm=np.array([0.02, 8.0, 9.1, 11.1]),
)
FOUND = Experiments(
    deflections=(STIFFENING,) * 4,
    sag_mm=10.9,
    gaps=(
        spacing.Gaps(
            height_mm=1.0, steepest_deg=30.0, true_mm=1.5, corrected_mm=1.4, printed_mm=0.6, off_mm=0.1
        ),
    ),
    gap_MPa=3.3,
    formulas=(
        FormulaError(
            formula="printed", rmse_mm=2.31, worst_rmse_mm=3.4, excess=1.19, worst_excess=1.4, frames=37
        ),
    ),
    presses={
        "truth": (
            places.PublishedPress(along_mm=60.0, depth_mm=10.0),
            places.PublishedPress(along_mm=115.0, depth_mm=10.2),
        ),
        "paper": (
            places.PublishedPress(along_mm=61.0, depth_mm=14.0),
            places.PublishedPress(along_mm=113.0, depth_mm=np.nan),
        ),
    },
    stalls=(
        StallTest(
            method="paper",
            step=4,
            motion_px=14.9,
            gate_px=14.0,
            frames=60,
            incomplete_frames=23,
            first_incomplete=37,
            lost=3,
            wrong=0,
            new_ids=3,
        ),
    ),
    speed=Speed(markers=960, points=10_000, chain_ms=50.0, table_ms=2.0, plain_ms=1950.0, plot_ms=3000.0),
)


def test_the_modulus_is_the_one_at_which_10_N_press_as_deep_as_printed() -> None:
    assert STIFFENING.young_MPa == pytest.approx(10.0 / 3.0)  # 10.1 mm lies half-way from 2 to 4 mm^2
    assert STIFFENING.linear_young_MPa == pytest.approx(20.0 * 10.0 / 10.1)
    assert STIFFENING.linear_depth_mm(0.01) == pytest.approx(20_000.0)
    assert STIFFENING.depth_of_10_N_mm(5.0) == pytest.approx(9.1)
    assert np.isnan(STIFFENING.depth_of_10_N_mm(0.01))


def test_the_law_and_the_readings_of_a_sheet_that_only_comes_nearer_are_its_depth() -> None:
    layout = lattice_layout(5, 7, np.array([4.0, 4.0]))
    moved_mm = np.tile([0.0, 0.0, -2.5], (35, 1))
    np.testing.assert_allclose(law_mm(layout, moved_mm, 110.0), 2.5)
    stretched = np.column_stack([0.01 * layout.rest_mm[:, 0], np.zeros((35, 2))])
    np.testing.assert_allclose(law_mm(layout, stretched, 110.0), 0.5 * 110.0 * 0.01)
    tilted = np.column_stack([np.zeros((35, 2)), -0.1 * layout.rest_mm[:, 1]])
    np.testing.assert_allclose(law_mm(layout, tilted, 110.0), 1.5 * 0.1 * layout.rest_mm[:, 1])


def test_the_readings_of_the_equations_are_those_of_the_documentation() -> None:
    found = {one.formula: one for one in formula_errors()}
    table = (Path(__file__).parents[3] / "docs" / "paper.md").read_text(encoding="utf-8")
    assert len(found) == 6
    for one in found.values():
        figures = f"| {one.rmse_mm:.2f} / {one.worst_rmse_mm:.2f} |"
        assert f"{figures} {100 * one.excess:.0f} / {100 * one.worst_excess:.0f} % |" in table
    assert found["corrected"].excess > 0.9  # the law makes a finger much too deep
    assert found["printed"].rmse_mm != pytest.approx(found["corrected"].rmse_mm, rel=0.05)


def test_the_corrected_gap_of_a_flat_sheet_is_the_pitch_less_two_radii_and_the_printed_one_is_not() -> None:
    flat = np.zeros(1)
    assert spacing.corrected_gap_mm(np.array([4.0]), 0.7, flat, flat) == pytest.approx([2.0])
    assert spacing.printed_gap_mm(np.array([4.0]), 0.7, flat, flat) == pytest.approx([1.3])


def test_tips_on_a_sheet_that_turns_away_from_them_come_closer() -> None:
    level, steep = np.zeros(1), np.full(1, np.deg2rad(30.0))
    assert spacing.corrected_gap_mm(np.array([4.0]), 2.0, level, steep) == pytest.approx(
        [4 * np.sqrt(0.75) - 1.0 - 1.0 - np.sqrt(0.75)]
    )


def test_the_gaps_of_a_solved_sheet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("skfem")
    monkeypatch.setattr(material, "SHEETS_MM", ((40.0, 30.0),))
    monkeypatch.setattr(material, "PRINTED_DEPTH_MM", 2.0)
    monkeypatch.setattr(material, "ENOUGH_MM", 2.2)
    cache = StateCache(folder=tmp_path)
    pressed, young_MPa = material.printed_press(cache)
    found = [spacing.gaps(pressed, height_mm) for height_mm in (0.0, 2.0)]
    assert young_MPa in {10.0 / force for force in material.FORCE_OVER_E_MM2}
    for one in found:
        assert one.corrected_mm == pytest.approx(one.true_mm, abs=0.3)
        assert one.off_mm < 0.3
    assert found[1].printed_mm < found[1].true_mm - 1.0
    deflection = material.deflection((40.0, 30.0), cache)
    assert (np.diff(deflection.depth_mm) > 0).all()
    assert deflection.depth_mm[-1] >= 2.0
    assert deflection.linear_young_MPa > deflection.young_MPa  # stretching makes it stiffer


def test_the_presses_are_at_60_and_115_mm_and_in_no_group_of_the_suite() -> None:
    first, second = places.presses()
    assert [case.touches[0].at_mm[0] + 80.0 for case in (first, second)] == pytest.approx([60.0, 115.0])
    assert first.group not in GROUPS


@pytest.mark.parametrize("width_px", [400, pytest.param(640, marks=pytest.mark.slow)])
def test_each_method_reads_the_press_where_it_is_with_its_ground_truth(width_px: int) -> None:
    small = replace(places.presses()[0], width_px=width_px)
    deep = replace(small, deepest_mm=4.0)
    recording = simulate_case(deep, bumps(deep))

    class Hollow:
        description = "a hollow"

        def refusal(self, case: Case) -> str | None:
            return None

        def simulate(self, case: Case) -> SimulatedRecording:
            return recording

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(places, "presses", lambda: (small, small))
        found = places.table({"perimeter": pipeline_for("perimeter")}, Hollow())
    assert row(found["truth"]) == pytest.approx([60.0, 60.0, 4.0])
    assert found["perimeter"][0].along_mm == pytest.approx(60.0, abs=4.0)
    assert found["perimeter"][0].depth_mm > 1.0


def test_the_map_in_plain_loops_is_the_map() -> None:
    chance = np.random.default_rng(1)
    place_mm, depth_mm = chance.uniform(0, 20, (30, 2)), chance.normal(size=30)
    fast = inverse_distance_plane(place_mm, 9, 6.0, 2.0)(depth_mm)
    plain = plain_map(
        place_mm[:, 0].tolist(), place_mm[:, 1].tolist(), depth_mm.tolist(), iterations=9, radius_mm=6.0
    )
    np.testing.assert_allclose(plain, fast, atol=1e-12)


def test_the_page_states_what_fits_and_what_does_not(tmp_path: Path) -> None:
    page = write_page(FOUND, tmp_path).read_text(encoding="utf-8")
    assert "0.01 N/mm² does not fit" in page
    assert "3.33" in page
    assert "59.69" in page
    assert "+1.00, -2.00, –" in page  # the paper's method against the truth; a depth that is not given
    assert "0.50" in page  # frames per second with the map in loops
    assert "<svg" in page
    assert not re.findall(r'(?:src|href)="(?!#)', page)
    assert json.loads((tmp_path / "paper.json").read_text()) == contents(FOUND)


@pytest.mark.slow
def test_fast_motion_loses_identities_of_the_paper_and_stops_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = simulated_source(width_px=640)
    (fast,) = stall_tests({"paper": pipeline_for("paper")}, scene, steps=(8,))
    monkeypatch.setattr(stall, "MOST_FRAMES", 30)
    (slow,) = stall_tests({"paper": pipeline_for("paper")}, scene, steps=(2,))
    assert slow.motion_px < 7.0 < fast.motion_px  # the gate is 0.4 of 17.5 px
    assert (slow.frames, slow.lost, slow.new_ids, slow.first_incomplete) == (30, 0, 0, None)
    assert slow.gate_px == pytest.approx(7.0, abs=0.1)
    assert fast.frames == 38
    assert fast.lost > 0
    assert fast.new_ids > 0
    assert fast.first_incomplete is not None
    assert fast.incomplete_frames <= fast.frames - fast.first_incomplete


def test_a_plot_takes_time() -> None:
    pytest.importorskip("matplotlib")
    axis = np.linspace(0.0, 1.0, 12)
    assert plotted_ms(np.outer(axis, axis), axis, axis) > 0.0


PAPER = (Path(__file__).parents[3] / "docs" / "paper.md").read_text(encoding="utf-8")


def test_the_table_of_the_documentation_names_files_and_functions_that_exist() -> None:
    table = PAPER[PAPER.index("| of the paper | file in") : PAPER.index("There is no equation 10.")]
    package, count = Path(places.__file__).parents[2], 0
    for cell in (line.split("|")[2] for line in table.splitlines() if line.startswith("|")):
        for file, function in re.findall(r"`([\w/]+(?:\.py|/))`(?:: `(\w+)`)?", cell):
            count += 1
            assert (package / file).exists(), file
            if function:
                text = (package / file).read_text(encoding="utf-8")
                assert f"def {function}(" in text, f"{file}: {function}"
    assert count > 15


@pytest.mark.slow
def test_table_3_is_that_of_the_documentation_and_mechanics_within_2_percent(tmp_path: Path) -> None:
    methods = {name: pipeline_for(name) for name in METHODS}
    found = places.table(methods, FemSimulation(solutions=Solutions(folder=tmp_path)))
    for name, presses in found.items():
        if name == "truth":
            continue
        cells = [
            f"{value:.2f}" if np.isnan(std) else f"{value:.2f} ± {std:.2f}"
            for value, std in zip(row(presses), deviations(presses), strict=True)
        ]
        assert f"| here: `--method {name}` | {' | '.join(cells)} |" in PAPER
    assert row(found["truth"]) == pytest.approx([60.0, 115.0, 10.06], abs=0.2)
    assert row(found["mechanics"])[2] == pytest.approx(10.06, rel=0.02)
    assert row(found["mechanics"])[:2] == pytest.approx(row(found["truth"])[:2], abs=0.2)


@pytest.mark.slow
def test_fast_motion_is_as_documented() -> None:
    found = stall_tests({name: pipeline_for(name) for name in ("paper", "perimeter")})
    assert all(one.wrong == 0 for one in found)
    for method in ("paper", "perimeter"):
        mine = [one for one in found if one.method == method]
        name = {"paper": "`paper`", "perimeter": "`perimeter`, `mechanics`"}[method]
        lost = " | ".join(str(one.lost) for one in mine)
        incomplete = " | ".join(f"{one.incomplete_frames} of {one.frames}" for one in mine)
        assert f"| {name}: markers lost in the worst frame | {lost} |" in PAPER
        assert f"| {name}: incomplete frames | {incomplete} |" in PAPER
