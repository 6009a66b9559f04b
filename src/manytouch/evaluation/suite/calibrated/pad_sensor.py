"""Sensors of the group `pads_calibrated`: a nominal file, then `calibrate rest` and `calibrate sheet`."""

from dataclasses import replace
from functools import cache

import numpy as np

from manytouch.calibration.rest.calibrate import calibrate_rest
from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.pad import calibrate_pad
from manytouch.calibration.sheet.press_plan import BONDED_SHARE, PLACE_SHARE, TIP_RADIUS_MM
from manytouch.evaluation.suite.calibrated.held_presses import held_presses
from manytouch.evaluation.suite.cases import REST_FRAMES
from manytouch.evaluation.suite.pads.cases import PADS, WIDTH_PX, OwnPadCase
from manytouch.evaluation.suite.pads.pad_sensors import NOMINAL_STD, true_pad
from manytouch.evaluation.suite.pads.presses import PadPress, one
from manytouch.evaluation.suite.pads.recording import FPS, pad_states, simulate_pad
from manytouch.simulation.fem.contact.indenters import Sphere
from manytouch.values import Sensor

PLACES = {"centre": (0.0, 0.0), "left": (-PLACE_SHARE, -PLACE_SHARE)}
"""Places of the presses, in shares of the pad: two of the five places of a press plan."""
FRICTION = {"centre": 0.0, "left": 0.5}
"""Coulomb's coefficient of the tip at each place: nobody knows that of a real one."""
SHARES = (0.3, 0.6, 1.0)
"""Depths of a press over that of the deepest."""
MOST_POISSON, LEAST_MARKER_DEPTH_MM = 0.495, 0.05
"""Limits of what a nominal file states."""


def calibration_presses(pad: str) -> tuple[OwnPadCase, ...]:
    """Recordings of the calibration of a pad: the ball of a press plan at two places, at three depths.

    Args:
        pad: of `PADS`.
    """
    size_mm, thickness_mm = np.array(PADS[pad]["size_mm"]), float(str(PADS[pad]["thickness_mm"]))
    deepest_mm = round(BONDED_SHARE * thickness_mm, 2)
    found = []
    for number, (place, share) in enumerate(PLACES.items()):
        x_mm, y_mm = np.round(share * size_mm, 2).tolist()
        first_mm, second_mm, third_mm = (round(each * deepest_mm, 2) for each in SHARES)
        found.append(
            OwnPadCase(
                group="pads_calibrated",
                name=f"press-{place}-{pad}",
                seed=9500 + 10 * list(PADS).index(pad) + number,
                looked_at=True,
                touches=(),
                pad=pad,
                press=PadPress(
                    bodies=one(Sphere(radius_mm=TIP_RADIUS_MM), (x_mm, y_mm)),
                    levels=(first_mm, second_mm, third_mm),
                    friction=FRICTION[place],
                ),
                deepest_mm=deepest_mm,
                noise=1.2,
                width_px=WIDTH_PX,
                solution=f"pad-press-{place}-{pad}.npz",
                **PADS[pad],  # type: ignore[arg-type]
            )
        )
    return tuple(found)


def drawn_pad(case: OwnPadCase) -> Sensor:
    """The sensor with a nominal file: the numbers of its pad have random errors, and state their deviations.

    Args:
        case: whose seed determines the errors.
    """
    true = true_pad(case)
    assert true.sheet is not None
    draw = dict(zip(NOMINAL_STD, np.random.default_rng(case.seed).normal(size=len(NOMINAL_STD)), strict=True))
    young_MPa = case.young_MPa * float(np.exp(NOMINAL_STD["young_MPa"] * draw["young_MPa"]))
    thickness_mm = case.thickness_mm * (1.0 + NOMINAL_STD["thickness_mm"] * draw["thickness_mm"])
    poisson = case.poisson + NOMINAL_STD["poisson"] * draw["poisson"]
    depth_mm = case.marker_depth_mm + NOMINAL_STD["marker_depth_mm"] * draw["marker_depth_mm"]
    return replace(
        true,
        sheet=replace(
            true.sheet,
            young_MPa=young_MPa,
            young_std_MPa=NOMINAL_STD["young_MPa"] * young_MPa,
            thickness_mm=float(thickness_mm),
            thickness_std_mm=float(NOMINAL_STD["thickness_mm"] * thickness_mm),
            poisson=min(float(poisson), MOST_POISSON),
            poisson_std=NOMINAL_STD["poisson"],
            marker_depth_mm=max(float(depth_mm), LEAST_MARKER_DEPTH_MM),
            marker_depth_std_mm=NOMINAL_STD["marker_depth_mm"],
        ),
    )


@cache
def calibrated_pad(pad: str) -> Sensor:
    """The sensor of a pad after its calibration, from a nominal file.

    Forces are read and places known exactly; the contact has the radius of a press plan.

    Args:
        pad: of `PADS`.
    """
    known: list[KnownPress] = []
    sensor: Sensor | None = None
    for case in calibration_presses(pad):
        _, frames, _ = simulate_pad(case)
        if sensor is None:
            sensor = calibrate_rest(drawn_pad(case), frames[:REST_FRAMES]).sensor
        known += held_presses(
            sensor,
            frames,
            name=case.name,
            fps=FPS,
            at_mm=case.press.bodies[0].at_mm,
            forces_N=[float(face.contacts[0].normal_force_N) for _, face in pad_states(case)],
        )
    assert sensor is not None
    return replace(sensor, sheet=calibrate_pad(sensor, known).sheet)
