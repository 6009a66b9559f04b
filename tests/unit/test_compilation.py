"""Compiled functions: their results do not depend on whether they come from the cache."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest
from llvmlite.binding import Linkage
from numba.core import types
from numba.core.compiler import Flags
from numba.core.cpu import CPUContext
from numba.core.targetconfig import TargetConfig

from manytouch.compilation import REORDER, THREADS, in_threads, kernel
from manytouch.kernels import libraries
from manytouch.kernels.libraries import PartLibrary, bind_calls_within_modules, compile_parts_without_code
from manytouch.kernels.shortcuts import use_shortcuts


def replaceable_functions(caller: Callable[..., float]) -> list[str]:
    """Names of the functions in the machine code of a compiled function that another module may replace."""
    (compiled,) = caller.overloads.values()
    return [
        function.name
        for function in compiled.library._final_module.functions
        if not function.is_declaration
        and function.linkage == Linkage.linkonce_odr
        and not function.name.startswith("NRT_")
    ]


def compiled_pair() -> Callable[..., float]:
    """A function that calls another one, which is too large to be inlined."""

    def inner(values: np.ndarray, power: int) -> float:
        total = 0.0
        for place in range(len(values)):
            for other in range(place):
                step = values[place] - power * values[other]
                total += np.exp(-step * step) * np.sin(step) + np.sqrt(np.abs(step)) / (1.0 + total)
        for place in range(len(values) - 2):
            total += values[place] * np.cos(values[place + 1]) * np.log(1.0 + np.abs(values[place + 2]))
        return total

    def outer(values: np.ndarray) -> float:
        return inner(values, 2) + 3.0 * inner(values[1:], 3) + inner(values[::2], 5)

    inner.__module__ = outer.__module__ = "manytouch.probe"
    inner = kernel(cache=False, fastmath=REORDER)(inner)
    return kernel(cache=False, fastmath=REORDER)(outer)


def test_calls_are_bound_within_the_machine_code_of_a_function(monkeypatch: pytest.MonkeyPatch) -> None:
    assert bind_calls_within_modules()
    bound = compiled_pair()
    values = np.linspace(0.0, 1.0, 7)
    result = bound(values)
    assert replaceable_functions(bound) == []
    monkeypatch.setattr(libraries, "bind_calls", lambda _: None)
    free = compiled_pair()
    assert free(values) == pytest.approx(result)
    assert replaceable_functions(free), "the test shows nothing: the inner function was inlined"


def test_what_only_compiled_functions_call_has_no_machine_code() -> None:
    assert compile_parts_without_code()
    outer = compiled_pair()
    outer(np.linspace(0.0, 1.0, 7))
    inner = dict(zip(outer.py_func.__code__.co_freevars, outer.py_func.__closure__, strict=True))["inner"]
    assert not inner.cell_contents.overloads, "it was compiled for Python too"
    parts = inner.cell_contents.part().overloads.values()
    assert parts
    for part in parts:
        assert isinstance(part.library, PartLibrary)
        assert part.library.get_pointer_to_function(part.fndesc.llvm_func_name) == 0


def test_a_part_can_be_called_by_python_all_the_same() -> None:
    outer = compiled_pair()
    values = np.linspace(0.0, 1.0, 7)
    inner = dict(zip(outer.py_func.__code__.co_freevars, outer.py_func.__closure__, strict=True))["inner"]
    called = inner.cell_contents
    total = outer(values)
    parts = called(values, 2) + 3.0 * called(values[1:], 3) + called(values[::2], 5)
    assert parts == pytest.approx(total, rel=1e-13)


def test_errors_of_parts_reach_python() -> None:
    def inner(value: int) -> int:
        if value < 0:
            raise ValueError("a negative value")
        return value

    def outer(value: int) -> int:
        return inner(value) + 1

    inner.__module__ = outer.__module__ = "manytouch.probe"
    inner = kernel(cache=False)(inner)
    outer = kernel(cache=False)(outer)
    assert outer(2) == 3
    with pytest.raises(ValueError, match="a negative value"):
        outer(-1)


def test_flags_are_compared_as_numba_does() -> None:
    plain, other, same = (Flags() for _ in range(3))
    other.fastmath = True
    same.fastmath = False
    for shortcut in (nullcontext(), use_shortcuts()):
        with shortcut:
            assert plain != other
            assert plain == same, "a value that equals the default"
            assert plain != "flags"
            assert hash(plain) == hash(same)


def test_shortcuts_end_with_the_compilation() -> None:
    before = types.BaseFunction.get_call_type, CPUContext.create_cfunc_wrapper, TargetConfig.__eq__
    with use_shortcuts():
        assert types.BaseFunction.get_call_type is not before[0]
    compiled_pair()(np.linspace(0.0, 1.0, 7))
    assert (types.BaseFunction.get_call_type, CPUContext.create_cfunc_wrapper, TargetConfig.__eq__) == before


def test_slices_of_different_shapes_are_an_error_without_functions_on_texts() -> None:
    def copied(values: np.ndarray, count: int) -> np.ndarray:
        result = np.zeros(3)
        result[:count] = values
        return result

    copied.__module__ = "manytouch.probe"
    compiled: Any = kernel(cache=False)(copied)
    assert list(compiled(np.ones(2), 2)) == [1.0, 1.0, 0.0]
    with pytest.raises(ValueError, match="cannot assign slice from input of different size"):
        compiled(np.ones(2), 3)
    (version,) = compiled.overloads.values()
    assert not [each for each in version.library._final_module.functions if "unicode" in each.name]


@pytest.mark.slow
def test_the_run_that_compiles_has_the_bits_of_later_runs(tmp_path: Path) -> None:
    surroundings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for name in ("compiles", "later"):
        command = [sys.executable, "-m", "manytouch", "process", "sim:one", "--out", str(tmp_path / name)]
        subprocess.run(command, check=True, env=surroundings, capture_output=True)
    for file in ("markers.parquet", "contacts.csv"):
        one, other = ((tmp_path / name / "sim-one" / file).read_bytes() for name in ("compiles", "later"))
        assert one == other, file


TWICE = """
import sys
from manytouch.session import pipeline_for
from manytouch.sources.simulated import simulated_source

def kinds(signature):
    return str(signature).replace(", True, aligned", "").replace(", False, aligned", "")

frames = {"pad": (0, *range(40, 62)), "one": (0, *range(38, 44), 60)}
for scene, numbers in frames.items():
    source, estimate = simulated_source(scene, width_px=640), pipeline_for("mechanics").estimate
    state = estimate.start(source.sensor)
    for number in numbers:
        state, _, _ = estimate.step(state, source.truth(number).grid)
for name, module in sorted(sys.modules.copy().items()):
    for function in vars(module).copy().values() if name.startswith("manytouch.") else ():
        signatures = getattr(function, "signatures", [])
        if len({kinds(each) for each in signatures}) < len(signatures):
            print(name, function.py_func.__qualname__)
"""


def test_results_of_threads_are_in_the_order_of_the_items() -> None:
    begun = Barrier(THREADS, timeout=10.0)

    def wait_for_another(item: int) -> int:
        begun.wait()  # one thread alone would wait in vain
        time.sleep(0.01 * (3 - item))
        return -item

    assert in_threads(wait_for_another, range(2 * THREADS)) == [0, -1, -2, -3]


def test_nothing_is_compiled_once_for_writable_and_once_for_read_only_arrays() -> None:
    """A contact on the pad ends in these frames: fits then begin from what is left of others."""
    done = subprocess.run([sys.executable, "-c", TWICE], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
