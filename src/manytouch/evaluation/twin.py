"""Who makes the pictures and the truth of a case."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from manytouch.evaluation.bench import true_sensor
from manytouch.evaluation.cases import RAMP_FRAMES, REST_FRAMES, Case
from manytouch.simulation.optics import Optics
from manytouch.simulation.plate import PatchLoad, clamped_plate
from manytouch.simulation.render import Look
from manytouch.simulation.scene import Press, Scene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Frame, Sensor, Sheet, Truth

FPS = 30.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """A case, played.

    Attributes:
        sensor: as it truly is.
        frames: the pictures, the first 15 at rest.
        truths: one for each frame.
    """

    sensor: Sensor
    frames: tuple[Frame, ...]
    truths: tuple[Truth, ...]


@runtime_checkable
class Twin(Protocol):
    """A digital twin of the sensor that can play cases."""

    @property
    def name(self) -> str:
        """Short, for tables."""

    @property
    def in_words(self) -> str:
        """What kind of truth it is, and what is not in it."""

    def refusal(self, case: Case) -> str | None:
        """Why it cannot play a case; None when it can."""

    def play(self, case: Case) -> Recording:
        """Pictures and truth of a case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateTwin:
    """The linear clamped plate of the built-in simulated sensor."""

    @property
    def name(self) -> str:
        return "linear plate"

    @property
    def in_words(self) -> str:
        return (
            "A linear clamped plate under pretension (Kirchhoff, Ritz series) that frictionless round "
            "patches press: without large deflection, without the mechanics of a solid, without friction; "
            "dots move as normals to the middle surface do. It ranks methods; it does not say how well "
            "they do on a real sheet"
        )

    def refusal(self, case: Case) -> str | None:
        return "the linear plate has no friction" if case.friction > 0 else None

    def play(self, case: Case) -> Recording:
        sensor = true_sensor(case)
        assert sensor.sheet is not None
        begin_s, ramp_s = (REST_FRAMES - 1) / FPS, RAMP_FRAMES / FPS
        presses = tuple(
            Press(
                start_s=begin_s,
                end_s=begin_s + 10 * ramp_s,  # after the last frame
                from_mm=touch.at_mm,
                to_mm=touch.at_mm,
                force_N=float(force_N),
                radius_mm=touch.radius_mm,
                ramp_s=ramp_s,
            )
            for touch, force_N in zip(case.touches, plate_forces_N(case, sensor.sheet), strict=True)
            if force_N > 0
        )
        scene = Scene(name=case.title, duration_s=case.frame_count / FPS, presses=presses, seed=case.seed)
        look = Look(tilt_x=0.12, tilt_y=-0.08, vignetting=0.25, read_noise=case.noise)
        simulator = Simulator(
            sensor=sensor, scene=scene, fps=FPS, look=look, optics=Optics(blur_px=0.8 * case.width_px / 1280)
        )
        numbers = range(case.frame_count)
        return Recording(
            sensor=sensor,
            frames=tuple(simulator.frame(number) for number in numbers),
            truths=tuple(simulator.truth(number) for number in numbers),
        )


def plate_forces_N(case: Case, sheet: Sheet) -> np.ndarray:
    """Forces (t,) that give the strengths of the touches on a linear plate.

    Depths follow from forces by a matrix. A touch that would have to pull, because its neighbours alone
    press the sheet deeper than it asks for, does not touch; the others then have their depths.
    """
    plate = clamped_plate(sheet)
    centre_mm = np.array([touch.at_mm for touch in case.touches])
    loads = [PatchLoad(centre_mm=t.at_mm, radius_mm=t.radius_mm, force_N=1.0) for t in case.touches]
    modes = plate.modes_at(centre_mm)
    depth_per_N = np.column_stack([modes.field(plate.coefficients((load,))).depth_mm for load in loads])
    strength = np.array([touch.strength for touch in case.touches])
    if case.strength_is == "depth":
        force_N = np.zeros(len(strength))
        pressing = np.arange(len(strength))
        while len(pressing):
            force_N[:] = 0.0
            force_N[pressing] = np.linalg.solve(depth_per_N[np.ix_(pressing, pressing)], strength[pressing])
            if force_N.min() >= 0:
                break
            pressing = pressing[pressing != np.argmin(force_N)]
        return force_N
    return np.asarray(strength * case.deepest_mm / float((depth_per_N @ strength).max()))
