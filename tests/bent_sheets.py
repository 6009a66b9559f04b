"""Sheets that are bent by known loads, and the markers that a camera sees of them."""

from itertools import zip_longest

import numpy as np

from layouts import grid_at, lattice_layout
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.camera import project
from manytouch.mechanics.shell.equilibrium import equilibrium
from manytouch.values import Sensor, Sheet, TrackedGrid
from straight import straight_camera

ROWS, COLUMNS, PITCH_MM = 12, 16, 4.0
YOUNG_MPA = 2.0


def sensor_of(**sheet: float | None) -> Sensor:
    known = {
        "thickness_mm": 3.0,
        "young_MPa": YOUNG_MPA,
        "poisson": 0.45,
        "pretension_N_per_mm": 0.2,
        "bending_factor": 1.0,
    }
    return Sensor(
        name="test",
        camera=straight_camera(1600, 1200, focal_px=2000.0, distance_mm=100.0),
        layout=lattice_layout(ROWS, COLUMNS, PITCH_MM),
        sheet=Sheet(size_mm=np.array([64.0, 48.0]), **{**known, **sheet}),
    )


def bent(
    model: InversionModel,
    *presses: tuple[float, float, float],
    radius_mm: float = 3.0,
    friction: tuple[tuple[float, float], ...] = (),
) -> np.ndarray:
    """Coefficients of the sheet under even pressure on discs.

    Args:
        model: of the sheet.
        presses: x, y, and force over E.
        radius_mm: of the discs.
        friction: shear over normal force along x and y of each press; none where absent.
    """
    angle = 2 * np.pi * np.arange(24) / 24
    ring = np.sqrt((np.arange(8) + 0.5) / 8) * radius_mm
    disc = np.stack([np.outer(ring, np.cos(angle)), np.outer(ring, np.sin(angle))], axis=-1).reshape(-1, 2)
    load = np.zeros((model.patch.node_count, 3))
    for (x, y, press), shear in zip_longest(presses, friction, fillvalue=(0.0, 0.0)):
        each = np.tile([shear[0] * press, shear[1] * press, -press], (len(disc), 1)) / len(disc)
        load += model.patch.load(disc + np.array([x, y]), each)
    return equilibrium(model.shell, load).coefficient_mm


def grid_of(model: InversionModel, shape: np.ndarray, noise_px: float = 0.02, seed: int = 0) -> TrackedGrid:
    centre_px = project(model.camera, model.layout.rest_mm) + model.dots.displacement_px(shape)
    return grid_at(centre_px, std_px=noise_px, noise_px=noise_px, seed=seed)
