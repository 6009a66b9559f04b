"""Machine code from files: it needs nothing of what numba needs to compile."""

import json
import math
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import pytest

KERNELS = """
import numpy as np
from manytouch.compilation import REORDER, kernel


@kernel(fastmath=REORDER)
def scaled(values, factor):
    if factor == 0.0:
        raise ValueError("the factor is 0")
    total = 0.0
    for value in values:
        total += np.sin(value) / (1.0 + total)
    return factor * values + total


@kernel()
def twice(values, factor):
    return scaled(scaled(values, factor), factor)
"""

PROGRAM = """
import json, sys
import numpy as np
import probe_kernels
from numba.core.runtime.nrt import rtsys

found = {"sum": probe_kernels.scaled(np.linspace(0.0, 1.0, 9), 3.0).tobytes().hex()}
found["loaded"] = sum(probe_kernels.scaled.stats.cache_hits.values())
found["can compile"] = "numba.typed.typeddict" in sys.modules
found["has compiled"] = rtsys._init  # functions for the memory of arrays
try:
    probe_kernels.scaled(np.ones(2), 0.0)
except ValueError as error:
    found["error"] = str(error)
if "--more" in sys.argv:
    found["more"] = float(probe_kernels.scaled(np.ones(2, dtype=np.float32), 1.0)[0])
    found["twice"] = float(probe_kernels.twice(np.ones(2), 1.0)[0])
print(json.dumps(found))
"""


def run(folder: Path, *words: str) -> dict[str, Any]:
    """What a process finds that imports the kernels from a folder."""
    path = os.pathsep.join((str(folder), *sys.path))
    surroundings = os.environ | {"NUMBA_CACHE_DIR": str(folder / "files"), "PYTHONPATH": path}
    command = [sys.executable, "-c", PROGRAM, *words]
    done = subprocess.run(command, check=True, env=surroundings, capture_output=True, text=True)
    return dict(json.loads(done.stdout))


def sum_of_terms(value: float) -> float:
    """What the first kernel adds for two equal values."""
    return math.sin(value) + math.sin(value) / (1.0 + math.sin(value))


def test_a_kernel_is_loaded_without_what_compiling_needs(tmp_path: Path) -> None:
    (tmp_path / "probe_kernels.py").write_text(KERNELS, encoding="utf-8")
    first, second = run(tmp_path), run(tmp_path)
    assert (first["loaded"], first["can compile"], first["has compiled"]) == (0, True, True)
    assert (second["loaded"], second["can compile"], second["has compiled"]) == (1, False, False)
    assert second["sum"] == first["sum"]
    assert second["error"] == first["error"] == "the factor is 0"


def test_a_process_that_has_loaded_kernels_can_compile_others(tmp_path: Path) -> None:
    (tmp_path / "probe_kernels.py").write_text(KERNELS, encoding="utf-8")
    run(tmp_path)
    more = run(tmp_path, "--more")
    assert more["loaded"] == 1
    once = 1.0 + sum_of_terms(1.0)
    assert more["more"] == pytest.approx(once, rel=1e-6)
    assert more["twice"] == pytest.approx(once + sum_of_terms(once), rel=1e-12)


def test_files_contain_no_intermediate_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "probe_kernels.py").write_text(KERNELS, encoding="utf-8")
    run(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)  # the file refers to the module
    (file,) = (tmp_path / "files").rglob("*scaled*.nbc")
    (_, kind, (machine_code, intermediate_code)), *_ = pickle.loads(file.read_bytes())
    assert kind == "object"
    assert len(machine_code) > 1000
    assert list(llvm.parse_bitcode(intermediate_code).functions) == []
