"""Options of the command, what it refuses, and the files that it leaves."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cyclopts import App, CycloptsError

from manytouch.cli.evaluate import evaluate
from manytouch.errors import ManytouchError
from manytouch.evaluation import compare_folders as own
from manytouch.evaluation.suite import runner, solutions
from manytouch.evaluation.suite.cases import Case
from manytouch.evaluation.suite.runner import Evaluation, Trial
from manytouch.session import METHODS
from manytouch.simulation.fem.cache import user_cache

app = App(name="manytouch")
app.command(evaluate)


def run(*words: str) -> Any:
    return app(["evaluate", *words], exit_on_error=False, print_error=False, result_action="return_value")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("one", "--out", "x"), "both RESULT_DIR and TRUTH_DIR or neither, found 1"),
        (("a", "b", "c", "--out", "x"), "found 3"),
        (("a", "b", "--quick", "--out", "x"), "are for the suite"),
        (("a", "b", "--method", "paper", "--out", "x"), "are for the suite"),
        (("--method", "nonsense", "--out", "x"), "nonsense"),
        (("--group", "easy", "--out", "x"), "easy"),
        (("--processes", "0", "--out", "x"), "Must be >= 1"),
        (("--quick",), "--out"),
    ],
)
def test_a_wrong_command_line_is_refused_before_anything_runs(
    words: tuple[str, ...], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CycloptsError) as caught:
        run(*words)
    assert sentence in str(caught.value)
    assert not (tmp_path / "x").exists()


def test_folders_that_are_not_there_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ManytouchError, match="is not a folder"):
        run(str(tmp_path / "a"), str(tmp_path / "b"), "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_file_instead_of_a_folder_is_refused_before_the_folders_are_read(tmp_path: Path) -> None:
    out = tmp_path / "report"
    out.write_text("mine")
    with pytest.raises(ManytouchError, match="is a file, not a folder"):
        run(str(tmp_path / "a"), str(tmp_path / "b"), "--out", str(out))
    assert out.read_text() == "mine"


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, Path]]:
    """How many cases would be solved, and kept where, instead of solving them."""
    solved_cases: list[tuple[int, Path]] = []

    def solve(cases: Any, solutions: Any, **more: Any) -> None:
        solved_cases.append((len(cases), solutions.folder))

    monkeypatch.setattr(solutions, "solve_missing", solve)
    return solved_cases


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[Evaluation]:
    """What would be reported, instead of a report."""
    from manytouch.evaluation.report import page as report

    reported: list[Evaluation] = []

    def write(evaluation: Evaluation, folder: Path) -> Path:
        reported.append(evaluation)
        return folder / "report.html"

    monkeypatch.setattr(report, "write_report", write)
    return reported


def recorded_run(chosen: list[tuple[Case, ...]]) -> Callable[..., Evaluation]:
    def suite(
        cases: Any, methods: Any, simulation: Any, *, settings: Any, observer: Any, **more: Any
    ) -> Evaluation:
        chosen.append(cases)
        observer.begin("reading", len(cases))
        for case in cases:
            observer.done(case.title, "read")
        more["trial_folder"].mkdir(parents=True)
        return Evaluation(
            title="suite",
            truth_description=simulation.description,
            methods=tuple(methods),
            trials=tuple(Trial(title=case.title, case=case, comparisons=()) for case in cases),
            settings=settings,
        )

    return suite


def test_the_suite_takes_its_options(
    written: list[Evaluation],
    solved: list[tuple[int, Path]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    chosen: list[tuple[Case, ...]] = []
    monkeypatch.setattr(runner, "run_suite", recorded_run(chosen))
    words = ("--quick", "--tuning", "--method", "paper", "--group", "stress", "--group", "nominal")
    assert run(*words, "--cache", str(tmp_path / "cache"), "--out", str(tmp_path)) == 0
    assert solved == [(len(chosen[0]), tmp_path / "cache")]
    assert not (tmp_path / ".trials").exists()  # the report is written, nothing is left to go on with
    assert {case.group for case in chosen[0]} == {"stress", "nominal"}
    assert all(case.looked_at and case.is_quick for case in chosen[0])
    assert written[0].methods == ("paper",)
    assert set(written[0].settings) == {"parameters", "versions", "processes"}
    out = capsys.readouterr().out
    assert f"reading {len(chosen[0])} of {len(chosen[0])}  {chosen[0][-1].title}: read" in out
    assert f"report in {tmp_path / 'report.html'}" in out


def test_without_options_every_method_reads_every_case(
    written: list[Evaluation],
    solved: list[tuple[int, Path]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    chosen: list[tuple[Case, ...]] = []
    monkeypatch.setattr(runner, "run_suite", recorded_run(chosen))
    assert run("--out", str(tmp_path)) == 0
    assert len(chosen[0]) == 564
    assert written[0].methods == METHODS
    assert solved == [(564, user_cache())]


def test_a_stopped_suite_states_how_many_cases_its_report_has(
    written: list[Evaluation],
    solved: list[tuple[int, Path]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    whole = recorded_run([])

    def stopped(cases: Any, *others: Any, **named: Any) -> Evaluation:
        evaluation = whole(cases, *others, **named)
        return replace(evaluation, trials=evaluation.trials[:2])

    monkeypatch.setattr(runner, "run_suite", stopped)
    assert run("--quick", "--out", str(tmp_path)) == 0
    printed = capsys.readouterr().out
    assert "stopped: the report is of 2 of 36 cases; run the same command again to continue" in printed
    assert (tmp_path / ".trials").exists()
    assert "intervals: \n" not in printed


def test_two_folders_are_compared(
    written: list[Evaluation], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    given: list[Path] = []

    def compared(result: Path, truth: Path) -> Evaluation:
        given.extend((result, truth))
        return Evaluation(title="own", truth_description="own", methods=("paper",), trials=())

    monkeypatch.setattr(own, "evaluate_folders", compared)
    assert run("result", "truth", "--out", str(tmp_path)) == 0
    assert given == [Path("result"), Path("truth")]
    assert written[0].title == "own"
