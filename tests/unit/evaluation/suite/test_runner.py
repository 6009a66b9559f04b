"""The run of the suite with stages that know the truth, that are blind, and that cannot begin."""

import io
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hollows import bumps
from manytouch.errors import LayoutError
from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluationError
from manytouch.evaluation.metrics.comparison import figures, pooled
from manytouch.evaluation.suite import runner
from manytouch.evaluation.suite.cases import Case, SensorPerturbation, Touch
from manytouch.evaluation.suite.recordings import SimulatedRecording, simulate_case
from manytouch.evaluation.suite.runner import Evaluation, process_case, run_suite
from manytouch.evaluation.suite.trial_store import read_comparisons, write_comparisons
from manytouch.pipeline import Pipeline
from manytouch.values import Contacts, Detections, Frame, Sensor, Surface, TrackedGrid, Truth
from manytouch.values.arrays import Points2

CASE = Case(
    group="stress",
    name="small",
    seed=5,
    looked_at=False,
    touches=(Touch(at_mm=(6.0, -3.0), radius_mm=3.0, strength=1.5),),
    deepest_mm=1.5,
    size_mm=(48.0, 32.0),
    width_px=640,
)


@cache
def recording() -> SimulatedRecording:
    return simulate_case(CASE, bumps(CASE))


@dataclass(frozen=True)
class Remembering:
    """All three stages: they look the frame up in the truth."""

    truths: tuple[Truth, ...]
    depth_factor: float = 1.0
    is_blind: bool = False

    def start(self, sensor: Sensor) -> Any:
        return -1

    def step(self, state: Any, given: Any, expected_px: Points2 | None = None) -> Any:
        raise NotImplementedError


@dataclass(frozen=True)
class Detect(Remembering):
    def step(self, state: Any, given: Frame, expected_px: Points2 | None = None) -> Any:
        some = np.full(1, float(given.index))
        dots = Detections(
            centre_px=np.zeros((1, 2)), covariance_px2=np.zeros((1, 2, 2)), area_px2=some, contrast=some
        )
        return state, dots


@dataclass(frozen=True)
class Track(Remembering):
    def step(self, state: Any, given: Detections, expected_px: Points2 | None = None) -> Any:
        return int(given.area_px2[0]), self.truths[int(given.area_px2[0])].grid

    def expected_px(self, state: Any) -> Points2 | None:
        return None

    def needs_full_search(self, state: Any) -> bool:
        return False

    def resume(self, started: Any, before: Any) -> Any:
        return before


@dataclass(frozen=True)
class Estimate(Remembering):
    def step(self, state: Any, given: TrackedGrid, expected_px: Points2 | None = None) -> Any:
        (truth,) = (truth for truth in self.truths if truth.grid is given)
        moved = truth.surface.displacement_mm * (np.nan if self.is_blind else self.depth_factor)
        surface = Surface(
            position_mm=truth.surface.position_mm,
            displacement_mm=moved,
            covariance_mm2=truth.surface.covariance_mm2,
        )
        return state, surface, Contacts() if self.is_blind else truth.contacts


def pipeline(**wrong: Any) -> Pipeline:
    truths = recording().truths
    return Pipeline(
        detect=Detect(truths, **wrong), track=Track(truths, **wrong), estimate=Estimate(truths, **wrong)
    )


@dataclass
class CaseSimulation:
    description: str = "a hollow"
    simulations: int = field(default=0, repr=False)

    def refusal(self, case: Case) -> str | None:
        return "it has no friction" if case.friction > 0 else None

    def simulate(self, case: Case) -> SimulatedRecording:
        self.simulations += 1
        return recording()


class Watched:
    def __init__(self) -> None:
        self.messages: list[str] = []

    def begin(self, work: str, count: int) -> None:
        self.messages.append(f"{work} {count}")

    def report(self, sentence: str) -> None:
        self.messages.append(sentence)

    def done(self, title: str, sentence: str) -> None:
        self.messages.append(f"{title}: {sentence}")


