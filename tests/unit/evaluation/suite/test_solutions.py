"""What is solved is kept, found again, and solved again when anything that decides it has changed."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from manytouch.errors import MissingExtraError
from manytouch.evaluation.suite import solutions as module
from manytouch.evaluation.suite.cases import RAMP_FRAMES, Case, Touch
from manytouch.evaluation.suite.pressing import Pressed, solve_presses
from manytouch.evaluation.suite.recordings import CaseSimulation, FemSimulation
from manytouch.evaluation.suite.solutions import Solutions, shipped_name, solve_missing
from manytouch.evaluation.suite.suite import cases

CASE = Case(
    group="nominal",
    name="small",
    seed=5,
    looked_at=True,
    touches=(Touch(at_mm=(2.0, -1.0), radius_mm=5.0, strength=0.8),),
    deepest_mm=0.8,
    size_mm=(24.0, 20.0),
    width_px=640,
)


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Titles of the cases that are really solved, on coarse elements."""
    pytest.importorskip("skfem")
    titles: list[str] = []

    def counted(case: Case) -> Iterator[Pressed]:
        titles.append(case.title)
        return solve_presses(case, element_mm=4.0)

    monkeypatch.setattr(module, "solve_presses", counted)
    return titles


def test_a_case_is_solved_once_and_simulated_from_what_is_kept(tmp_path: Path, solved: list[str]) -> None:
    solutions = Solutions(folder=tmp_path / "kept")
    simulation = FemSimulation(solutions=solutions)
    assert isinstance(simulation, CaseSimulation)
    assert simulation.refusal(CASE) == "no solution is known yet"
    solve_missing((CASE,), solutions)
    solve_missing((CASE,), solutions)
    assert solved == [CASE.title]
    assert simulation.refusal(CASE) is None
    known = Solutions(folder=tmp_path / "kept").known(CASE)
    assert known is not None
    assert len(known) == RAMP_FRAMES
    recording = simulation.simulate(CASE)
    assert solved == [CASE.title]
    rest, last = recording.truths[14], recording.truths[-1]
    assert np.abs(rest.surface.displacement_mm).max() == 0
    assert not rest.contacts.touching
    (contact,) = last.contacts.touching
    assert contact.depth_mm == pytest.approx(-last.surface.displacement_mm[:, 2].min(), rel=0.1)
    assert 0.6 < contact.depth_mm < 0.8  # the ball is 0.8 mm deep, the solid is pressed together
    assert contact.force_N[2] == pytest.approx(known[-1].contacts[0].force_N[2])


def test_another_sheet_depth_or_seed_of_a_drag_is_another_case(tmp_path: Path) -> None:
    rough = replace(CASE, friction=0.3)
    different = [
        CASE,
        replace(CASE, thickness_mm=2.0),
        replace(CASE, pretension_N_per_mm=0.0),
        replace(CASE, touches=(replace(CASE.touches[0], strength=0.9),)),
        replace(CASE, strength_is="force"),
        replace(CASE, deepest_mm=0.9),
        rough,
        replace(rough, seed=6),
        replace(rough, friction=0.6),
    ]
    assert len({shipped_name(case) for case in different}) == len(different)
    alike = (CASE, replace(CASE, seed=6), replace(CASE, noise=9.0), replace(CASE, pitch_mm=3.0))
    assert len({shipped_name(case) for case in alike}) == 1


def test_a_damaged_file_is_solved_again(tmp_path: Path, solved: list[str]) -> None:
    solutions = Solutions(folder=tmp_path)
    solve_missing((CASE,), solutions)
    (kept,) = tmp_path.glob("*.npz")
    kept.write_bytes(kept.read_bytes()[:100])
    assert solutions.known(CASE) is None
    solve_missing((CASE,), solutions)
    assert len(solved) == 2
    assert solutions.known(CASE) is not None


def test_without_the_finite_elements_one_sentence_names_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def absent() -> np.ndarray:
        raise MissingExtraError("solving the sheet", "scikit-fem")

    monkeypatch.setattr(module, "reference_nodes", absent)
    with pytest.raises(MissingExtraError, match="scikit-fem"):
        solve_missing((CASE, replace(CASE, thickness_mm=2.0)), Solutions(folder=tmp_path), processes=2)
    solve_missing(cases(quick=True), Solutions(folder=tmp_path), processes=2)  # these ship


def test_a_case_without_equilibrium_is_left_out_and_not_solved_again(
    tmp_path: Path, solved: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(case: Case) -> Iterator[Pressed]:
        for number, step in enumerate(solve_presses(case, element_mm=4.0)):
            yield replace(step, state=replace(step.state, status="not_converged")) if number == 2 else step

    monkeypatch.setattr(module, "solve_presses", failing)
    solutions = Solutions(folder=tmp_path)
    assert len(solutions.solve(CASE)) == 2
    assert FemSimulation(solutions=solutions).refusal(CASE) == "no equilibrium was found"
    assert len(list(tmp_path.iterdir())) == 1


def test_the_quick_cases_ship_with_the_package(tmp_path: Path) -> None:
    solutions = Solutions(folder=tmp_path)
    for case in cases(("nominal", "separation", "stress"), quick=True):
        known = solutions.known(case)
        assert known is not None, case.title
        assert len(known) == RAMP_FRAMES
        assert np.nanmax([contact.depth_mm for contact in known[-1].contacts]) < case.deepest_mm


@pytest.mark.slow
def test_what_ships_is_what_the_solver_computes(tmp_path: Path) -> None:
    pytest.importorskip("skfem")
    (case,) = (case for case in cases(quick=True) if case.name.startswith("70x70"))
    shipped = Solutions(folder=tmp_path).known(case)
    assert shipped is not None
    again = Solutions(folder=tmp_path).solve(case)
    assert np.abs(again[-1].face_mm - shipped[-1].face_mm).max() < 2e-3
    for now, kept in zip(again[-1].contacts, shipped[-1].contacts, strict=True):
        assert now.force_N == pytest.approx(kept.force_N, rel=2e-3, abs=1e-3)
        assert now.centre_mm == pytest.approx(kept.centre_mm, abs=2e-3)
