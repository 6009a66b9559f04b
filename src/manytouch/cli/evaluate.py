"""`manytouch evaluate`: errors of results, or of the methods, against ground truth."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from cyclopts import Parameter, validators

from manytouch.cli.terminal import options
from manytouch.cli.terminal.failures import usage_error

if TYPE_CHECKING:
    from manytouch.evaluation.suite.cases import Case
    from manytouch.evaluation.suite.runner import Evaluation

Group = Literal[
    "nominal",
    "separation",
    "stress",
    "varied",
    "drawn",
    "calibrated",
    "pads",
    "pads_nominal",
    "pads_calibrated",
    "pads_calculix",
]
GROUPS: tuple[Group, ...] = get_args(Group)


def evaluate(
    folders: Annotated[
        list[Path] | None,
        Parameter(
            name="RESULT_DIR TRUTH_DIR",
            negative=(),
            help="Results of manytouch process, and ground truth in the same columns. "
            "Without them the accuracy suite is run.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[Path, options.folder("Folder for report.html and report.json.")],
    quick: Annotated[
        bool, Parameter(negative=(), help="Run only 36 cases of the suite (some minutes).")
    ] = False,
    method: Annotated[
        list[options.Method] | None,
        Parameter(name="--method", negative=(), help="Run only this method; repeatable."),
    ] = None,
    group: Annotated[
        list[Group] | None,
        Parameter(name="--group", negative=(), help="Run only this group of cases; repeatable."),
    ] = None,
    tuning: Annotated[
        bool, Parameter(negative=(), help="Omit the cases that are reserved for validation.")
    ] = False,
    paper: Annotated[
        bool,
        Parameter(
            negative=(),
            help="Only repeat the experiments of the published paper (material, marker spacing, Table 3, "
            "frame rate); writes paper.html and paper.json.",
        ),
    ] = False,
    cache: Annotated[
        Path | None,
        Parameter(
            negative=(),
            help="Folder of solved cases; missing ones are solved, which takes an hour or two for all. "
            "[default: the cache of the user]",
            show_default=False,
        ),
    ] = None,
    processes: Annotated[
        int,
        Parameter(
            negative=(),
            validator=validators.Number(gte=1),
            help="Number of cases that are processed in parallel.",
        ),
    ] = 2,
) -> int:
    """Compare results with ground truth: dots, depth, contacts, forces, two-point resolution, latency.

    Writes report.html, a single self-contained page, and the same figures as
    report.json.

    Example: manytouch evaluate results/press simulated/truth --out report

    Without folders every method is run on the simulated accuracy suite:
    manytouch evaluate --quick --out report. An interrupted run is continued by the
    same command.
    """
    from manytouch.cli.terminal.console import Reporter
    from manytouch.evaluation.report.page import require_packages, write_report
    from manytouch.sinks.files.atomic_output import check_writable

    given = folders or []
    if len(given) not in {0, 2}:
        raise usage_error(
            "evaluate",
            f"specify both RESULT_DIR and TRUTH_DIR or neither, found {len(given)} folder(s)",
        )
    if given and (quick or method or group or tuning or cache or paper):
        raise usage_error(
            "evaluate",
            "--quick, --method, --group, --tuning, --paper and --cache are for the suite: omit the folders",
        )
    if paper and (quick or group or tuning):
        raise usage_error("evaluate", "--paper does not run the suite: omit --quick, --group and --tuning")
    require_packages()
    check_writable(out)  # before what may be hours of work
    reporter = Reporter(bar=False)
    if paper:
        return _paper(method, cache=cache, processes=processes, out=out)
    trial_folder = out / ".trials"
    chosen: tuple[Case, ...] = ()
    if given:
        from manytouch.evaluation.compare_folders import evaluate_folders

        evaluation = evaluate_folders(given[0], given[1])
    else:
        from manytouch.evaluation.suite.suite import cases

        chosen = cases(tuple(group or GROUPS), quick=quick, tuning=tuning)
        evaluation = _suite(chosen, method, cache=cache, processes=processes, trial_folder=trial_folder)
        if not evaluation.trials:
            reporter.print("no case was completed, so there is no report")
            return 0
    page = write_report(evaluation, out)
    done = len(evaluation.trials) + len(evaluation.left_out)
    is_stopped = not given and done < len(chosen)
    if not is_stopped:
        shutil.rmtree(trial_folder, ignore_errors=True)
    for sentence in _describe_results(evaluation):
        reporter.print(sentence)
    reporter.print(f"report in {page}")
    if is_stopped:
        reporter.print(
            f"stopped: the report is of {done} of {len(chosen)} cases; run the same command again to continue"
        )
    return 0


def _paper(methods: list[options.Method] | None, *, cache: Path | None, processes: int, out: Path) -> int:
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.evaluation.published.page import experiments, row, write_page
    from manytouch.session import METHODS, pipeline_for
    from manytouch.simulation.fem.cache import user_cache

    pipelines = {name: pipeline_for(name) for name in dict.fromkeys(methods or METHODS)}
    with StopOnSignal() as stop, _Progress() as progress:
        progress.report("experiments of the paper: material, marker spacing, positions, speed")
        found = experiments(
            pipelines, cache or user_cache(), observer=progress, stop=stop, processes=processes
        )
        if found is None:
            progress.report("stopped without a page; run the same command again to continue")
            return 0
        for name, presses in found.presses.items():
            first_mm, second_mm, depth_mm = row(presses)
            progress.report(
                f"  Table 3, {name}: places {first_mm:.2f} and {second_mm:.2f} mm, depth {depth_mm:.2f} mm"
            )
        for one in found.formulas:
            progress.report(
                f"  equations 11 to 13, {one.formula}: depth RMSE {one.rmse_mm:.2f} mm, "
                f"deepest point {100 * one.excess:+.0f} %"
            )
        for name in dict.fromkeys(stall.method for stall in found.stalls):
            mine = [stall for stall in found.stalls if stall.method == name]
            lossless = max((stall.motion_px for stall in mine if stall.lost == 0), default=0.0)
            progress.report(
                f"  fast motion, {name}: up to {lossless:.1f} px per frame without loss; at "
                f"{mine[-1].motion_px:.1f} px at most {mine[-1].lost} markers lost, every frame has a reading"
            )
        for words, fps in found.speed.frames_per_second.items():
            progress.report(f"  method of the paper, {words}: {fps:.2f} frames per second")
        progress.report(f"  page in {write_page(found, out)}")
    return 0


def _suite(
    chosen: "tuple[Case, ...]",
    methods: list[options.Method] | None,
    *,
    cache: Path | None,
    processes: int,
    trial_folder: Path,
) -> "Evaluation":
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.evaluation.suite.evaluate_methods import evaluate_methods
    from manytouch.session import METHODS

    names = tuple(dict.fromkeys(methods or METHODS))
    with StopOnSignal() as stop, _Progress() as progress:
        progress.report(f"accuracy suite: {len(chosen)} cases, methods {', '.join(names)}")
        return evaluate_methods(
            chosen,
            names,
            cache=cache,
            trial_folder=trial_folder,
            observer=progress,
            stop=stop,
            processes=processes,
        )


class _Progress:
    """Prints a line for each case, and on a terminal a progress bar."""

    def __init__(self) -> None:
        from rich.console import Console

        from manytouch.cli.terminal.console import progress_bar

        self._console = Console(highlight=False, soft_wrap=True)
        self._bar = progress_bar(self._console)
        self._task = self._bar.add_task("cases", total=None)
        self._work, self._count, self._total = "", 0, 0

    def __enter__(self) -> "_Progress":
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def begin(self, work: str, count: int) -> None:
        self._work, self._count, self._total = work, 0, count
        self._bar.reset(self._task, total=count, description=work)

    def report(self, sentence: str) -> None:
        self._console.print(sentence, markup=False)

    def done(self, title: str, sentence: str) -> None:
        self._count += 1
        self._bar.advance(self._task)
        self.report(f"  {self._work} {self._count} of {self._total}  {title}: {sentence}")


def _describe_results(evaluation: "Evaluation") -> list[str]:
    """A line or two per method, of all recordings; then figures of groups with their goals."""
    from manytouch.evaluation.report.goals import goal_lines
    from manytouch.evaluation.report.pad_goals import goal_sentences
    from manytouch.evaluation.report.report_data import forces_in_short, in_short

    lines = []
    for method in evaluation.methods:
        lines.append(f"{method}: {in_short(evaluation, method)}")
        if (forces := forces_in_short(evaluation, method)) is not None:
            lines.append(f"{method}, forces: {forces}")
    warnings = [f"warning: {sentence}" for sentence in evaluation.warnings]
    return [*lines, *goal_lines(evaluation), *goal_sentences(evaluation), *warnings]
