"""Kills `manytouch process` at random moments: its result folder must be the old or the new one, never mixed.

    python tests/faults/kills.py [--kills 200] [--seed 0]

Two recordings of the same name and different lengths are processed in turn into one folder. After each kill
the folder must hold the complete result of one of them, once the next start has had the chance to finish an
exchange of folders that was interrupted.
"""

import argparse
import contextlib
import csv
import json
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
import pyarrow.parquet as pq

import manytouch.session  # noqa: F401 - imported once, for all children
from clips import COLUMNS, ROWS, pressed_video
from manytouch.cli import main as manytouch_main

LENGTHS = {"short": 25, "long": 45}
NAME = "press"


def state_of(result: Path) -> str:
    """`absent`, the name of the recording whose complete result it is, or `mixed` with the reason."""
    if not result.exists():
        return "absent"
    try:
        with (result / "frames.csv").open(newline="") as file:
            frames = sum(1 for _ in csv.DictReader(file))
        markers = pq.read_metadata(result / "markers.parquet").num_rows
        counted = json.loads((result / "summary.json").read_text())["counts"]["frames"]
        (result / "contacts.csv").read_text()
    except Exception as error:  # noqa: BLE001 - whatever is wrong with the folder
        return f"mixed: {type(error).__name__}: {error}"
    if not frames == counted == markers / (ROWS * COLUMNS) or frames not in LENGTHS.values():
        return f"mixed: {frames} frames, {markers} rows of markers, {counted} counted"
    return next(name for name, length in LENGTHS.items() if length == frames)


def start(recording: Path, out: Path) -> int:
    """Begin to process in a child; its process id."""
    child = os.fork()
    if child == 0:
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):  # noqa: PTH123
            status = manytouch_main(["process", str(recording), "--out", str(out)])
        os._exit(status)
    return child


def kill_all(kills: int, seed: int, folder: Path) -> Counter[str]:
    """States of the folder after each kill."""
    random, states = np.random.default_rng(seed), Counter[str]()
    recordings = {}
    for name, length in LENGTHS.items():
        (folder / name).mkdir()
        recordings[name] = pressed_video(folder / name / f"{NAME}.mp4", frames=length)
    out = folder / "out"
    begin_s = time.monotonic()
    os.waitpid(start(recordings["short"], out), 0)
    whole_s = time.monotonic() - begin_s
    before = state_of(out / NAME)
    for number in range(kills):
        child = start(recordings[("long", "short")[number % 2]], out)
        time.sleep(random.uniform(0.2, 1.1) * whole_s)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        after = state_of(out / NAME)
        if after == "absent":  # between two renames: the next start puts a complete result in place
            os.waitpid(start(recordings["short"], out), 0)
            after = f"absent, then {state_of(out / NAME)}"
        kind = "old" if after == before else "new" if after in LENGTHS else after
        states[kind] += 1
        if kind not in ("old", "new"):
            print(f"kill {number}: {after}", flush=True)
        before = state_of(out / NAME)
    left = [path.name for path in out.rglob("*") if path.name.startswith(".") or "partial" in path.name]
    if left:
        print(f"left in the folder: {', '.join(sorted(left)[:10])}")
    return states


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        states = kill_all(options.kills, options.seed, Path(folder))
    print(f"{options.kills} kills: " + ", ".join(f"{count} {state}" for state, count in states.items()))
    is_met = set(states) <= {"old", "new", *(f"absent, then {name}" for name in LENGTHS)}
    print("goals met" if is_met else "goals missed")
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
