"""Tries hostile inputs and prints what became of them: `make faults`.

python tests/faults/run.py [--inputs 10000] [--seed 0] [--kind NAME]... [--module faults.fuzzers]...

The limit of time is for a warm process; time in which it waits for a processor does not count. An input
without result is tried once more in a new process; the second outcome counts.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from importlib import import_module, util

from faults.runner import TIMED_OUT, WRONG, Outcome, run_all, table

MODULES = ("faults.fuzzers", "faults.mcap_fuzzer")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--inputs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", default=[])
    parser.add_argument("--module", action="append", default=[])
    options = parser.parse_args()
    kinds = [
        (module, fuzzer.name)
        for module in options.module or MODULES
        if util.find_spec(module) is not None
        for fuzzer in import_module(module).FUZZERS
        if not options.kind or fuzzer.name in options.kind
    ]
    each = -(-options.inputs // len(kinds))
    outcomes: list[Outcome] = []
    for module, name in kinds:
        for first in run_all(module, [name], range(options.seed, options.seed + each)):
            found = next(run_all(module, [name], [first.seed])) if first.text == TIMED_OUT else first
            outcomes.append(found)
            if found.kind == WRONG:
                print(f"--- wrong: {name}, seed {found.seed}\n{found.text}", flush=True)
        print(f"{name}: {each} inputs", file=sys.stderr, flush=True)
    print(table(outcomes))
    is_met = all(found.kind != WRONG for found in outcomes)
    print("goals met" if is_met else "goals missed")
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
