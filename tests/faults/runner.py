"""Runs hostile inputs in worker processes with limits of memory and time, and counts what became of them."""

import contextlib
import multiprocessing
import os
import resource
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path

TIMEOUT_S, POLL_S = 10.0, 0.2
MAX_GROWTH_BYTES = 2**30
OK, REFUSED, WRONG = "ok", "refused", "wrong"
MAX_SENTENCE = 4000
TIMED_OUT = f"no result within {TIMEOUT_S:g} s"


class WrongResultError(Exception):
    """A result that must not be: without an error, but incomplete or not a number."""


@dataclass(frozen=True, kw_only=True)
class Fuzzer:
    """Inputs of one kind, and what reads them.

    Attributes:
        name: of the kind.
        run: makes the input with a seed in an empty folder, and reads it. It returns when all is well, and
            raises ManytouchError for a refusal in a sentence and WrongResultError for a wrong result; any
            other exception is wrong.
    """

    name: str
    run: Callable[[int, Path], None]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of an input: `OK`, `REFUSED` or `WRONG`, with the sentence or the traceback."""

    fuzzer: str
    seed: int
    kind: str
    text: str = ""


@dataclass
class Worker:
    """A process that runs fuzzers of a module one by one."""

    module: str
    _process: multiprocessing.process.BaseProcess | None = field(default=None)
    _pipe: Connection | None = field(default=None)

    def run(self, name: str, seed: int) -> Outcome:
        """Run one input; a process that hangs or dies is replaced."""
        if self._process is None:
            self._start()
        assert self._pipe is not None
        self._pipe.send((name, seed))
        try:
            if self._has_answer(self._pipe):
                kind, text = self._pipe.recv()
                return Outcome(fuzzer=name, seed=seed, kind=kind, text=text)
            text = TIMED_OUT
        except (EOFError, OSError):
            text = "the process died"
        self.close()
        return Outcome(fuzzer=name, seed=seed, kind=WRONG, text=text)

    def _has_answer(self, pipe: Connection) -> bool:
        """Whether an answer comes in time; time in which the process waits for a processor does not count."""
        assert self._process is not None
        assert self._process.pid is not None
        begin_s, waited_s = time.monotonic(), waiting_s(self._process.pid)
        while not pipe.poll(POLL_S):
            spent_s = time.monotonic() - begin_s - (waiting_s(self._process.pid) - waited_s)
            if spent_s > TIMEOUT_S:
                return False
        return True

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        if self._pipe is not None:
            self._pipe.close()
        self._process = self._pipe = None

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=serve, args=(other, self.module), daemon=True)
        self._process.start()
        other.close()
        assert self._pipe.recv() == "ready"


def serve(pipe: Connection, module: str) -> None:
    """Run inputs until the connection ends, in a process of its own."""
    fuzzers = {fuzzer.name: fuzzer for fuzzer in import_module(module).FUZZERS}
    import_module(module).warm_up()
    with contextlib.suppress(ValueError, OSError):  # not on every system
        limit = address_space() + MAX_GROWTH_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    pipe.send("ready")
    with contextlib.suppress(EOFError, KeyboardInterrupt):
        while True:
            name, seed = pipe.recv()
            with tempfile.TemporaryDirectory() as folder:
                pipe.send(outcome(fuzzers[name], seed, Path(folder)))


def outcome(fuzzer: Fuzzer, seed: int, folder: Path) -> tuple[str, str]:
    """Kind and text of what became of an input."""
    from manytouch.errors import ManytouchError

    reset_peak()
    before = peak_bytes()
    try:
        fuzzer.run(seed, folder)
    except ManytouchError as error:
        sentence = str(error)
        if not sentence.strip() or len(sentence) > MAX_SENTENCE:
            return WRONG, f"no sentence: {sentence[:100]!r} ({len(sentence)} characters)"
        kind, text = REFUSED, sentence
    except BaseException:  # noqa: BLE001 - that is what is looked for
        return WRONG, traceback.format_exc()
    else:
        kind, text = OK, ""
    grown = peak_bytes() - before
    return (WRONG, f"{grown / 1e6:.0f} MB") if grown > MAX_GROWTH_BYTES else (kind, text)


def waiting_s(process: int) -> float:
    """Seconds that the main thread of a process was ready and waited for a processor; 0 where not known."""
    with contextlib.suppress(OSError, IndexError):
        return int(Path(f"/proc/{process}/schedstat").read_text().split()[1]) * 1e-9
    return 0.0


def address_space() -> int:
    """Bytes of the address space in use."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def peak_bytes() -> int:
    """Most memory that was in use since `reset_peak`; 0 where the system does not say."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    return 0


def reset_peak() -> None:
    """Begin to measure the peak of memory."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def run_all(
    module: str, names: Sequence[str], seeds: Iterable[int], *, worker: Worker | None = None
) -> Iterator[Outcome]:
    """Outcomes of all seeds for the named fuzzers of a module, one after the other in one worker.

    A worker that is given is not closed.
    """
    own = worker or Worker(module)
    try:
        for seed in seeds:
            for name in names:
                yield own.run(name, seed)
    finally:
        if worker is None:
            own.close()


def table(outcomes: Sequence[Outcome]) -> str:
    """How many inputs of each kind were tried, refused with a sentence, and wrong."""
    counts = Counter((each.fuzzer, each.kind) for each in outcomes)
    names = list(dict.fromkeys(each.fuzzer for each in outcomes))
    rows = [("input", "tried", "accepted", "refused with a sentence", "wrong")]
    for name in [*names, None]:
        kinds = [
            sum(n for (f, k), n in counts.items() if k == kind and name in (f, None))
            for kind in (OK, REFUSED, WRONG)
        ]
        rows.append((name or "all", str(sum(kinds)), *map(str, kinds)))
    widths = [max(len(row[place]) for row in rows) for place in range(5)]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
