"""Solve the built-in scenes and write their deformations into the package.

`python benchmarks/ship_scenes.py [NAME ...]` writes src/manytouch/simulation/library/NAME.npz. Half an hour
from nothing; states that are kept (see `states_folder`) are not solved again.
"""

import argparse
import time
from pathlib import Path

from manytouch.simulation.scene.deformation_file import STEP_MM, write_deformations
from manytouch.simulation.scene.file import BUILT_IN, built_in_scenes, load_scene
from manytouch.simulation.solve_scene import solid_problem, states_folder

LIBRARY = Path(__file__).parents[1] / "src" / "manytouch" / "simulation" / "library"


def ship(name: str, folder: Path) -> None:
    problem = solid_problem(load_scene(BUILT_IN / f"{name}.toml"))
    begin, states = time.perf_counter(), []
    for time_s, state in zip(problem.time_s.tolist(), problem.states(folder), strict=True):
        if state.status != "ok":
            raise SystemExit(f"{name}: no equilibrium at {time_s:.3f} s")
        states.append(state)
        print(f"{name}: {len(states)} of {len(problem.keys)} at {time_s:.3f} s", flush=True)
    size = write_deformations(LIBRARY / f"{name}.npz", dict(zip(problem.keys, states, strict=True)))
    taken = time.perf_counter() - begin
    print(f"{name}: {len(states)} states, {size / 1e6:.2f} MB, {STEP_MM} mm steps, {taken:.0f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=[name for name in built_in_scenes() if name != "rest"])
    parser.add_argument("--states", type=Path, default=states_folder(), help="folder of solved states")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        ship(name, arguments.states)


if __name__ == "__main__":
    main()
