"""Solve the presses of `pads.py` and write them into the package, for the groups of pads of `evaluate`.

.venv/bin/python benchmarks/ship_pads.py    # half an hour; nothing is solved again that is kept
"""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from pads import CASES, sensor_of, states

from manytouch.evaluation.suite.pads import pads
from manytouch.simulation.scene.deformation_file import write_deformations


def main() -> None:
    folder = Path(str(files("manytouch.evaluation") / "deformations"))
    wanted = {case.solution for case in pads("pads")}
    for case in CASES:
        path = folder / f"pad-{case.name.replace(' ', '-').replace(',', '')}.npz"
        if path.name not in wanted:
            continue
        solved = {f"{depth_mm:g}": state for depth_mm, state in states(case, sensor_of(case.pad), None)}
        planes = {depth: state.markers for depth, state in solved.items()}
        for depth, state in solved.items():
            planes[f"{depth} face"] = replace(state.face, contacts=state.markers.contacts)
        print(f"{path.name}: {write_deformations(path, planes)} bytes")


if __name__ == "__main__":
    main()
