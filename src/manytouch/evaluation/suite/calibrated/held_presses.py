"""Known presses from a simulated recording that holds each of them for some frames."""

from collections.abc import Sequence

from manytouch.calibration.sheet.fit import KnownPress
from manytouch.calibration.sheet.press_plan import CONTACT_RADIUS_MM
from manytouch.calibration.sheet.press_table import PressRow, known_press, track_presses
from manytouch.evaluation.suite.cases import HOLD_FRAMES, REST_FRAMES
from manytouch.values import Frame, Sensor


def held_presses(
    sensor: Sensor,
    frames: Sequence[Frame],
    *,
    name: str,
    fps: float,
    at_mm: tuple[float, float],
    forces_N: Sequence[float],
) -> list[KnownPress]:
    """The presses of a recording at rest for `REST_FRAMES` frames, then at each force for `HOLD_FRAMES`.

    Args:
        sensor: after `calibrate rest`.
        frames: of the recording.
        name: of the recording, for messages.
        fps: its rate.
        at_mm: x, y of all presses; the contact has the radius of a press plan.
        forces_N: normal force of each.
    """
    recording = track_presses(sensor, frames)
    return [
        known_press(
            recording,
            PressRow(
                line=number + 1,
                input=name,
                time_s=(REST_FRAMES + HOLD_FRAMES * (number + 0.5) - 0.5) / fps,
                x_mm=at_mm[0],
                y_mm=at_mm[1],
                radius_mm=CONTACT_RADIUS_MM,
                force_N=force_N,
            ),
        )
        for number, force_N in enumerate(forces_N)
    ]