@pytest.fixture(autouse=True)
def _referred(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stages need no reference frames."""
    monkeypatch.setattr(runner, "register_rest", lambda sensor, frames: sensor)


@cache
def evaluation() -> Evaluation:
    methods = {"right": pipeline(), "half": pipeline(depth_factor=0.5), "blind": pipeline(is_blind=True)}
    slippery = replace(CASE, name="slippery", friction=0.3)
    return run_suite((CASE, slippery), methods, CaseSimulation(), settings={"versions": {"manytouch": "0"}})


def found(method: int) -> dict[str, dict[str, Any]]:
    return figures(evaluation().trials[0].comparisons[method])


def test_who_knows_the_truth_makes_no_error() -> None:
    right = found(0)
    assert right["depth"]["rmse_worst_mm"] == 0
    assert right["depth"]["peak_percent"] == 0
    assert right["contacts"]["recall_percent"] == right["contacts"]["precision_percent"] == 100
    assert right["force"]["normal_p95_N"] == 0
    assert right["detection"]["found_percent"] == 100
    assert right["frames"] == {"true": 27, "compared": 27, "failed": 0}
    assert right["latency"]["p50_ms"] > 0


def test_half_the_depth_is_half_the_peak() -> None:
    assert found(1)["depth"]["peak_bias_percent"] == pytest.approx(-50)
    assert found(1)["depth"]["rmse_worst_mm"] > 0.2


def test_the_blind_score_nothing_instead_of_well() -> None:
    blind = found(2)
    assert blind["contacts"]["recall_percent"] == 0
    assert blind["depth"]["given_percent"] == 0
    assert np.isnan(blind["depth"]["rmse_median_mm"])


def test_the_worst_moment_has_its_picture() -> None:
    worst = evaluation().trials[0].comparisons[1].worst
    assert worst is not None
    assert worst.picture is not None
    assert worst.picture.shape == (360, 640)
    assert worst.frame >= 22  # where the pressure has become whole


def test_cases_that_cannot_be_simulated_are_left_out_and_reported() -> None:
    watched = Watched()
    slippery = replace(CASE, name="slippery", friction=0.3)
    done = run_suite((CASE, slippery), {"right": pipeline()}, CaseSimulation(), settings={}, observer=watched)
    assert done.left_out == {"stress/slippery": "it has no friction"}
    assert watched.messages[:2] == ["reading 1", "left out: 1 case, since it has no friction"]
    assert watched.messages[2] == "stress/small: right: depth RMSE 0.000 mm, 100 % of the contacts found"


def test_a_run_can_be_stopped_between_cases() -> None:
    answers = iter((False, True))
    other = replace(CASE, name="other")
    done = run_suite(
        (CASE, other), {"right": pipeline()}, CaseSimulation(), settings={}, stop=lambda: next(answers)
    )
    assert [trial.title for trial in done.trials] == ["stress/small"]
    assert done.left_out == {"stress/other": "the run was stopped"}


def test_a_run_that_was_killed_is_resumed_with_the_trials_that_are_stored(tmp_path: Path) -> None:
    other, simulation = replace(CASE, name="other"), CaseSimulation()
    first = run_suite((CASE,), {"right": pipeline()}, simulation, settings={}, trial_folder=tmp_path)
    again = run_suite((CASE, other), {"right": pipeline()}, simulation, settings={}, trial_folder=tmp_path)
    assert simulation.simulations == 2  # the second run has simulated the other case alone
    one, same = (done.trials[0].comparisons[0].milliseconds for done in (first, again))
    assert (one == same).all()
    run_suite((CASE,), {"right": pipeline(depth_factor=0.9)}, simulation, settings={}, trial_folder=tmp_path)
    assert simulation.simulations == 3  # another parameter, another trial
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:50])
    run_suite((CASE,), {"right": pipeline()}, simulation, settings={}, trial_folder=tmp_path)
    assert simulation.simulations == 4  # half a file is none


def same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if is_dataclass(one):
        return type(one) is type(other) and all(
            same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one)
        )
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other or (isinstance(one, float) and np.isnan(one) and np.isnan(other))


def test_errors_in_a_file_come_back_bit_for_bit(tmp_path: Path) -> None:
    comparisons = evaluation().trials[0].comparisons
    write_comparisons(tmp_path / "trial.npz", comparisons)
    assert same(read_comparisons(tmp_path / "trial.npz"), comparisons)


class Planted:
    """A pickle that makes a folder when it is loaded."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> Any:
        return Path.mkdir, (self.folder,)


@pytest.mark.parametrize("kind", ["pickle", "array of objects", "unknown type"])
def test_nothing_in_a_folder_of_results_is_executed(tmp_path: Path, kind: str) -> None:
    proof, folder, simulation = tmp_path / "executed", tmp_path / "trials", CaseSimulation()
    run_suite((CASE,), {"right": pipeline()}, simulation, settings={}, trial_folder=folder)
    (path,) = folder.iterdir()
    content = {
        "pickle": pickle.dumps(Planted(proof)),
        "array of objects": npz(tree=np.array([Planted(proof)], dtype=object)),
        "unknown type": npz(tree=np.array('[{"type": "Path", "fields": {}}]')),
    }[kind]
    path.write_bytes(content)
    done = run_suite((CASE,), {"right": pipeline()}, simulation, settings={}, trial_folder=folder)
    assert not proof.exists()
    assert (simulation.simulations, len(done.trials)) == (2, 1)


def npz(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def test_methods_begin_from_the_frames_at_rest_and_the_given_sensor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given: list[tuple[Sensor, int]] = []

    def register_rest(sensor: Sensor, frames: Sequence[Frame]) -> Sensor:
        given.append((sensor, len(frames)))
        return sensor

    monkeypatch.setattr(runner, "register_rest", register_rest)
    perturbed = replace(CASE, perturbation=SensorPerturbation(thickness_factor=1.1))
    process_case(perturbed, {"right": pipeline()}, recording())
    ((sensor, frames),) = given
    assert sensor.sheet is not None
    assert (sensor.sheet.thickness_mm, frames) == (pytest.approx(3.3), 15)


def test_a_method_that_cannot_begin_finds_nothing_and_reports_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def register_rest(sensor: Sensor, frames: Sequence[Frame]) -> Sensor:
        raise LayoutError("no dots")

    monkeypatch.setattr(runner, "register_rest", register_rest)
    comparison = process_case(CASE, {"right": pipeline()}, recording()).comparisons[0]
    silent = figures(comparison)
    assert silent["contacts"]["recall_percent"] == 0
    assert silent["detection"]["found_percent"] == 0
    assert silent["frames"]["failed"] == 27
    assert comparison.notes[0] == "stress/small: right could not begin: no dots"


def test_pooling_twice_the_same_changes_no_share() -> None:
    one = evaluation().trials[0].comparisons[1]
    both = pooled((one, one), "both")
    single, twice = figures(one), figures(both)
    assert twice["frames"]["compared"] == 54
    assert twice["depth"]["rmse_median_mm"] == pytest.approx(single["depth"]["rmse_median_mm"])
    assert twice["contacts"]["recall_percent"] == single["contacts"]["recall_percent"]
    assert twice["contacts"]["true"] == 2 * single["contacts"]["true"]


def test_nothing_cannot_be_pooled() -> None:
    with pytest.raises(EvaluationError, match="comparisons in one unit are needed, found none"):
        pooled((), "nothing")
