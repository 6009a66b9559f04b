"""Runs the suite: every case played once and read by every method."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from manytouch.calibration.rest import refer
from manytouch.errors import ManytouchError
from manytouch.evaluation.bench import told_sensor
from manytouch.evaluation.cases import REST_FRAMES, Case
from manytouch.evaluation.comparison import Comparison, compare
from manytouch.evaluation.depth import depth_figures
from manytouch.evaluation.live import record_of_readings, record_of_truths
from manytouch.evaluation.record import Record, contact_rows
from manytouch.evaluation.touches import contact_figures
from manytouch.evaluation.twin import Recording, Twin
from manytouch.pipeline import Pipeline
from manytouch.values.arrays import read_only

CONTACT_COLUMNS = (
    *("frame", "id", "x", "y", "depth", "normal_force", "shear_x", "shear_y", "x_std", "y_std"),
    *("depth_std", "force_std", "shear_x_std", "shear_y_std"),
)


@runtime_checkable
class Watch(Protocol):
    """Somebody who follows a run."""

    def begin(self, case_count: int) -> None:
        """So many cases will be played."""

    def say(self, sentence: str) -> None:
        """Something that happened."""

    def done(self, case: Case, sentence: str) -> None:
        """A case has been read by all methods."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trial:
    """One recording and what each method made of it.

    Attributes:
        title: of the recording.
        case: of the suite, or None for a recording of somebody's own.
        comparisons: one for each method.
    """

    title: str
    case: Case | None
    comparisons: tuple[Comparison, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Evaluation:
    """All that a report tells.

    Attributes:
        title: of the report.
        truth_in_words: what the truth is, and what is not in it.
        methods: in the order of the tables.
        trials: all recordings.
        left_out: titles of cases that could not be played, and why.
        settings: parameters, versions and whatever else should be known, by method.
        seconds: that the whole took; NaN when it was only compared.
    """

    title: str
    truth_in_words: str
    methods: tuple[str, ...]
    trials: tuple[Trial, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = float("nan")


def run_suite(
    cases: Sequence[Case],
    methods: Mapping[str, Pipeline],
    twin: Twin,
    *,
    settings: Mapping[str, Any],
    watch: Watch | None = None,
    stop: Callable[[], bool] | None = None,
) -> Evaluation:
    """Play cases and compare what the methods read with what was true.

    Args:
        cases: from `suite.cases`.
        methods: pipelines by the names of their methods.
        twin: who plays the cases.
        settings: for the record.
        watch: told what happens.
        stop: asked after each case; once it says True the rest is left out.
    """
    begun_s = time.monotonic()
    trials: list[Trial] = []
    left_out = {case.title: reason for case in cases if (reason := twin.refusal(case)) is not None}
    playable = [case for case in cases if case.title not in left_out]
    if watch is not None:
        watch.begin(len(playable))
        for reason in dict.fromkeys(left_out.values()):
            count = list(left_out.values()).count(reason)
            watch.say(f"left out: {count} {'case' if count == 1 else 'cases'}, for {reason}")
    for case in playable:
        if stop is not None and stop():
            left_out[case.title] = "the run was stopped"
            continue
        trial = try_case(case, methods, twin.play(case))
        trials.append(trial)
        if watch is not None:
            watch.done(case, in_words(trial))
    return Evaluation(
        title="Accuracy suite",
        truth_in_words=twin.in_words,
        methods=tuple(methods),
        trials=tuple(trials),
        left_out=left_out,
        settings=settings,
        seconds=time.monotonic() - begun_s,
    )


def try_case(case: Case, methods: Mapping[str, Pipeline], recording: Recording) -> Trial:
    """Read a recording with every method, each from the sensor as it is told."""
    truth = record_of_truths(recording.truths, recording.sensor, name=case.title)
    pictures = {frame.index: frame.image for frame in recording.frames}
    comparisons = []
    for method, pipeline in methods.items():
        note: tuple[str, ...] = ()
        try:
            sensor = refer(told_sensor(case), recording.frames[:REST_FRAMES])
            for _ in pipeline.run(recording.frames[:2], sensor):
                pass  # compiling and first touches are in no frame's time
            readings = tuple(pipeline.run(recording.frames, sensor))
            estimated = record_of_readings(readings, sensor, name=case.title, method=method)
        except ManytouchError as error:
            note = (f"{case.title}: {method} could not begin: {error}",)
            estimated = silent(truth, method)
        found = compare(truth, estimated, picture=pictures.get)
        comparisons.append(replace(found, notes=(*note, *found.notes)))
    return Trial(title=case.title, case=case, comparisons=tuple(comparisons))


def silent(truth: Record, method: str) -> Record:
    """What a method says that says nothing: it is measured like all others."""
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


def in_words(trial: Trial) -> str:
    """One line: what each method made of a recording."""
    parts = []
    for comparison in trial.comparisons:
        rmse = depth_figures(comparison.depth)["rmse_median_mm"]
        depth = f"depth RMSE {rmse:.3f} {comparison.unit}" if np.isfinite(rmse) else "no depth"
        recall = contact_figures(comparison.contacts)["recall_percent"]
        parts.append(f"{comparison.method}: {depth}, {recall:.0f} % of the contacts found")
    return "; ".join(parts)
