"""Compiles the kernels of a method before a live contact would have to wait for it."""

import hashlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from threading import Thread

import numba
from llvmlite.binding import get_host_cpu_name
from platformdirs import user_cache_path

from manytouch.compilation import kernels_folder
from manytouch.kernels.cache import compiling, is_writable
from manytouch.session.methods import kernels
from manytouch.session.methods.pipelines import PAD
from manytouch.values import Sensor

SOURCES = Path(__file__).parents[1]
STAGES = ("pixels", "contacts")
OWN_KERNELS = {
    "mechanics": "manytouch.mechanics.solver.band_kernels",
    "perimeter": "manytouch.estimation.perimeter.surface_kernels",
    PAD: "manytouch.estimation.pad.patch_kernels",
}
"""A module of compiled functions of a package that only one method needs, or `mechanics` on pads."""
FUNCTIONS = {"mechanics": 57, "perimeter": 44, PAD: 39}
"""About how many functions are compiled for each, for the progress."""
NAMES = {PAD: "mechanics on pads"}
MESSAGE_EVERY_S = 3.0
CODE = "import sys; from manytouch.session.methods.compile_stage import main; main(*sys.argv[1:])"

COMPILED: set[tuple[str, str]] = set()
"""Methods that this process has found compiled, with the folder of the kernels: it does not look again."""

OnMessage = Callable[[str], object]


def warm_up_kernels(method: str, on_message: OnMessage | None = None) -> bool:
    """Compile what a simulated contact needs, unless this has been done with the present sources.

    Frames at rest do not need all kernels; without this a live session would stop until they are compiled,
    at the first contact, and where markers are lost for the first time. Two processes compile, one for
    detection and tracking, one for the contacts. Of several processes that begin at once, one has it
    compiled and the others wait for it.

    Args:
        method: that will be used, or `PAD`.
        on_message: gets the progress; None: it is printed on standard error, since it lasts a minute.

    Returns:
        Whether it was necessary.
    """
    own, found = OWN_KERNELS.get(method), (method, kernels_folder())
    if own is None or found in COMPILED:
        return False
    if is_compiled(method, own):
        COMPILED.add(found)
        return False
    with compiling():
        if is_compiled(method, own):
            return False
        on_message = on_message or _print
        if compile_in_processes(method, on_message):
            name = NAMES.get(method, method)
            on_message(f"compiled for {name}; later runs with this method need not compile")
            with suppress(OSError):
                mark = compiled_mark(method)
                mark.parent.mkdir(parents=True, exist_ok=True)
                mark.touch()
    return True


def warm_up_for(method: str, sensor: Sensor | None, on_message: OnMessage | None = None) -> None:
    """Compile what the frames of a sensor need, or of one that is not known yet."""
    warm_up_kernels(method if sensor is None else compiled_method(method, sensor), on_message)


def compiled_method(method: str, sensor: Sensor) -> str:
    """The method, or `PAD`, whose kernels the frames of a sensor need."""
    is_pad = method == "mechanics" and sensor.sheet is not None and sensor.sheet.boundary == "bonded"
    return PAD if is_pad else method


def compile_in_processes(method: str, on_message: OnMessage) -> bool:
    """Compile each stage in a process of its own.

    Returns:
        Whether all ended well. Otherwise kernels are compiled when they are needed.
    """
    expected, done, printed_s = FUNCTIONS[method], 0, time.monotonic()
    name = NAMES.get(method, method)
    on_message(
        f"compiling about {expected} functions for the method {name}: a minute, on a busy machine several, "
        "once only (each method has functions of its own)"
    )
    with ExitStack() as running:
        processes = [running.enter_context(_compiler(method, stage)) for stage in STAGES]
        for process in processes:
            running.callback(process.kill)
        for _ in _lines(processes):
            done += 1
            if time.monotonic() - printed_s > MESSAGE_EVERY_S:
                printed_s = time.monotonic()
                on_message(f"compiling {done} of {max(expected, done)} for {name}, once only")
        return all(process.wait() == 0 for process in processes)


def _print(sentence: str) -> None:
    sys.stderr.write(f"manytouch: {sentence}\n")
    sys.stderr.flush()


def _compiler(method: str, stage: str) -> "subprocess.Popen[str]":
    surroundings = dict(os.environ)
    if kernels_folder():
        surroundings["NUMBA_CACHE_DIR"] = kernels_folder()
    surroundings["PYTHONPATH"] = os.pathsep.join(sys.path)
    return subprocess.Popen(
        [sys.executable, "-c", CODE, method, stage],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=surroundings,
        text=True,
    )


def _lines(processes: "list[subprocess.Popen[str]]") -> Iterator[str]:
    """What the processes print, as it comes."""
    found: SimpleQueue[str | None] = SimpleQueue()

    def read(process: "subprocess.Popen[str]") -> None:
        assert process.stdout is not None
        for line in process.stdout:
            found.put(line)
        found.put(None)

    for process in processes:
        Thread(target=read, args=(process,), name="manytouch-compiling", daemon=True).start()
    for _ in processes:
        while (line := found.get()) is not None:
            yield line


def compiled_mark(method: str) -> Path:
    """A file that exists once the kernels of a method are compiled, for these sources and this processor.

    It depends on all sources of the package: those that are loaded differ from one program to another.
    """
    stamps = [
        (str(file), found.st_mtime_ns, found.st_size)
        for file in sorted(SOURCES.rglob("*.py"))
        if (found := file.stat())
    ]
    content = repr((method, stamps, kernels_folder(), numba.__version__, sys.version, get_host_cpu_name()))
    digest = hashlib.sha256(content.encode()).hexdigest()[:20]
    return user_cache_path("manytouch") / "compiled" / digest


def is_compiled(method: str, own: str) -> bool:
    """Whether the kernels of a method are on disk; `own` is the module that has its own kernels.

    What other compiled functions call has no machine code of its own: any kernel of its package counts.
    """
    import_module(own)  # methods import it when they need it, and `kernels` lists what is imported
    package = own.rpartition(".")[0]
    if not any(is_cached for name, is_cached in kernels().items() if name.startswith(f"{package}.")):
        return False
    mark = compiled_mark(method)
    return mark.exists() or not is_writable(mark.parent)
