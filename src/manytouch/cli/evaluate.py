"""`manytouch evaluate`: how wrong are results, or the methods?"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import CycloptsError, Parameter

from manytouch.cli import options

if TYPE_CHECKING:
    from manytouch.evaluation.cases import Case
    from manytouch.evaluation.runner import Evaluation

Group = Literal["nominal", "separation", "stress"]


def evaluate(
    folders: Annotated[
        list[Path] | None,
        Parameter(
            name="RESULT_DIR TRUTH_DIR",
            negative=(),
            help="What manytouch process wrote, and the truth in the same columns. "
            "Without the two the built-in accuracy suite is run.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[Path, Parameter(negative=(), help="Folder for report.html and report.json.")],
    quick: Annotated[
        bool, Parameter(negative=(), help="Only a dozen cases of the suite, in about two minutes.")
    ] = False,
    method: Annotated[
        list[options.Method] | None,
        Parameter(name="--method", negative=(), help="Run only this method; may be repeated."),
    ] = None,
    group: Annotated[
        list[Group] | None,
        Parameter(name="--group", negative=(), help="Run only this group of cases; may be repeated."),
    ] = None,
    tuning: Annotated[
        bool, Parameter(negative=(), help="Leave out the half of the cases that is held out of tuning.")
    ] = False,
) -> int:
    """Compare results with the truth: dots, depth, contacts, forces, separation, uncertainty, latency.

    Writes report.html, one page that needs nothing else, and the same figures as report.json.

    Example: manytouch evaluate results/press simulated/truth --out report

    Without folders every method is run on the accuracy suite, which is simulated: manytouch evaluate
    --quick --out report
    """
    from manytouch.cli.console import Reporter
    from manytouch.evaluation.report import require_packages, write_report

    given = folders or []
    if len(given) not in {0, 2}:
        raise CycloptsError(
            msg=f"evaluate takes both RESULT_DIR and TRUTH_DIR or neither, found {len(given)} folder(s)"
        )
    if given and (quick or method or group or tuning):
        raise CycloptsError(msg="--quick, --method, --group and --tuning are for the suite, without folders")
    require_packages()
    reporter = Reporter(bar=False)
    if given:
        from manytouch.evaluation.own import evaluate_folders

        evaluation = evaluate_folders(given[0], given[1])
    else:
        evaluation = _suite(quick=quick, methods=method, groups=group, tuning=tuning)
        if not evaluation.trials:
            reporter.say("nothing was measured, so there is no report")
            return 0
    page = write_report(evaluation, out)
    for sentence in _results_in_words(evaluation):
        reporter.say(sentence)
    reporter.say(f"report in {page}")
    return 0


def _suite(
    *,
    quick: bool,
    methods: list[options.Method] | None,
    groups: list[Group] | None,
    tuning: bool,
) -> "Evaluation":
    from manytouch.cli.stopping import Stop
    from manytouch.evaluation.cases import GROUPS
    from manytouch.evaluation.runner import run_suite
    from manytouch.evaluation.suite import cases
    from manytouch.evaluation.twin import PlateTwin
    from manytouch.session import METHODS, pipeline_for
    from manytouch.sinks.summary import parameters, versions

    pipelines = {name: pipeline_for(name) for name in dict.fromkeys(methods or METHODS)}
    chosen = cases(tuple(groups or GROUPS), quick=quick, tuning=tuning)
    twin = PlateTwin()
    settings = {
        "parameters": {name: parameters(pipeline) for name, pipeline in pipelines.items()},
        "versions": versions(),
    }
    with Stop() as stop, _Progress() as progress:
        progress.say(
            f"accuracy suite: {len(chosen)} cases on the {twin.name}, read by {', '.join(pipelines)}"
        )
        return run_suite(chosen, pipelines, twin, settings=settings, watch=progress, stop=stop)


class _Progress:
    """A bar on a terminal; a line for each case everywhere."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        self._console = Console(highlight=False, soft_wrap=True)
        self._bar = Progress(
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("cases", total=None)
        self._count = self._total = 0

    def __enter__(self) -> "_Progress":
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self, case_count: int) -> None:
        self._total = case_count
        self._bar.update(self._task, total=case_count)

    def say(self, sentence: str) -> None:
        self._console.print(sentence, markup=False)

    def done(self, case: "Case", sentence: str) -> None:
        self._count += 1
        self._bar.advance(self._task)
        self.say(f"  {self._count} of {self._total}  {case.title}: {sentence}")


def _results_in_words(evaluation: "Evaluation") -> list[str]:
    """One line per method, of all recordings."""
    from manytouch.evaluation.contents import in_short

    return [f"{method}: {in_short(evaluation, method)}" for method in evaluation.methods]
