"""Faults on purpose, which the runner must find."""

import os
import time
from pathlib import Path

import numpy as np

from faults.runner import Fuzzer
from manytouch.errors import ManytouchError


def warm_up() -> None:
    """Nothing to prepare."""


def crash(seed: int, folder: Path) -> None:
    _ = 1 / seed


def hang(seed: int, folder: Path) -> None:
    time.sleep(3600)


def slow(seed: int, folder: Path) -> None:
    time.sleep(0.6)


def memory(seed: int, folder: Path) -> None:
    np.ones(2**28, dtype=np.float64)


def dies(seed: int, folder: Path) -> None:
    os._exit(3)


def no_sentence(seed: int, folder: Path) -> None:
    raise ManytouchError("")


def fine(seed: int, folder: Path) -> None:
    (folder / "a").write_text("b")


FUZZERS = (
    Fuzzer(name="crash", run=crash),
    Fuzzer(name="hang", run=hang),
    Fuzzer(name="slow", run=slow),
    Fuzzer(name="memory", run=memory),
    Fuzzer(name="dies", run=dies),
    Fuzzer(name="no sentence", run=no_sentence),
    Fuzzer(name="fine", run=fine),
)
