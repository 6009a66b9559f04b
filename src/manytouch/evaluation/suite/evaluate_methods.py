"""The accuracy suite with named methods: cases that are not solved yet are solved, then all are processed."""

from collections.abc import Callable, Sequence
from pathlib import Path

from manytouch.evaluation.suite import runner, solutions
from manytouch.evaluation.suite.cases import Case
from manytouch.evaluation.suite.recordings import FemSimulation
from manytouch.evaluation.suite.workers import RunObserver
from manytouch.session import pipeline_for
from manytouch.simulation.fem.cache import user_cache
from manytouch.sinks.files.summary import parameters, versions


def evaluate_methods(
    cases: Sequence[Case],
    methods: Sequence[str],
    *,
    cache: Path | None = None,
    trial_folder: Path | None = None,
    observer: RunObserver | None = None,
    stop: Callable[[], bool] | None = None,
    processes: int = 1,
) -> runner.Evaluation:
    """Process cases with methods, each with its default parameters.

    Args:
        cases: of the suite.
        methods: their names, of `METHODS`.
        cache: folder of solved cases, to which missing ones are added; None for that of the user.
        trial_folder: folder of finished trials, from which an interrupted run is resumed; None: not stored.
        observer: is notified of each case.
        stop: no case is begun once it returns True.
        processes: cases that are processed in parallel.

    Raises:
        ManytouchError: there is no such method, or a process has died.
    """
    pipelines = {name: pipeline_for(name) for name in methods}
    known = solutions.Solutions(folder=cache or user_cache())
    solutions.solve_missing(cases, known, observer=observer, stop=stop, processes=processes)
    return runner.run_suite(
        cases,
        pipelines,
        FemSimulation(solutions=known),
        settings={
            "parameters": {name: parameters(pipeline) for name, pipeline in pipelines.items()},
            "versions": versions(),
            "processes": processes,
        },
        observer=observer,
        stop=stop,
        processes=processes,
        trial_folder=trial_folder,
    )
