"""Recordings of the cases of bonded pads, from solved presses that ship with the package."""

from dataclasses import replace
from importlib.resources import files

import numpy as np

from manytouch.evaluation.suite.cases import HOLD_FRAMES, REST_FRAMES
from manytouch.evaluation.suite.pads.cases import PadCase
from manytouch.evaluation.suite.pads.pad_sensors import true_pad
from manytouch.simulation.render.discs import DARK_DOTS
from manytouch.simulation.scene.deformation import Deformation, undeformed
from manytouch.simulation.scene.deformation_file import read_deformations
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Frame, Sensor, Truth

FPS = 30.0


def pad_states(case: PadCase) -> tuple[tuple[Deformation, Deformation], ...]:
    """The plane of the markers, which also has the contact face, and this face, at each depth.

    Raises:
        SourceError: the file is missing or damaged.
    """
    found = read_deformations(files("manytouch.evaluation") / "deformations" / case.solution)
    return tuple((state, state.touched) for state in found.values())


def simulate_pad(case: PadCase) -> tuple[Sensor, tuple[Frame, ...], tuple[Truth, ...]]:
    """The true sensor, pictures and truth; depth and surface refer to the contact face over the markers."""
    sensor, states = true_pad(case), pad_states(case)
    rest = undeformed(states[0][0])
    held = [frame for step in range(len(states)) for frame in _span(step)]
    scene = SolidScene(
        name=case.title,
        time_s=np.array([0, REST_FRAMES - 1, *held, case.frame_count]) / FPS,
        states=(rest, rest, *(markers for markers, _ in states for _ in range(2)), states[-1][0]),
        seed=case.seed,
        duration_s=case.frame_count / FPS,
    )
    look = replace(
        DARK_DOTS, tilt_x=0.1, tilt_y=-0.05, vignetting=0.2, read_noise=case.noise, shot_noise=0.02
    )
    simulator = Simulator(sensor=sensor, scene=scene, fps=FPS, look=look)
    frames = tuple(simulator.frame(number) for number in range(case.frame_count))
    truths = tuple(simulator.truth(number) for number in range(case.frame_count))
    return sensor, frames, truths


def _span(step: int) -> tuple[int, int]:
    """First and last frame of a depth."""
    first = REST_FRAMES + step * HOLD_FRAMES
    return first, first + HOLD_FRAMES - 1
