"""Solved sheets that need no solver, for tests of what is done with them."""

import numpy as np

from manytouch.evaluation.suite.cases import RAMP_FRAMES, REST_FRAMES, Case, pressure_share
from manytouch.simulation.scene.deformation import Deformation, TrueContact
from manytouch.values.arrays import read_only


def bumps(case: Case) -> tuple[Deformation, ...]:
    """States without mechanics: a Gaussian dent under the first touch, 2 N per mm of its depth."""
    touch = case.touches[0]
    x_mm, y_mm = (np.linspace(-size / 2, size / 2, 41) for size in case.size_mm)
    away = np.hypot(x_mm[:, None] - touch.at_mm[0], y_mm[None] - touch.at_mm[1])
    hollow = np.exp(-0.5 * (away / 6.0) ** 2)
    states = []
    for step in range(RAMP_FRAMES):
        depth_mm = case.deepest_mm * pressure_share(REST_FRAMES + step)
        face_mm = np.zeros((41, 41, 3), dtype=np.float32)
        face_mm[:, :, 2] = -depth_mm * hollow
        contact = TrueContact(
            force_N=read_only(np.array([0.0, 0.0, -2.0 * depth_mm])),
            torque_Nmm=0.0,
            area_mm2=20.0,
            centre_mm=read_only(np.array(touch.at_mm)),
            depth_mm=depth_mm,
        )
        states.append(
            Deformation(x_mm=x_mm, y_mm=y_mm, face_mm=read_only(face_mm), contacts=(contact,), status="ok")
        )
    return tuple(states)
