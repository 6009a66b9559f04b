"""SLURM jobs that work for one batch, from a file of options, through dask-jobqueue."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from manytouch.batch.engines.dask_scheduler import DaskEngine
from manytouch.errors import ManytouchError, MissingExtraError
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
        raise ManytouchError(all_mistakes(f"SLURM options {path}", error)) from None


def job_script(options: SlurmOptions) -> str:
    """The script of each job, which nothing submits.

    Raises:
        MissingExtraError: dask-jobqueue is not installed.
    """
    with _cluster(options) as cluster:
        return str(cluster.job_script())


@contextmanager
def slurm_jobs(options: SlurmOptions) -> Iterator[DaskEngine]:
    """Submit the jobs; they are cancelled at the end of the block.

    Raises:
        MissingExtraError: dask-jobqueue is not installed.
        ManytouchError: sbatch refuses them.
    """
    with _cluster(options) as cluster:
        from distributed import Client

        try:
            cluster.scale(jobs=options.jobs)
            with Client(cluster, set_as_default=False) as client:
                yield DaskEngine(client=client)
        except (RuntimeError, FileNotFoundError) as error:
            raise ManytouchError(
                f"the SLURM jobs could not be submitted ({' '.join(str(error).split())}): check the script "
                "with --dry-run, and that sbatch works on this machine"
            ) from error


@contextmanager
def _cluster(options: SlurmOptions) -> Iterator[Any]:
    try:
        import dask
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise MissingExtraError("a batch on SLURM", "dask-jobqueue", "batch") from None
    given = options.model_dump(exclude={"jobs", "job_script_prologue"}, exclude_none=True)
    threads = [f"export {name}=1" for name in _THREADS]
    dask.config.set({"distributed.scheduler.allowed-failures": ALLOWED_WORKER_DEATHS})
    with SLURMCluster(
        **given, processes=options.cores, job_script_prologue=[*threads, *options.job_script_prologue]
    ) as cluster:
        yield cluster
