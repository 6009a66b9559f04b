"""Every process of the program uses one BLAS thread."""

import os
import subprocess
import sys

import pytest

REPORT = """
import json
from threadpoolctl import threadpool_info
import numpy, scipy.linalg
print(json.dumps([each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]))
"""
COMMAND_LINE = "import manytouch.cli" + REPORT
PREPARED = (
    """
import numpy, scipy.linalg
from threadpoolctl import threadpool_limits
threadpool_limits(limits=2, user_api="blas")
from manytouch.errors import ManytouchError
from manytouch.session import prepare
try:
    prepare("absent.mp4")
except ManytouchError:
    pass
"""
    + REPORT
)
CHILD = """
import subprocess, sys
import manytouch.cli
print(subprocess.run([sys.executable, "-c", '''REPORT'''], capture_output=True, text=True, check=True).stdout)
""".replace("REPORT", REPORT)


@pytest.mark.parametrize("program", [COMMAND_LINE, PREPARED, CHILD], ids=["command line", "library", "child"])
def test_blas_has_one_thread(program: str) -> None:
    surroundings = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=surroundings, check=True
    )
    threads = eval(done.stdout)
    assert threads
    assert set(threads) == {1}
