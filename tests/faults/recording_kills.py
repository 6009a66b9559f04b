"""Kills processes that record, at times given by a seed: no more than the last 200 ms may be lost.

python tests/faults/recording_kills.py [--kills 200] [--seed 0]
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from manytouch.errors import SourceError
from manytouch.recording.reader import Recording

LOSS_S = 0.2
RECORDING = """
import sys, time
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from dataclasses import replace
from clips import picture
from cameras import jpeg
from manytouch.session import prepare
from manytouch.sinks.recorder import Recorder
from manytouch.sources import Capabilities
from manytouch.values import Frame

class One:
    name, fps, frame_count, width_px, height_px, is_live = "one", 30.0, 1, 320, 240, False
    capabilities = Capabilities()
    def __iter__(self):
        yield Frame(index=0, timestamp_ns=0, camera="one", image=picture())

job = prepare(One())
reading = next(iter(job.pipeline.run(job.samples, job.sensor)))
recorder = Recorder(Path(sys.argv[1]), source={})
recorder.describe(job.sensor, job.pipeline, job.method)
encoded = jpeg(picture())
index = 0
while True:
    frame = Frame(index=index, timestamp_ns=index * 33_333_333, camera="one", image=None, encoded=encoded)
    recorder.take(frame)
    recorder.write(replace(reading, frame=frame))
    print(index, time.monotonic(), flush=True)
    index += 1
    time.sleep(1 / 30)
"""


def kill_recording(folder: Path, seed: int) -> Recording | None:
    """Kill a process that records; returns what is in the file, None if that is no frame.

    Raises:
        AssertionError: more than the last 200 ms are lost, or a frame is missing before.
    """
    path = folder / "killed.mcap"
    path.unlink(missing_ok=True)
    words = [sys.executable, "-c", RECORDING, str(path), str(Path(__file__).parents[1])]
    count = random.Random(seed).randrange(2, 60)
    printed: list[tuple[int, float]] = []
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for line in child.stdout:
            printed.append((int(line.split()[0]), float(line.split()[1])))
            if len(printed) == count:
                break
        killed_s = time.monotonic()
        os.kill(child.pid, signal.SIGKILL)
        rest = [line.split() for line in child.stdout if line.endswith("\n")]
    printed += [(int(index), float(at_s)) for index, at_s in rest]
    try:
        recording = Recording(path)
    except SourceError:  # killed before the first frame was written
        recording = None
    kept = -1
    if recording is not None:
        assert not recording.is_complete
        kept = recording.frames[-1].sequence
        assert [place.sequence for place in recording.frames] == list(range(kept + 1)), "a frame is missing"
        assert all(recording.frame(place).encoded for place in range(kept + 1)), "a frame is empty"
    lost = [at_s for index, at_s in printed if index > kept]
    lost_s = killed_s - min(lost, default=killed_s)
    assert lost_s < LOSS_S, f"the last {1e3 * lost_s:.0f} ms are lost, {len(lost)} of {len(printed)} frames"
    return recording


def main() -> int:
    """Kill a number of recordings, and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.seed, options.seed + options.kills):
            try:
                kill_recording(Path(folder), seed)
            except Exception as error:  # noqa: BLE001 - that is what is looked for
                wrong += 1
                print(f"seed {seed}: {error!r}", flush=True)
    print(f"recordings killed: {options.kills}; more than {1e3 * LOSS_S:g} ms lost or wrong: {wrong}")
    print("goals met" if wrong == 0 else "goals missed")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
