"""What instructions written in LLVM IR save of a frame, compared with the same work in plain numba.

    python benchmarks/bench_llvm.py [prefetch] [tile] [--rounds 2]

prefetch: the memory of windows is requested early (`compilation.prefetch`), read early, or neither;
detection in windows. tile: products are added to a tile in registers (`mechanics.banded.tile`), or by loops
that numba compiles to SIMD; a whole tracked frame of the method mechanics.

600 dots, 60 different images of 1280 x 720 px of the built-in scene `fingers` in turn, so that an image is in
memory and not in the cache. One thread, processor time in ms. Each variant runs in a process of its own,
whose compiled code is kept apart; variants take turns. The first line of each takes minutes, because it
compiles. At the end the times of all rounds are printed as a table.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

PICTURES, PASSES = 60, 7
VARIANTS = {"prefetch": ("prefetch", "early reads", "neither"), "tile": ("tile", "loops")}
NAMES = {
    "prefetch": "prefetch instructions",
    "early reads": "early reads",
    "neither": "neither",
    "tile": "tile in registers",
    "loops": "loops",
}
MEASURED = {"prefetch": "detection", "tile": "tracked frame with contacts"}
DIGITS = {"prefetch": 3, "tile": 2}


def early_read() -> Any:
    """A function for `prefetch` that reads the value itself, and waits for nothing else."""
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    from manytouch.compilation import inlined_kernel

    @intrinsic
    def use(typing: Any, value: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            kind = ir.FunctionType(ir.VoidType(), [arguments[0].type])
            builder.asm(kind, "", "r,~{memory}", list(arguments), True)
            return context.get_dummy_value()

        return types.void(value), code

    @inlined_kernel()
    def read(array: Any, index: int) -> None:
        if 0 <= index < array.size:
            use(array[index])

    return read


def nothing() -> Any:
    """A function for `prefetch` that does nothing."""
    from manytouch.compilation import inlined_kernel

    @inlined_kernel()
    def skip(array: Any, index: int) -> None:
        pass

    return skip


def looped_product(columns: int) -> Any:
    """`add_product` of so many columns in loops whose inner one is vectorised."""
    from manytouch.compilation import REORDER, kernel, u64
    from manytouch.mechanics.banded.tile import ROWS

    @kernel(fastmath=REORDER)
    def add(c: Any, c_at: Any, a: Any, a_at: Any, b: Any, b_at: Any, count: int) -> None:  # noqa: PLR0917
        for k in range(count):
            for row in range(ROWS):
                factor = a[u64(a_at.start + k * a_at.stride + row)]
                to, right = u64(c_at.start + row * c_at.stride), u64(b_at.start + k * b_at.stride)
                for column in range(u64(columns)):
                    c[to + column] += factor * b[right + column]

    return add


def replace_functions(variant: str) -> None:
    """Replace the function under test before the modules that use it are imported."""
    if variant in {"early reads", "neither"}:
        from manytouch import compilation

        compilation.prefetch = early_read() if variant == "early reads" else nothing()
    elif variant == "loops":
        from manytouch.mechanics.banded import tile

        tile.add_product, tile.add_product_16 = looped_product(32), looped_product(16)


def measure_ms(subject: str) -> float:
    """Time of a frame: of each image the least of some passes, then the median or, of whole frames, the mean.

    Full steps of the inversion are in few frames, so a median would not contain them.
    """
    from manytouch import open_source, pipeline_for

    source = open_source("sim:fingers")
    frames, sensor = list(islice(source, PICTURES)), source.capabilities.sensor
    pipeline = pipeline_for("mechanics" if subject == "tile" else "perimeter")
    taken_ms = np.full((PASSES + 1, len(frames)), np.inf)
    for turn in range(PASSES + 1):  # the first one compiles
        detect, track, estimate = (
            each.start(sensor) for each in (pipeline.detect, pipeline.track, pipeline.estimate)
        )
        for number, frame in enumerate(frames):
            expected_px = pipeline.track.expected_px(track)
            begun_s = time.thread_time()
            detect, found = pipeline.detect.step(detect, frame, expected_px)
            detected_s = time.thread_time()
            track, grid = pipeline.track.step(track, found)
            if subject == "tile":
                estimate, *_ = pipeline.estimate.step(estimate, grid)
            ended_s = detected_s if subject == "prefetch" else time.thread_time()
            if turn and expected_px is not None:
                taken_ms[turn, number] = 1e3 * (ended_s - begun_s)
    least_ms = taken_ms.min(axis=0)
    least_ms = least_ms[np.isfinite(least_ms)]
    return float(np.mean(least_ms) if subject == "tile" else np.median(least_ms))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("subjects", nargs="*", help="prefetch, tile; default: both")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--variant", help=argparse.SUPPRESS)
    given = parser.parse_args()
    subjects = given.subjects or list(VARIANTS)
    if unknown := set(subjects) - set(VARIANTS):
        parser.error(f"{', '.join(sorted(unknown))}: expected prefetch or tile")
    if given.variant:
        replace_functions(given.variant)
        print(f"{measure_ms(subjects[0]):.3f}")
        return
    taken: dict[tuple[str, str], list[str]] = {}
    with tempfile.TemporaryDirectory() as caches:
        for number in range(given.rounds):
            for subject in subjects:
                for variant in VARIANTS[subject]:
                    folder = Path(caches) / variant.replace(" ", "-")
                    surroundings = {"NUMBA_CACHE_DIR": str(folder), "OMP_NUM_THREADS": "1"}
                    done = subprocess.run(
                        [sys.executable, __file__, subject, "--variant", variant],
                        env=os.environ | surroundings, stdout=subprocess.PIPE, text=True, check=True,
                    )  # fmt: skip
                    taken_ms = f"{float(done.stdout):.{DIGITS[subject]}f}"
                    taken.setdefault((subject, variant), []).append(taken_ms)
                    print(f"round {number + 1}  {subject:9} {variant:12} {taken_ms} ms", flush=True)
    for subject in subjects:
        print(f"\n{table(subject, taken)}")


def table(subject: str, taken: Mapping[tuple[str, str], Sequence[str]]) -> str:
    """The times in ms of all rounds as the table of the decision, in Markdown."""
    rows = [f"| {NAMES[variant]} | {', '.join(taken[subject, variant])} |" for variant in VARIANTS[subject]]
    return "\n".join([f"| | {MEASURED[subject]}, ms |", "|---|---|", *rows])


if __name__ == "__main__":
    main()
