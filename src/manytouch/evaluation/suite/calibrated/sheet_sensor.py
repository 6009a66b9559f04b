"""Sensors of the group `calibrated`: `calibrate rest` and `calibrate sheet` on presses on the same sheet."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.sheet.calibrate import calibrate_sheet
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.press_plan import PLACE_SHARE, TIP_RADIUS_MM
from manytouch.evaluation.suite.calibrated.held_presses import held_presses
from manytouch.evaluation.suite.cases import REST_FRAMES
from manytouch.evaluation.suite.sensors import true_sensor, with_all_dots
from manytouch.evaluation.suite.solutions import Solutions
from manytouch.evaluation.suite.varied.cases import SHARES, VariedCase
from manytouch.evaluation.suite.varied.drawn_sensor import drawn_sensor
from manytouch.evaluation.suite.varied.presses import VariedPress
from manytouch.evaluation.suite.varied.recording import FPS, simulate_varied
from manytouch.evaluation.suite.varied.sheets import SHEETS
from manytouch.values import Frame, Sensor

PLACES = {"centre": (0.0, 0.0), "left": (-PLACE_SHARE, -PLACE_SHARE), "right": (PLACE_SHARE, PLACE_SHARE)}
"""Places of the presses, in shares of the sheet: three of the five places of a press plan."""
DEEPEST_MM, DEEPEST_SHARE = 3.0, 0.15
"""Depth of the deepest press, and its largest share of the distance from the clamp."""


def calibration_presses(sheet: str) -> tuple[VariedCase, ...]:
    """Recordings of the calibration of a sheet: the ball of a press plan at three places, at three depths.

    Args:
        sheet: of `SHEETS`.
    """
    given, found = SHEETS[sheet], []
    for number, (place, share) in enumerate(PLACES.items()):
        x_mm, y_mm = np.round(np.array(share) * given.size_mm, 2).tolist()
        border_mm = float((0.5 * np.array(given.size_mm) - np.abs([x_mm, y_mm])).min())
        deepest_mm = round(min(DEEPEST_MM, DEEPEST_SHARE * border_mm), 2)
        ball = VariedPress(kind="ball", size_mm=(TIP_RADIUS_MM,), at_mm=(x_mm, y_mm), strength=deepest_mm)
        found.append(
            VariedCase(
                group="calibrated",
                name=f"press-{place}-{sheet}",
                seed=9000 + 10 * list(SHEETS).index(sheet) + number,
                looked_at=True,
                touches=(),
                deepest_mm=deepest_mm,
                size_mm=given.size_mm,
                thickness_mm=given.thickness_mm,
                young_MPa=given.young_MPa,
                poisson=given.poisson,
                pretension_N_per_mm=given.pretension_N_per_mm,
                pitch_mm=given.pitch_mm,
                shape="balls",
                sheet=sheet,
                presses=(ball,),
            )
        )
    return tuple(found)


@cache
def calibrated_sensor(sheet: str) -> Sensor:
    """The sensor of a sheet after its calibration, from a file with the errors of the group `drawn`.

    Forces are read and places known exactly; the contact has the radius of a press plan.

    Args:
        sheet: of `SHEETS`.
    """
    known: list[KnownPress] = []
    sensor: Sensor | None = None
    for case in calibration_presses(sheet):
        frames, forces_N = _recording(case)
        if sensor is None:
            given = drawn_sensor(case, with_all_dots(true_sensor(case)))
            sensor = calibrate_rest(given, frames[:REST_FRAMES]).sensor
        known += held_presses(
            sensor, frames, name=case.name, fps=FPS, at_mm=case.presses[0].at_mm, forces_N=forces_N
        )
    assert sensor is not None
    return replace(sensor, sheet=calibrate_sheet(sensor, known).sheet)


def _recording(case: VariedCase) -> tuple[tuple[Frame, ...], list[float]]:
    """The pictures of a press, and its normal force in each state."""
    states = Solutions(folder=Path()).known(case)  # these ship with the package
    assert states is not None
    assert len(states) == len(SHARES)
    _, frames, _ = simulate_varied(case, states)
    return frames, [float(state.contacts[0].normal_force_N) for state in states]
