"""How far interpolated states are from equilibria half-way between keyframes.

`python benchmarks/between_keyframes.py SCENE [--every N]` solves the middle of every N-th step in which
something moves. The keyframes must have been solved (`ship_scenes.py` or `manytouch simulate`).
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from manytouch.simulation.fem.cache import StateCache
from manytouch.simulation.fem.sheet import sheet_solver
from manytouch.simulation.scene.condense import condense
from manytouch.simulation.scene.file import BUILT_IN, built_in_scenes, load_scene
from manytouch.simulation.scene.motion import loading
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.solve_scene import solid_problem, states_folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", help="a built-in scene or a file")
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--states", type=Path, default=states_folder())
    arguments = parser.parse_args()
    is_built_in = arguments.scene in built_in_scenes()
    scene = load_scene(BUILT_IN / f"{arguments.scene}.toml" if is_built_in else arguments.scene)
    task = solid_problem(scene)
    if task.loading is None:
        raise SystemExit("nothing moves in this scene")
    kept = list(StateCache(folder=arguments.states).states(task.model, task.loading))
    brief = tuple(condense(state, task.loading) for state in kept)
    interpolated = SolidScene(
        name=scene.name, time_s=task.time_s, states=brief, duration_s=float(task.time_s[-1])
    )
    solver, worst = sheet_solver(task.model), []
    middle_s = 0.5 * (task.time_s[1:] + task.time_s[:-1])
    half_way = loading(scene.bodies, middle_s, thickness_mm=scene.sheet.thickness_mm)
    moving = np.zeros(len(middle_s), dtype=bool)
    for touch in task.loading.touches:
        moving |= np.abs(np.diff(touch.position_mm, axis=0)).max(axis=1) > 1e-3
    for number in np.flatnonzero(moving)[:: arguments.every]:
        once = replace(
            half_way,
            touches=tuple(
                replace(
                    touch,
                    position_mm=touch.position_mm[number : number + 1],
                    rotation_vector=touch.rotation_vector[number : number + 1],
                )
                for touch in half_way.touches
            ),
        )
        found = condense(solver.step(kept[number], once, 0), once)
        guess = interpolated.face(float(middle_s[number]))
        off_mm = np.abs(found.face_mm - guess.face_mm).max()
        true_N = sum(contact.normal_force_N for contact in found.contacts)
        guess_N = sum(
            contact.normal_force_N for contact in interpolated.contacts(float(middle_s[number])).values()
        )
        worst.append((off_mm, abs(guess_N - true_N)))
        print(
            f"{middle_s[number]:.3f} s: face {off_mm:.4f} mm, force {guess_N:.3f} for {true_N:.3f} N",
            flush=True,
        )
    table = np.array(worst)
    median = np.median(table, axis=0)
    print(f"{len(table)} steps: face at worst {table[:, 0].max():.3f} mm, median {median[0]:.4f} mm")
    print(f"force at worst {table[:, 1].max():.3f} N, median {median[1]:.3f} N")


if __name__ == "__main__":
    main()
