"""`manytouch batch`: many recordings, of which only those that are missing or changed are processed."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, Token, validators

from manytouch.cli.terminal import method_options, options
from manytouch.cli.terminal.failures import usage_error

if TYPE_CHECKING:
    from manytouch.batch.engines.worker_wait import WorkerWait
    from manytouch.batch.settings import Settings
    from manytouch.batch.tasks import Engine, Task


def _shard(_: Any, tokens: Sequence[Token]) -> tuple[int, int]:
    """Number of a shard, from 0, and the number of shards, of a text I/N."""
    text = tokens[0].value
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 0 <= int(number) <= int(count) and int(count) > 0):
        raise ValueError(f"expected I/N with I from 0 to N-1 (or 1 to N), found {text!r}")
    return int(number) % int(count), int(count)


def batch(
    inputs: Annotated[
        list[str] | None,
        Parameter(
            name="INPUT",
            negative=(),
            help="Recordings, folders of them, patterns, text lists (.txt), s3://, gs://, https:// URLs.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[str, Parameter(metavar="DIR", help="Folder or s3://, gs:// prefix for the results.")],
    sensor: options.SensorFile = None,
    method: options.MethodName = None,
    surface: options.WithSurface = False,
    annotate: options.Annotate = False,
    pitch_mm: options.PitchMm = None,
    hfov_deg: options.HfovDeg = None,
    roi: options.RoiPx = None,
    fps: options.Fps = None,
    workers: Annotated[
        int | None,
        Parameter(
            validator=validators.Number(gte=1, lte=4096),
            help="Processes of this machine, one thread each. [default: one per processor]",
        ),
    ] = None,
    memory_GB: Annotated[
        float | None,
        Parameter(
            name="--memory-GB",
            converter=options.positive("a size in GB"),
            n_tokens=1,
            help="Memory of one worker; one that exceeds it is ended. [default: its share of 90 %]",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        Parameter(metavar="URL", help="Run on this dask.distributed scheduler, such as tcp://host:8786."),
    ] = None,
    slurm: Annotated[
        Path | None,
        Parameter(metavar="FILE", negative=(), help="Start SLURM jobs as this file (TOML) describes them."),
    ] = None,
    shard: Annotated[
        Any,
        Parameter(
            metavar="I/N",
            converter=_shard,
            n_tokens=1,
            help="Only every N-th recording, from number I: 0 to N-1, or 1 to N, where N/N is 0/N.",
        ),
    ] = None,
    wait_h: Annotated[
        float | None,
        Parameter(
            metavar="HOURS",
            converter=options.positive("a time in hours"),
            n_tokens=1,
            help="Fail after so long without any worker of a scheduler or of SLURM. [default: 24]",
        ),
    ] = None,
    merge: Annotated[bool, options.switch("Join the tables of all shards in DIR; process nothing.")] = False,
    verify: Annotated[
        bool, options.switch("Compare inputs by their bytes, also where size and time are unchanged.")
    ] = False,
    dry_run: Annotated[
        bool, options.switch("Print what would be processed and why, and the SLURM job; process nothing.")
    ] = False,
    interpolation: method_options.WithInterpolation = method_options.InterpolationOptions(),  # noqa: B008 - immutable
    paper: method_options.Paper = method_options.PaperOptions(),  # noqa: B008 - immutable
) -> int:
    """Process many recordings, and gather their contacts in two tables.

    The results are those of manytouch process. What is complete and unchanged is
    left alone, so that the same command continues after an interruption. A
    recording that fails is listed in failures.csv and does not stop the others.
    DIR gets results.parquet, a line per recording, and contacts.parquet.

    Example: manytouch batch "day1/*.mp4" --out results
    """
    options.refuse_two_scales("batch", sensor, pitch_mm, hfov_deg)
    _require_one_engine(scheduler, slurm, is_shard=shard is not None, waits=wait_h is not None)
    if merge == bool(inputs):
        raise usage_error("batch", "give inputs, or --merge without inputs")
    parameters = interpolation.parameters("batch", method) | paper.parameters("batch", method)
    if merge:
        from manytouch.batch.run_batch import merge as merge_shards

        print(f"tables of {merge_shards(out)} shards joined in {out}")
        return 0
    from manytouch.batch.inputs import absolute, shard_of, tasks_of
    from manytouch.batch.remote_files import is_remote
    from manytouch.batch.settings import settings_for
    from manytouch.session import Request
    from manytouch.sinks.files.atomic_output import check_writable
    from manytouch.values.sensor_file.read import load_sensor

    if not is_remote(out):
        check_writable(Path(out))
    tasks = shard_of(tasks_of(inputs or ()), shard)
    settings = settings_for(
        out,
        Request(
            sensor=None if sensor is None else load_sensor(sensor),
            method=method,
            pitch_mm=pitch_mm,
            hfov_deg=hfov_deg,
            roi_px=roi,
            fps=fps,
            parameters=parameters,
        ),
        surface=surface,
        annotate=annotate,
        is_verifying=verify,
    )
    if scheduler is not None or slurm is not None:
        tasks = [replace(task, input=absolute(task.input)) for task in tasks]
        settings = replace(settings, out=absolute(out))
    if dry_run:
        return _print_plan(tasks, settings, slurm)
    from manytouch.batch.engines.worker_wait import LONGEST_WAIT_H, WorkerWait
    from manytouch.batch.failures import describe_failures, shard_file
    from manytouch.batch.run_batch import run_batch
    from manytouch.cli.terminal.batch_progress import BatchProgress
    from manytouch.cli.terminal.interrupt import StopOnSignal
    from manytouch.errors import ManytouchError

    with StopOnSignal() as stop, BatchProgress() as progress:
        wait = WorkerWait(notify=progress.on_message, longest_h=wait_h or LONGEST_WAIT_H)
        with _engine(
            tasks,
            settings,
            wait,
            workers=workers,
            memory_GB=memory_GB,
            scheduler=scheduler,
            slurm=slurm,
        ) as engine:
            report = run_batch(tasks, settings, engine, observer=progress, stop=stop, shard=shard)
        progress.finish(report, settings.out)
    if report.failed:
        table = f"{settings.out.rstrip('/')}/{shard_file('failures', '.csv', shard)}"
        raise ManytouchError(describe_failures(report.failed.values(), len(tasks), table))
    return 0


def _require_one_engine(scheduler: str | None, slurm: Path | None, *, is_shard: bool, waits: bool) -> None:
    """Check that the options name at most one engine, and only options that it has.

    Raises:
        CycloptsError: they do not.
    """
    if scheduler is not None and slurm is not None:
        raise usage_error("batch", "--scheduler and --slurm exclude each other")
    if slurm is not None and is_shard:
        raise usage_error(
            "batch",
            "--slurm and --shard exclude each other: --slurm starts the jobs of one batch itself, --shard is "
            "for job arrays whose tasks call manytouch",
        )
    if waits and scheduler is None and slurm is None:
        raise usage_error("batch", "--wait-h needs --scheduler or --slurm: other batches wait for no worker")


@contextmanager
def _engine(
    tasks: "Sequence[Task]",
    settings: "Settings",
    wait: "WorkerWait",
    *,
    workers: int | None,
    memory_GB: float | None,
    scheduler: str | None,
    slurm: Path | None,
) -> Iterator["Engine"]:
    """What runs the tasks: a dask scheduler, SLURM jobs, or processes of this machine.

    Where SLURM has nothing to do, no job is started.
    """
    if scheduler is not None:
        from manytouch.batch.engines.dask_scheduler import connect

        yield connect(scheduler, wait)
        return
    if slurm is not None:
        from manytouch.batch.engines.slurm_jobs import read_options, require_sbatch, slurm_jobs

        found = read_options(slurm)
        require_sbatch()
        if recordings := len(_to_do(tasks, settings)):
            with slurm_jobs(found, recordings, wait) as engine:
                yield engine
            return
    from manytouch.batch.engines.local_processes import LocalProcesses, memory_per_worker, processors

    processes = max(min(workers or processors(), len(tasks)), 1)
    limit = memory_per_worker(processes) if memory_GB is None else int(memory_GB * 1e9)
    yield LocalProcesses(processes=processes, memory_bytes=limit)


def _to_do(tasks: "Sequence[Task]", settings: "Settings") -> "list[Task]":
    """The tasks whose results are missing or changed."""
    from manytouch.batch.run_batch import plan
    from manytouch.batch.tasks import Task

    return [each for each in plan(tasks, settings) if isinstance(each, Task)]


def _print_plan(tasks: "Sequence[Task]", settings: "Settings", slurm: Path | None) -> int:
    """Print what would be processed; returns the exit status."""
    from manytouch.values.display.text import count_of

    to_do = _to_do(tasks, settings)
    for task in to_do:
        print(f"{task.name}: {task.input} ({task.reason})")
    print(f"{len(to_do)} of {count_of(len(tasks), 'recording')} would be processed")
    if slurm is not None:
        from manytouch.batch.engines.slurm_jobs import describe_jobs, read_options

        print(describe_jobs(read_options(slurm), len(to_do)))
    return 0
