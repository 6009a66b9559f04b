"""Solve the varied cases of the accuracy suite and the presses of its calibrations.

Their states are written into the package.

.venv/bin/python benchmarks/ship_suite.py [--only TEXT] [--processes 2]

Half an hour of one core for all; the same command continues an interrupted run. Files in the package that
belong to no case any more are listed. With --halved every eleventh case, or each that --only leaves, is
solved again on elements of half the width in two layers, and the differences are printed: the error of the
truth.
"""

import argparse
from importlib.resources import files
from pathlib import Path

import numpy as np

from manytouch.evaluation.suite.calibrated.sheet_sensor import calibration_presses
from manytouch.evaluation.suite.solutions import Solutions, shipped_name, state_count
from manytouch.evaluation.suite.varied.cases import VariedCase, varied
from manytouch.evaluation.suite.varied.sheets import SHEETS
from manytouch.evaluation.suite.varied.solving import solve_varied
from manytouch.evaluation.suite.workers import run_tasks
from manytouch.simulation.scene.deformation_file import write_deformations


def solve(case: VariedCase) -> str:
    path = package() / shipped_name(case)
    if path.is_file():
        return "is solved"
    states = [state for state in solve_varied(case) if state.status == "ok"]
    if len(states) < state_count(case):
        return f"only {len(states)} of {state_count(case)} states are in balance"
    size = write_deformations(path, {str(step): state for step, state in enumerate(states)})
    return f"{size} bytes"


def compare(case: VariedCase) -> str:
    """Differences of a solution on elements of half the width from the one that ships."""
    shipped = Solutions(folder=Path("none")).known(case)
    if shipped is None:
        return "is not solved yet"
    words = []
    for number, (fine, coarse) in enumerate(zip(solve_varied(case, 2.0), shipped, strict=True)):
        face_mm = fine.displacement_mm(
            np.stack(np.meshgrid(coarse.x_mm, coarse.y_mm, indexing="ij"), -1).reshape(-1, 2)
        )
        rmse_mm = float(np.sqrt(np.mean((face_mm[:, 2] - coarse.face_mm.reshape(-1, 3)[:, 2]) ** 2)))
        parts = [
            f"F {100 * (a.normal_force_N / b.normal_force_N - 1):+.1f} % "
            f"at {np.linalg.norm(a.centre_mm - b.centre_mm):.3f} mm "
            f"d {100 * (a.depth_mm / b.depth_mm - 1):+.1f} % "
            f"A {100 * (a.region_mm2 / b.region_mm2 - 1):+.0f} %"
            for a, b in zip(fine.contacts, coarse.contacts, strict=True)
            if a.is_touching and b.is_touching
        ]
        deepest_mm = -float(coarse.face_mm[..., 2].min())
        words.append(f"{number}: depth RMSE {rmse_mm:.4f} mm of {deepest_mm:.2f}, {'; '.join(parts)}")
    return "\n    ".join(words)


def package() -> Path:
    return Path(str(files("manytouch.evaluation") / "deformations"))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--only", default="", help="cases with this in their name")
    options.add_argument("--processes", type=int, default=2)
    options.add_argument("--halved", action="store_true", help="state the error of the truth instead")
    chosen = options.parse_args()
    every = [*varied("varied"), *(case for sheet in SHEETS for case in calibration_presses(sheet))]
    cases = [case for case in every if chosen.only in case.name]
    work = compare if chosen.halved else solve
    some = cases[:: 11 if chosen.halved and not chosen.only else 1]
    some.sort(key=lambda case: (not case.is_quick, case.friction > 0.0))  # with friction it takes long
    for number, words in run_tasks(work, some, processes=chosen.processes):
        print(f"{some[number].name}: {words}", flush=True)
    wanted = {shipped_name(case) for case in every}
    for path in sorted(package().glob("varied-*.npz")):
        if path.name not in wanted:
            print(f"{path.name} belongs to no case; remove it")


if __name__ == "__main__":
    main()
