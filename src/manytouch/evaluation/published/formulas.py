"""Equations 11 to 13: what each reading of them measures, against the true shape of the simulated sheet.

No image is processed: the methods get the true marker positions with the noise of a camera.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import get_args

import numpy as np
from jaxtyping import Float64

from manytouch.geometry.camera import onto_plane
from manytouch.paper.estimation import PaperEstimation, perimeter_depth
from manytouch.paper.quads import Formula
from manytouch.sources.simulated import SimulatedSource, simulated_source
from manytouch.values import Layout

NOISE_PX = 0.04
FRAME_STEP = 6
"""One frame of so many is evaluated."""
LEAST_DEPTH_MM = 1.0
"""Frames with a smaller largest depth are not counted."""
LAW = "law"
"""What the equations measure to first order, computed from the true displacement (docs/paper.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FormulaError:
    """Errors of one reading over the frames in which the sheet is pressed.

    Attributes:
        formula: of `PaperEstimation`, or `LAW`.
        rmse_mm, worst_rmse_mm: over the markers, of the median and the worst frame.
        excess, worst_excess: largest estimated over largest true depth, less 1; median and worst frame.
        frames: number of frames.
    """

    formula: str
    rmse_mm: float
    worst_rmse_mm: float
    excess: float
    worst_excess: float
    frames: int


def formula_errors(source: SimulatedSource | None = None) -> tuple[FormulaError, ...]:
    """The readings in their order and the law, on every sixth frame of a scene (default: the demo's)."""
    scene = simulated_source() if source is None else source
    layout, camera = scene.sensor.layout, scene.sensor.camera
    assert layout is not None
    estimates = {name: PaperEstimation(formula=name) for name in get_args(Formula)}
    states = {name: estimate.start(scene.sensor) for name, estimate in estimates.items()}
    chance = np.random.default_rng(0)
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in (*states, LAW)}
    distance_mm = next(iter(states.values())).distance_mm
    for index in range(0, scene.frame_count, FRAME_STEP):
        truth = scene.truth(index)
        moved_mm = truth.surface.displacement_mm
        true_mm = -moved_mm[:, 2]
        if not true_mm.max() > LEAST_DEPTH_MM:
            continue
        noisy_px = truth.grid.position_px + chance.normal(0.0, NOISE_PX, (len(true_mm), 2))
        plane_mm = onto_plane(camera, noisy_px)[:, :2]
        nothing_px2 = np.zeros((len(true_mm), 2, 2))
        for name, state in states.items():
            depth_mm, _ = perimeter_depth(state, plane_mm, nothing_px2)
            found[name].append(_error(depth_mm, true_mm))
        found[LAW].append(_error(law_mm(layout, moved_mm, distance_mm), true_mm))
    return tuple(_summary(name, errors) for name, errors in found.items())


def law_mm(
    layout: Layout, moved_mm: Float64[np.ndarray, "m 3"], distance_mm: float
) -> Float64[np.ndarray, " m"]:
    """m = w + (R . grad w) / 2 + d (du/dx + dv/dy) / 2 at the markers of a lattice of equal pitches.

    Args:
        layout: a lattice whose centre is on the optical axis.
        moved_mm: true displacements.
        distance_mm: from the camera to the markers at rest.
    """
    shape = layout.shape
    assert shape is not None
    u, v, w = (moved_mm * [1.0, 1.0, -1.0]).reshape(*shape, 3).transpose(2, 0, 1)
    step_mm = (float(layout.pitch_mm[1]), float(layout.pitch_mm[0]))
    w_y, w_x = np.gradient(w, *step_mm)
    stretch = np.gradient(u, *step_mm)[1] + np.gradient(v, *step_mm)[0]
    x_mm, y_mm = layout.rest_mm[:, 0].reshape(shape), layout.rest_mm[:, 1].reshape(shape)
    return np.asarray((w + 0.5 * (x_mm * w_x + y_mm * w_y) + 0.5 * distance_mm * stretch).ravel())


def _error(depth_mm: Float64[np.ndarray, " m"], true_mm: Float64[np.ndarray, " m"]) -> tuple[float, float]:
    rmse_mm = float(np.sqrt(np.nanmean((depth_mm - true_mm) ** 2)))
    return rmse_mm, float(np.nanmax(depth_mm) / true_mm.max() - 1.0)


def _summary(name: str, errors: Iterable[tuple[float, float]]) -> FormulaError:
    rmse_mm, excess = np.array(list(errors)).T
    return FormulaError(
        formula=name,
        rmse_mm=float(np.median(rmse_mm)),
        worst_rmse_mm=float(rmse_mm.max()),
        excess=float(np.median(excess)),
        worst_excess=float(excess[np.abs(excess).argmax()]),
        frames=len(rmse_mm),
    )
