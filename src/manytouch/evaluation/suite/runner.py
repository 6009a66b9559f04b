"""Runs the suite: every case is simulated once and processed with every method."""

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import manytouch
from manytouch.calibration.rest.assumed_sensor import register_rest
from manytouch.errors import ManytouchError
from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluatedRecording, contact_rows
from manytouch.evaluation.evaluated_recordings.in_memory import recording_of_readings, recording_of_truths
from manytouch.evaluation.metrics.comparison import MethodErrors, compare
from manytouch.evaluation.metrics.contacts import contact_figures
from manytouch.evaluation.metrics.depth import depth_figures
from manytouch.evaluation.suite.cases import REST_FRAMES, Case
from manytouch.evaluation.suite.given import given_sensor
from manytouch.evaluation.suite.recordings import CaseSimulation, SimulatedRecording
from manytouch.evaluation.suite.trial_store import SUFFIX, read_comparisons, write_comparisons
from manytouch.evaluation.suite.workers import RunObserver, run_tasks
from manytouch.pipeline import Pipeline
from manytouch.values.arrays import read_only

CONTACT_COLUMNS = (
    *("frame", "id", "x", "y", "depth", "normal_force", "shear_x", "shear_y", "x_std", "y_std"),
    *("depth_std", "force_std", "shear_x_std", "shear_y_std"),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trial:
    """One recording and the errors of each method on it.

    Attributes:
        title: of the recording.
        case: of the suite, or None for the user's own recording.
        comparisons: one for each method.
    """

    title: str
    case: Case | None
    comparisons: tuple[MethodErrors, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Evaluation:
    """The content of a report.

    Attributes:
        title: of the report.
        truth_description: what the truth is, and what is not in it.
        methods: in the order of the tables.
        trials: all recordings.
        warnings: why figures may mean nothing.
        left_out: titles of cases that could not be simulated, and why.
        settings: parameters, versions and whatever else should be known, by method.
        seconds: that the whole took; NaN when it was only compared.
    """

    title: str
    truth_description: str
    methods: tuple[str, ...]
    trials: tuple[Trial, ...]
    warnings: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = float("nan")


def run_suite(
    cases: Sequence[Case],
    methods: Mapping[str, Pipeline],
    simulation: CaseSimulation,
    *,
    settings: Mapping[str, Any],
    observer: RunObserver | None = None,
    stop: Callable[[], bool] | None = None,
    processes: int = 1,
    trial_folder: Path | None = None,
) -> Evaluation:
    """Process cases with every method and compare the results with ground truth.

    Args:
        cases: from `suite.cases`.
        methods: pipelines by the names of their methods.
        simulation: of the cases.
        settings: parameters and versions, which the report shows.
        observer: of the progress.
        stop: called before each case; once it returns True the rest is left out.
        processes: cases that are processed in parallel.
        trial_folder: folder of finished trials, from which an interrupted run is resumed; None: not stored.
    """
    begun_s = time.monotonic()
    left_out = {case.title: reason for case in cases if (reason := simulation.refusal(case)) is not None}
    possible = [case for case in cases if case.title not in left_out]
    if observer is not None:
        observer.begin("reading", len(possible))
        for reason in dict.fromkeys(left_out.values()):
            count = list(left_out.values()).count(reason)
            observer.report(f"left out: {count} {'case' if count == 1 else 'cases'}, since {reason}")
    trials: dict[int, Trial] = {}
    work = partial(load_or_process_case, methods=methods, simulation=simulation, trial_folder=trial_folder)
    for number, trial in run_tasks(work, possible, processes=processes, stop=stop):
        trials[number] = trial
        if observer is not None:
            observer.done(possible[number].title, description(trial))
    left_out |= {
        case.title: "the run was stopped" for number, case in enumerate(possible) if number not in trials
    }
    return Evaluation(
        title="Accuracy suite",
        truth_description=simulation.description,
        methods=tuple(methods),
        trials=tuple(trials[number] for number in sorted(trials)),
        left_out=left_out,
        settings=settings,
        seconds=time.monotonic() - begun_s,
    )


def load_or_process_case(
    case: Case, *, methods: Mapping[str, Pipeline], simulation: CaseSimulation, trial_folder: Path | None
) -> Trial:
    """The trial of a case: the stored one if nothing has changed since, else a new one, which is stored."""
    if trial_folder is None:
        return process_case(case, methods, simulation.simulate(case))
    stages = {name: (p.detect, p.track, p.estimate, p.interpolation) for name, p in methods.items()}
    depends = (code_of_the_package(), repr(case), repr(stages), repr(simulation))
    path = trial_folder / f"{hashlib.sha256(chr(10).join(depends).encode()).hexdigest()[:24]}{SUFFIX}"
    comparisons = read_comparisons(path)
    if comparisons is not None:
        return Trial(title=case.title, case=case, comparisons=comparisons)
    trial = process_case(case, methods, simulation.simulate(case))
    write_comparisons(path, trial.comparisons)
    return trial


@cache
def code_of_the_package() -> str:
    """A hash of every line of manytouch: any of them may change what a method estimates."""
    package = Path(manytouch.__file__).parent
    sources = (path.read_bytes() for path in sorted(package.rglob("*.py")))
    return hashlib.sha256(b"\0".join(sources)).hexdigest()


def process_case(case: Case, methods: Mapping[str, Pipeline], recording: SimulatedRecording) -> Trial:
    """Process a recording with every method, each with the sensor that is given to methods in this case."""
    truth = recording_of_truths(recording.truths, recording.sensor, name=case.title)
    pictures = {frame.index: frame.image for frame in recording.frames}
    comparisons = []
    for method, pipeline in methods.items():
        note: tuple[str, ...] = ()
        try:
            sensor = register_rest(given_sensor(case), recording.frames[:REST_FRAMES])
            for _ in pipeline.run(recording.frames[:2], sensor):
                pass  # compiling and first touches are in no frame's time
            readings = tuple(pipeline.run(recording.frames, sensor))
            estimated = recording_of_readings(readings, sensor, name=case.title, method=method)
        except ManytouchError as error:
            note = (f"{case.title}: {method} could not begin: {error}",)
            estimated = silent(truth, method)
        found = compare(truth, estimated, picture=pictures.get)
        comparisons.append(replace(found, notes=(*note, *found.notes)))
    return Trial(title=case.title, case=case, comparisons=tuple(comparisons))


def silent(truth: EvaluatedRecording, method: str) -> EvaluatedRecording:
    """The recording as a method that estimates nothing has it; it is evaluated like all others."""
    no_contacts = contact_rows({name: np.zeros(0) for name in CONTACT_COLUMNS})
    return replace(
        truth,
        method=method,
        status=("not_begun",) * len(truth.frame),
        centre_px=read_only(np.full(truth.centre_px.shape, np.nan)),
        centre_std_px=read_only(np.full(truth.centre_px.shape, np.nan)),
        depth_mm=read_only(np.full(truth.depth_mm.shape, np.nan)),
        depth_std_mm=read_only(np.full(truth.depth_mm.shape, np.nan)),
        contacts=no_contacts,
    )


def description(trial: Trial) -> str:
    """One line: the main errors of each method on a recording."""
    parts: list[str] = []
    for comparison in trial.comparisons:
        rmse = depth_figures(comparison.depth)["rmse_median_mm"]
        depth = f"depth RMSE {rmse:.3f} {comparison.unit}" if np.isfinite(rmse) else "no depth"
        recall = contact_figures(comparison.contacts)["recall_percent"]
        found = "no contact to find" if np.isnan(recall) else f"{recall:.0f} % of the contacts found"
        parts.append(f"{comparison.method}: {depth}, {found}")
    return "; ".join(parts)
