"""Who makes the pictures and the truth of a case."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from manytouch.evaluation.suite.cases import REST_FRAMES, Case
from manytouch.evaluation.suite.pads.cases import PadCase
from manytouch.evaluation.suite.pads.recording import simulate_pad
from manytouch.evaluation.suite.sensors import true_sensor
from manytouch.evaluation.suite.solutions import Solutions, state_count
from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.evaluation.suite.varied.recording import simulate_varied
from manytouch.simulation.render.discs import Look
from manytouch.simulation.render.optics import ImagingSettings
from manytouch.simulation.scene.deformation import Deformation, undeformed
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Frame, Sensor, Truth

FPS = 30.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SimulatedRecording:
    """A simulated case.

    Attributes:
        sensor: as it truly is.
        frames: the pictures, the first 15 at rest.
        truths: one for each frame.
    """

    sensor: Sensor
    frames: tuple[Frame, ...]
    truths: tuple[Truth, ...]


@runtime_checkable
class CaseSimulation(Protocol):
    """A digital simulation of the sensor that can play cases."""

    @property
    def description(self) -> str:
        """What kind of truth it is, and what is not in it."""

    def refusal(self, case: Case) -> str | None:
        """Why it cannot play a case; None when it can."""

    def simulate(self, case: Case) -> SimulatedRecording:
        """Pictures and truth of a case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FemSimulation:
    """The sheet as a 3-D solid under rigid balls, one equilibrium per frame of the ramp.

    Attributes:
        solutions: the solved cases.
    """

    solutions: Solutions

    @property
    def description(self) -> str:
        return (
            "A clamped sheet of nearly incompressible rubber (neo-Hooke) under pretension as a 3-D solid: "
            "quadratic finite elements with large deformation, pressed by rigid balls, with friction where "
            "a case has it; the camera shows the bent dots through its lens, in uneven light and with "
            "noise. Varied cases have other shapes, sheets and hyperelastic laws, and a part of them sag, "
            "relaxation and uneven thickness. Not in it: shadows of the fingers. Bonded pads stand "
            "apart: the same solid, fixed below with free sides, seen through its window"
        )

    def refusal(self, case: Case) -> str | None:
        if isinstance(case, PadCase):
            return None
        states = self.solutions.known(case)
        if states is None:
            return "no solution is known yet"
        return None if len(states) == state_count(case) else "no equilibrium was found"

    def simulate(self, case: Case) -> SimulatedRecording:
        if isinstance(case, PadCase):
            sensor, frames, truths = simulate_pad(case)
            return SimulatedRecording(sensor=sensor, frames=frames, truths=truths)
        states = self.solutions.known(case) or self.solutions.solve(case)
        if isinstance(case, VariedCase):
            sensor, frames, truths = simulate_varied(case, states)
            return SimulatedRecording(sensor=sensor, frames=frames, truths=truths)
        return simulate_case(case, states)


def simulate_case(case: Case, states: tuple[Deformation, ...]) -> SimulatedRecording:
    """The recording of a sheet that is at rest, goes through some states, and stays in the last.

    Every frame of the ramp is one of the states, so nothing is interpolated.
    """
    sensor = true_sensor(case)
    frames = np.array([0, *range(REST_FRAMES - 1, REST_FRAMES + len(states)), case.frame_count])
    rest = undeformed(states[0])
    scene = SolidScene(
        name=case.title,
        time_s=frames / FPS,
        states=(rest, rest, *states, states[-1]),
        seed=case.seed,
        duration_s=case.frame_count / FPS,
    )
    simulator = Simulator(
        sensor=sensor,
        scene=scene,
        fps=FPS,
        look=Look(tilt_x=0.12, tilt_y=-0.08, vignetting=0.25, read_noise=case.noise),
        optics=ImagingSettings(blur_px=0.8 * case.width_px / 1280),
    )
    numbers = range(case.frame_count)
    return SimulatedRecording(
        sensor=sensor,
        frames=tuple(simulator.frame(number) for number in numbers),
        truths=tuple(simulator.truth(number) for number in numbers),
    )
