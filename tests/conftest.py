"""Settings that apply to all tests."""

import gc
import os
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

import type_checks
from computed_once import computed_again, computed_once

# Other conftest modules import the package before options are known, so this is no option.
if os.environ.get("CHECK_TYPES"):
    type_checks.install()

# One thread of BLAS, as in the program: those of several workers would wait for each other.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
threadpool_limits(limits=1, user_api="blas")

# The first example may compile kernels, and a machine may be busy: benchmarks measure time, tests do not.
settings.register_profile("without deadline", deadline=None)
settings.load_profile("without deadline")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--part",
        metavar="I/N",
        help="run every N-th of the selected tests, starting with number I (0 to N-1), by name",
    )


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import the tests without garbage collection, which would visit what was imported again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import modules all of whose tests are slow where these are deselected."""
    if config.option.markexpr != "not slow" or collection_path.suffix != ".py":
        return None
    return True if "\npytestmark = pytest.mark.slow\n" in collection_path.read_text("utf-8") else None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    type_checks.begin_test()


@pytest.fixture(scope="session", autouse=True)
def equal_results_are_computed_once() -> Iterator[None]:
    """Where the tests import the estimators; others need not load them."""
    if "manytouch.estimation" not in sys.modules:
        yield
        return
    with computed_once():
        yield


@pytest.fixture
def each_is_computed_again() -> Iterator[None]:
    """For tests that states are values and depend on nothing else."""
    with computed_again():
        yield


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Select the tests of `--part`, after the selection by markers."""
    part = config.getoption("--part")
    if part is None:
        return
    first, _, count = part.partition("/")
    if not (first.isdecimal() and count.isdecimal() and int(first) < int(count)):
        raise pytest.UsageError(f"--part {part}: expected I/N with 0 <= I < N, such as 0/9")
    names = sorted(item.nodeid for item in items)
    chosen = set(names[int(first) :: int(count)])
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in chosen])
    items[:] = [item for item in items if item.nodeid in chosen]
