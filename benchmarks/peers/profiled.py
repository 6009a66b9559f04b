"""Where manytouch's own frame spends its time, function by function, without a list of functions.

Every function of manytouch, each compiled kernel, and OpenCV's functions are wrapped by a clock while a few
frames run; the time of what they call is taken off. Compiled kernels that call each other count as one.
"""

import sys
import time
import types
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps

import cv2
import numpy as np
from numba.core.dispatcher import Dispatcher
from own import Tracked
from rounds import Footage

STAGES = {
    "estimate_noise": "colour and noise",
    "level_scale": "colour and noise",
    "weights": "colour and noise",
    "reduced": "reduce",
    "resize": "reduce",
    "cvtColor": "reduce",
    "GaussianBlur": "response",
    "_peaks": "maxima",
    "candidates": "maxima",
    "measure_dots": "refine",
    "measure": "refine",
    "find_single_dots": "refine",
    "condition": "condition",
    "build_grid": "assign",
    "identify": "assign and verify",
    "likely_translations": "register",
    "update_state": "assign",
    "undistortPoints": "undistort",
    "ray": "undistort",
    "onto_plane": "undistort",
}
"""Stage of a function; the others go by their package."""

CV2 = ("GaussianBlur", "resize", "cvtColor", "transform", "undistortPoints", "projectPoints", "threshold",
       "connectedComponentsWithStats", "connectedComponentsWithStatsWithAlgorithm", "blur", "boxFilter",
       "sepFilter2D", "pyrDown", "Rodrigues")  # fmt: skip
KERNEL, PYTHON, LIBRARY = "kernel", "python", "opencv"


class Clock:
    """Own time and calls of each wrapped function."""

    def __init__(self) -> None:
        self.own_s: defaultdict[tuple[str, str, str], float] = defaultdict(float)
        self.calls: defaultdict[tuple[str, str, str], int] = defaultdict(int)
        self.inner_s: list[float] = [0.0]

    def around(self, function: Callable[..., object], key: tuple[str, str, str]) -> Callable[..., object]:
        """The same function, timed."""

        @wraps(function, updated=())
        def timed(*args: object, **kwargs: object) -> object:
            self.inner_s.append(0.0)
            begun_s = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                whole_s = time.perf_counter() - begun_s
                self.own_s[key] += whole_s - self.inner_s.pop()
                self.calls[key] += 1
                self.inner_s[-1] += whole_s

        return timed


@contextmanager
def wrapped(clock: Clock) -> Iterator[None]:
    """Wrap functions of modules and methods of classes of manytouch, and OpenCV's; undo it at the end."""
    undo: list[tuple[object, str, object]] = []
    done: dict[int, object] = {}

    def replace_by(owner: object, name: str, function: object, key: tuple[str, str, str]) -> None:
        undo.append((owner, name, function))
        if id(function) not in done:
            done[id(function)] = clock.around(function, key)
        setattr(owner, name, done[id(function)])

    modules = [module for name, module in sys.modules.items() if name.startswith("manytouch.")]
    for module in modules:
        for name, value in list(vars(module).items()):
            home = getattr(value, "__module__", None) or ""
            if not home.startswith("manytouch."):
                continue
            if isinstance(value, Dispatcher):
                replace_by(module, name, value, (KERNEL, home, value.py_func.__name__))
            elif isinstance(value, types.FunctionType):
                replace_by(module, name, value, (PYTHON, home, value.__name__))
            elif isinstance(value, type) and home == module.__name__:
                for label, member in list(vars(value).items()):
                    if isinstance(member, types.FunctionType) and not label.startswith("__i"):
                        replace_by(value, label, member, (PYTHON, home, f"{value.__name__}.{label}"))
    for name in CV2:
        if hasattr(cv2, name):
            replace_by(cv2, name, getattr(cv2, name), (LIBRARY, "cv2", name))
    try:
        yield
    finally:
        for owner, name, function in undo:
            setattr(owner, name, function)


def profile_of(footage: Footage, kind: str, frames: int = 20) -> dict[str, object]:
    """Milliseconds per frame by function and by stage, of a "tracked" frame or one "from nothing"."""
    follow = Tracked(footage.course.sensor)
    first = follow.tracking

    def run(index: int) -> None:
        if kind == "from nothing":
            follow.tracking = first
        follow(footage.frames[index % len(footage.frames)])

    for index in range(3):
        run(index)
    clock = Clock()
    spent_s = []
    with wrapped(clock):
        for index in range(3, 3 + frames):
            begun_s = time.perf_counter()
            run(index)
            spent_s.append(time.perf_counter() - begun_s)
    functions = {
        key: 1e3 * own_s / frames for key, own_s in sorted(clock.own_s.items(), key=lambda item: -item[1])
    }
    stages: defaultdict[str, float] = defaultdict(float)
    for key, own_ms in functions.items():
        stages[_stage_of(key)] += own_ms
    whole_ms = 1e3 * float(np.mean(spent_s))
    return {
        "whole_ms": whole_ms,
        "stages_ms": dict(sorted(stages.items(), key=lambda item: -item[1])),
        "kernels_ms": sum(ms for key, ms in functions.items() if key[0] == KERNEL),
        "opencv_ms": sum(ms for key, ms in functions.items() if key[0] == LIBRARY),
        "python_and_numpy_ms": sum(ms for key, ms in functions.items() if key[0] == PYTHON),
        "functions": [
            {"kind": key[0], "where": key[1], "name": key[2], "ms": ms, "calls": clock.calls[key] / frames}
            for key, ms in functions.items()
        ],
    }


def _stage_of(key: tuple[str, str, str]) -> str:
    """Stage of a function: by its name, else by its package."""
    kind, where, name = key
    plain = name.rsplit(".", maxsplit=1)[-1]
    if plain in STAGES:
        return STAGES[plain]
    package = where.split(".")[1] if "." in where else where
    if package == "geometry":
        return "map" if where.endswith("sampling") else "undistort"
    return package if kind != PYTHON else f"{package}, Python and numpy"


def profile_text(kind: str, profile: dict[str, object]) -> str:
    """The profile as text."""
    lines = [
        f"where a frame {kind} goes: {profile['whole_ms']:.2f} ms under the clock, of it kernels "
        f"{profile['kernels_ms']:.2f}, OpenCV {profile['opencv_ms']:.2f}, "
        f"Python and numpy {profile['python_and_numpy_ms']:.2f}",
        "  by stage:    " + ", ".join(f"{name} {ms:.2f}" for name, ms in profile["stages_ms"].items()),
    ]
    for each in profile["functions"][:16]:
        name = f"{each['where'].removeprefix('manytouch.')}.{each['name']}"
        lines.append(f"  {each['ms']:8.3f} ms  {each['calls']:6.1f} x  {each['kind']:7} {name}")
    return "\n".join(lines)
