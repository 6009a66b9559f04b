"""Solve the presses on pads of `evaluate`, also for calibrations, and write them into the package.

.venv/bin/python benchmarks/ship_pads.py    # two hours for all; files that are there are left as they are
"""

from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from manytouch.evaluation.suite.calibrated.pad_sensor import calibration_presses
from manytouch.evaluation.suite.pads.cases import PADS, OwnPadCase, pads
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.simulation.pad_presses import PressedPad, solve_pad
from manytouch.simulation.scene.deformation_file import write_deformations


def states(case: OwnPadCase) -> Iterator[tuple[float, PressedPad]]:
    """The three levels of a case and the solved pads."""
    loading, kept = case.press.loading(case.thickness_mm)
    solved = list(solve_pad(true_pad(case), loading))
    for level, number in zip(case.press.levels, kept, strict=True):
        yield level, solved[number]


def main() -> None:
    folder = Path(str(files("manytouch.evaluation") / "deformations"))
    calibrations = (case for pad in PADS for case in calibration_presses(pad))
    for case in (*pads("pads"), *calibrations):
        path = folder / case.solution
        if path.exists():
            continue
        planes = {}
        for number, (level, state) in enumerate(states(case)):
            if state.status != "ok":
                raise SystemExit(f"{case.name} at level {level:g} is {state.status}: no file was written")
            planes[f"{number} {level:g}"] = state.markers
        print(f"{path.name}: {write_deformations(path, planes)} bytes", flush=True)


if __name__ == "__main__":
    main()
