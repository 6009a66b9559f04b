"""Pictures and truth of a varied case from its states."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.evaluation.suite.cases import HOLD_FRAMES, REST_FRAMES
from manytouch.evaluation.suite.sensors import true_sensor
from manytouch.evaluation.suite.varied.cases import VariedCase
from manytouch.simulation.render.discs import Look
from manytouch.simulation.render.optics import ImagingSettings
from manytouch.simulation.scene.deformation import Deformation, TrueContact, undeformed
from manytouch.simulation.scene.solid_scene import SolidScene
from manytouch.simulation.simulator import Simulator
from manytouch.values import Frame, Sensor, Truth
from manytouch.values.arrays import read_only

FPS = 30.0
RELAXATION_S = 0.1


def simulate_varied(
    case: VariedCase, states: tuple[Deformation, ...]
) -> tuple[Sensor, tuple[Frame, ...], tuple[Truth, ...]]:
    """The true sensor, pictures and truth; displacements and depths are those since the sheet at rest."""
    sensor = true_sensor(case)
    rest = replace(states[0], contacts=()) if case.is_sagging else undeformed(states[0])
    shown = relaxing(case, [_since(rest, state) for state in states[case.is_sagging :]])
    scene = SolidScene(
        name=case.title,
        time_s=np.array([0, *range(REST_FRAMES - 1, case.frame_count + 1)]) / FPS,
        states=(rest, rest, *shown, shown[-1]),
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
    truths = [simulator.truth(number) for number in numbers]
    rest_mm = truths[0].surface.displacement_mm
    return (
        sensor,
        tuple(simulator.frame(number) for number in numbers),
        tuple(
            replace(
                truth,
                surface=replace(
                    truth.surface, displacement_mm=read_only(truth.surface.displacement_mm - rest_mm)
                ),
            )
            for truth in truths
        ),
    )


def relaxing(case: VariedCase, pressed: Sequence[Deformation]) -> list[Deformation]:
    """The state of each frame in which something presses, with forces of quasi-linear viscoelasticity.

    A Maxwell branch (Y. C. Fung, Biomechanics, 1993, 7.6) adds `relaxing_share` of every change of a force,
    which fades with `RELAXATION_S`; the shape under rigid bodies stays.
    """
    count = len(pressed[0].contacts)
    branch_N, before_N, shown = np.zeros(count), np.zeros(count), []
    for state in (one for one in pressed for _ in range(HOLD_FRAMES)):
        now_N = np.array([contact.normal_force_N for contact in state.contacts])
        branch_N = branch_N * np.exp(-1.0 / (FPS * RELAXATION_S)) + case.relaxing_share * (now_N - before_N)
        factor = 1.0 + np.divide(branch_N, now_N, out=np.zeros(count), where=now_N > 0.0)
        contacts = (
            replace(one, force_N=read_only(one.force_N * share), torque_Nmm=one.torque_Nmm * share)
            for one, share in zip(state.contacts, factor.tolist(), strict=True)
        )
        shown.append(replace(state, contacts=tuple(contacts)))
        before_N = now_N
    return shown


def _since(rest: Deformation, state: Deformation) -> Deformation:
    """The state with depths of its contacts that count from the sheet at rest."""

    def deeper(contact: TrueContact) -> TrueContact:
        if not contact.is_touching:
            return contact
        sag_mm = -float(rest.displacement_mm(contact.centre_mm[None])[0, 2])
        return replace(contact, depth_mm=contact.depth_mm - sag_mm)

    return replace(state, contacts=tuple(deeper(contact) for contact in state.contacts))
