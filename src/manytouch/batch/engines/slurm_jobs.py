"""SLURM jobs that work for one batch, from a file of options, through dask-jobqueue."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from manytouch.batch.engines.dask_scheduler import DaskEngine
from manytouch.batch.engines.worker_wait import WorkerWait
from manytouch.errors import ManytouchError, MissingExtraError
from manytouch.values.display.text import count_of
from manytouch.values.sensor_file.sections import all_mistakes
from manytouch.values.sensor_file.toml_file import read_toml

ALLOWED_WORKER_DEATHS = 1
"""Deaths of workers after which dask blames a task; `DaskEngine` then runs it alone."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
Text = Annotated[str, Field(min_length=1)]


class SlurmOptions(BaseModel):
    """Content of an options file; names as in dask-jobqueue, whose defaults hold where a key is absent.

    Attributes:
        jobs: to submit.
        cores: of each job; as many processes, one thread each.
        memory: of each job, such as "16GB".
        walltime: of each job, such as "04:00:00".
        queue, account, interface, local_directory, log_directory, python, shebang: texts for dask-jobqueue.
        job_extra_directives: further `#SBATCH` lines, without that word.
        job_script_prologue: lines before the workers start.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    jobs: Annotated[int, Field(ge=1, le=100_000)]
    cores: Annotated[int, Field(ge=1, le=4096)]
    memory: Text
    walltime: Text
    queue: Text | None = None
    account: Text | None = None
    interface: Text | None = None
    local_directory: Text | None = None
    log_directory: Text | None = None
    python: Text | None = None
    shebang: Text | None = None
    job_extra_directives: list[Text] = Field(default_factory=list)
    job_script_prologue: list[Text] = Field(default_factory=list)


def read_options(path: Path) -> SlurmOptions:
    """Read an options file.

    Raises:
        ManytouchError: it does not exist, or has unknown keys or impossible values; all are listed.
    """
    try:
        return SlurmOptions.model_validate(read_toml(path, "SLURM options", ManytouchError))
    except FileNotFoundError:
        raise ManytouchError(
            f"the options file {path} does not exist: write one with jobs, cores, memory and walltime"
        ) from None
    except ValidationError as error:
        raise ManytouchError(all_mistakes(f"SLURM options {path}", error, SlurmOptions)) from None


def jobs_for(options: SlurmOptions, recordings: int) -> int:
    """Number of jobs for so many recordings: at most `jobs`, and none without a recording for a worker."""
    return min(options.jobs, -(-recordings // options.cores))


def require_sbatch() -> None:
    """Check that jobs can be submitted on this machine.

    Raises:
        ManytouchError: there is no sbatch.
    """
    if shutil.which("sbatch") is None:
        raise ManytouchError(
            "sbatch, which submits SLURM jobs, was not found: run the same command on a login node of a "
            "SLURM cluster, or without --slurm on the processors of this machine; --dry-run prints the script"
        )


def describe_jobs(options: SlurmOptions, recordings: int) -> str:
    """How many jobs there would be for so many recordings, and their script, as text.

    Raises:
        MissingExtraError: dask-jobqueue is not installed.
        ManytouchError: the memory is not a size.
    """
    jobs, script = jobs_for(options, recordings), job_script(options)
    processes = count_of(options.cores, "worker")
    fewer = f" (the file allows {options.jobs}; more would have nothing to do)" if jobs < options.jobs else ""
    return (
        f"by {count_of(jobs, 'job')} of {processes}{fewer}, each with this script\n"
        "The script is an illustration: name of the worker and address of the scheduler are those of a run.\n"
        f"{options.memory} are {memory_GiB(options):.4g} GiB, which SLURM calls G; they are rounded up.\n"
        f"{script}"
    )


def memory_GiB(options: SlurmOptions) -> float:
    """Memory of each job in GiB, the unit that SLURM calls G.

    Raises:
        ManytouchError: it is not a size.
    """
    from dask.utils import parse_bytes

    try:
        return float(parse_bytes(options.memory)) / 2**30
    except ValueError:
        raise ManytouchError(
            f'memory = {options.memory!r} is not a size: expected one such as "16GB" or "16GiB"'
        ) from None


def job_script(options: SlurmOptions) -> str:
    """The script of each job, which nothing submits; its name and the scheduler's address are examples.

    Raises:
        MissingExtraError: dask-jobqueue is not installed.
    """
    with _cluster(options) as cluster:
        return str(cluster.job_script())


@contextmanager
def slurm_jobs(
    options: SlurmOptions,
    recordings: int,
    wait: WorkerWait,
) -> Iterator[DaskEngine]:
    """Submit the jobs; they are cancelled at the end of the block.

    Args:
        options: of the jobs.
        recordings: number of recordings, which limits the number of jobs.
        wait: for their workers.

    Raises:
        MissingExtraError: dask-jobqueue is not installed.
        ManytouchError: sbatch refuses them.
    """
    with _cluster(options) as cluster:
        from distributed import Client

        jobs = jobs_for(options, recordings)
        try:
            cluster.scale(jobs=jobs)
            cluster.sync(_submitted, cluster)
        except (RuntimeError, OSError) as error:
            raise ManytouchError(
                f"the SLURM jobs could not be submitted ({' '.join(str(error).split())}): check the script "
                "with --dry-run, and that sbatch works on this machine"
            ) from error
        wait.notify(f"{count_of(jobs, 'SLURM job')} submitted, each with {count_of(options.cores, 'worker')}")
        with Client(cluster, set_as_default=False) as client:
            yield DaskEngine(client=client, wait=wait)


async def _submitted(cluster: Any) -> None:
    """Wait until all jobs are submitted.

    Raises:
        RuntimeError: sbatch refuses one; dask itself only logs this.
        OSError: sbatch cannot be started.
    """
    from distributed.core import Status

    await cluster
    refused = [job for job in cluster.workers.values() if job.status is Status.created]
    try:
        for job in refused:
            await job
    except (RuntimeError, OSError):
        for job in refused:
            job.status = Status.failed  # without this the cluster cannot be closed
        raise


@contextmanager
def _cluster(options: SlurmOptions) -> Iterator[Any]:
    try:
        import dask
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise MissingExtraError("a batch on SLURM", "dask-jobqueue", "batch") from None
    memory_GiB(options)
    given = options.model_dump(exclude={"jobs", "job_script_prologue"}, exclude_none=True)
    threads = [f"export {name}=1" for name in _THREADS]
    dask.config.set({"distributed.scheduler.allowed-failures": ALLOWED_WORKER_DEATHS})
    with SLURMCluster(
        **given, processes=options.cores, job_script_prologue=[*threads, *options.job_script_prologue]
    ) as cluster:
        yield cluster
