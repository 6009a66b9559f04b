"""How batches scale: recordings per second on worker processes and on dask, and the cost of a task.

    python benchmarks/bench_batch.py [--recordings 200] [--seconds 10] [--workers 1,2] [--tasks 100000]
                                     [--dask]

Recordings are links to one simulated recording of 640 x 480 px at 25 frames per second. The cost of a task is
measured with tasks that do nothing. The figures of docs/scale.md are from this program.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np

from manytouch.batch.engines.dask_scheduler import DaskEngine
from manytouch.batch.engines.local_processes import LocalProcesses
from manytouch.batch.inputs import tasks_of
from manytouch.batch.result_tables import write_result_tables
from manytouch.batch.run_batch import plan, run_batch
from manytouch.batch.settings import settings_for
from manytouch.batch.storage import store_at
from manytouch.batch.tasks import Engine, Outcome, Task, TaskState
from manytouch.session import Request
from manytouch.sources.simulated import simulated_source

FPS = 25.0


def nothing(task: Task, *, stop: Callable[[], bool] | None = None) -> Outcome:
    """A recording that takes no time."""
    return Outcome(task=task, state=TaskState.COMPUTED)


def never() -> bool:
    return False


class Quiet:
    """An observer that prints failures only."""

    def on_message(self, sentence: str) -> None:
        print(sentence)

    def on_begin(self, count: int) -> None:
        pass

    def on_outcome(self, outcome: Outcome) -> None:
        if outcome.state is TaskState.FAILED:
            print(f"{outcome.task.name}: {outcome.reason}")


def simulated_recording(path: Path, seconds: float) -> Path:
    """Several fingers on a simulated sheet, as a Motion JPEG video of 640 x 480 px."""
    frames = round(seconds * FPS)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), FPS, (640, 480))
    for number, frame in enumerate(simulated_source("", width_px=640, fps=FPS)):
        if number == frames:
            break
        assert frame.image is not None
        image = np.asarray(frame.image)
        grown = np.full((480, 640), int(np.median(image)), np.uint8)
        grown[: image.shape[0]] = image[:480] if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        writer.write(cv2.cvtColor(grown, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def engines(workers: Iterable[int], with_dask: bool) -> Iterator[tuple[str, int, Engine]]:
    """Engines with their names and numbers of workers."""
    for count in workers:
        yield f"{count} processes", count, LocalProcesses(processes=count)
    if with_dask:
        from distributed import Client, LocalCluster

        count = max(workers)
        with (
            LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):
            yield f"dask, {count} workers", count, DaskEngine(client=client)


def cpu_s() -> float:
    """Processor time of this process and of the workers that have ended."""
    found = os.times()
    return found.user + found.system + found.children_user + found.children_system


def bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def measure_recordings(folder: Path, options: argparse.Namespace, counts: list[int]) -> None:
    one = simulated_recording(folder / "one.avi", options.seconds)
    (folder / "in").mkdir()
    for number in range(options.recordings):
        os.link(one, folder / "in" / f"r{number:04d}.avi")
    tasks = tasks_of([str(folder / "in")])
    print(f"{len(tasks)} recordings of {options.seconds:g} s, {one.stat().st_size / 1e6:.2f} MB each")
    alone_s = None
    for name, count, engine in engines(counts, options.dask):
        out = folder / f"out-{name.replace(' ', '-')}"
        settings = settings_for(str(out), Request())
        run_batch(tasks[:count], settings, engine, observer=Quiet(), stop=never)  # start, compile
        begun_s, begun_cpu_s = time.perf_counter(), cpu_s()
        report = run_batch(tasks[count:], settings, engine, observer=Quiet(), stop=never)
        elapsed_s, used_s = time.perf_counter() - begun_s, cpu_s() - begun_cpu_s
        per_s = report.computed / elapsed_s
        alone_s = alone_s or per_s / count
        print(
            f"{name}: {per_s:.3f} recordings and {per_s * options.seconds * FPS:.0f} frames per second; "
            f"{used_s / report.computed:.2f} s of a processor each (0 on dask, whose workers go on)"
        )
        written_MB = bytes_in(out) / len(tasks) / 1e6
        print(f"  efficiency {per_s / (alone_s * count):.2f}, {written_MB:.2f} MB written each")
        begun_s = time.perf_counter()
        found = sum(1 for _ in plan(tasks, settings))
        print(f"  plan of unchanged recordings: {1e3 * (time.perf_counter() - begun_s) / found:.2f} ms each")
        store = store_at(str(out))
        begun_s = time.perf_counter()
        write_result_tables(store, store.names(), {}, "results.parquet", "contacts.parquet")
        print(f"  tables: {1e3 * (time.perf_counter() - begun_s) / len(tasks):.2f} ms per recording")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--tasks", type=int, default=100_000)
    parser.add_argument("--dask", action="store_true")
    options = parser.parse_args()
    counts = [int(word) for word in options.workers.split(",")]
    if options.tasks:
        tasks = [Task(name=str(number), input="none") for number in range(options.tasks)]
        for name, _, engine in engines(counts, options.dask):
            list(engine.run(nothing, tasks[:20], never))
            begun_s = time.perf_counter()
            done = sum(1 for _ in engine.run(nothing, tasks, never))
            each_ms = 1e3 * (time.perf_counter() - begun_s) / done
            print(f"{name}: {done} tasks that do nothing, {each_ms:.3f} ms each")
    if options.recordings:
        with tempfile.TemporaryDirectory() as folder:
            measure_recordings(Path(folder), options, counts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
