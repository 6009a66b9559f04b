"""Compiled functions: their results do not depend on whether they come from the cache."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from llvmlite.binding import Linkage

from manytouch import compilation
from manytouch.compilation import REORDER, bind_calls_within_modules, kernel


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
    monkeypatch.setattr(compilation, "_bind_calls", lambda _: None)
    free = compiled_pair()
    assert free(values) == pytest.approx(result)
    assert replaceable_functions(free), "the test shows nothing: the inner function was inlined"


@pytest.mark.slow
def test_the_run_that_compiles_has_the_bits_of_later_runs(tmp_path: Path) -> None:
    surroundings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for name in ("compiles", "later"):
        command = [sys.executable, "-m", "manytouch", "process", "sim:one", "--out", str(tmp_path / name)]
        subprocess.run(command, check=True, env=surroundings, capture_output=True)
    for file in ("markers.parquet", "contacts.csv"):
        one, other = ((tmp_path / name / "sim-one" / file).read_bytes() for name in ("compiles", "later"))
        assert one == other, file
