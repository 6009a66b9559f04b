"""Nodal forces of contacts on a pad and what they cause, compiled."""

# ruff: noqa: PLR0917 - compiled functions, called with positional arguments

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.pad.patch_kernels import (
    DENSE_POINTS,
    DENSEST_POINTS,
    POINTS,
    SHAPE,
    PadGrid,
    add_pressure,
    cubic,
    density,
    moment_trace,
    radial_arms,
)

LOAD_COUNT = 5
"""Number of loads of a contact: normal force, shear x, y and torque, over E; radial shear over normal
force (`radial_arms`), positive outwards."""
PARAMETER_COUNT = SHAPE + LOAD_COUNT
"""Number of parameters of a contact: those of its shape, then its loads."""
FORCE, SHEAR_X, SHEAR_Y, TORQUE, RADIAL_SHEAR = range(SHAPE, PARAMETER_COUNT)
"""Places of the loads among the parameters."""


@kernel()
@no_type_check
def load_of(
    parameters: Float64[np.ndarray, "10"],
) -> tuple[float, float, float, float, float, float, float]:
    """Normal force, shear x and y, the factor of the turn, and the matrix xx, yx, yy of the radial shear."""
    turn, radial = parameters[TORQUE] / moment_trace(parameters), parameters[FORCE] * parameters[RADIAL_SHEAR]
    xx, yx, yy = radial_arms(parameters)
    shear_x, shear_y = parameters[SHEAR_X], parameters[SHEAR_Y]
    return parameters[FORCE], shear_x, shear_y, turn, radial * xx, radial * yx, radial * yy


@kernel()
@no_type_check
def image_load_of(
    parameters: Float64[np.ndarray, "10"], gain: float
) -> tuple[float, float, float, float, float, float, float]:
    """`load_of` with the gain of the turn by `spread_of`."""
    press, shear_x, shear_y, turn, xx, yx, yy = load_of(parameters)
    return press, shear_x, shear_y, gain * turn, xx, yx, yy


@kernel()
@no_type_check
def add_tractions(
    parameters: Float64[np.ndarray, "10"],
    profile: int,
    grid: PadGrid,
    level: int,
    spread: Float64[np.ndarray, "3 nx ny"],
    nodal: Float64[np.ndarray, "3 nx ny"],
) -> None:
    """Add the nodal forces over E of a contact to `nodal`; `spread` is overwritten by those of unit loads.

    `level` is the `density` of the contact, or of one near it where both are compared.
    """
    spread[:] = 0.0
    points = DENSEST_POINTS if level == 2 else DENSE_POINTS if level == 1 else POINTS
    add_pressure(parameters, grid, points[profile], spread)
    press, shear_x, shear_y, turn, arm_xx, arm_yx, arm_yy = load_of(parameters)
    for i in range(spread.shape[1]):
        for j in range(spread.shape[2]):
            even, by_x, by_y = spread[0, i, j], spread[1, i, j], spread[2, i, j]
            nodal[0, i, j] += shear_x * even + arm_xx * by_x + (arm_yx - turn) * by_y
            nodal[1, i, j] += shear_y * even + (arm_yx + turn) * by_x + arm_yy * by_y
            nodal[2, i, j] -= press * even


@kernel()
@no_type_check
def pressing_work(
    parameters: Float64[np.ndarray, "10"], profile: int, grid: PadGrid, moved: Float64[np.ndarray, "nx ny 3"]
) -> float:
    """Work over E of the pressure and the radial shear of a contact on displacements of the nodes, mm^3."""
    pressing = parameters.copy()
    pressing[SHEAR_X : TORQUE + 1] = 0.0
    shape = (3, moved.shape[0], moved.shape[1])
    spread, nodal, total = np.empty(shape), np.zeros(shape), 0.0
    add_tractions(pressing, profile, grid, density(parameters, grid), spread, nodal)
    for i in range(shape[1]):
        for j in range(shape[2]):
            for axis in range(3):
                total += nodal[axis, i, j] * moved[i, j, axis]
    return total


@kernel()
@no_type_check
def fill_effects(
    parameters: Float64[np.ndarray, "10"],
    profile: int,
    step: Float64[np.ndarray, "10"],
    grid: PadGrid,
    effect: Float64[np.ndarray, "nx ny 3"],
    slope: Float64[np.ndarray, "10"],
) -> None:
    """Slopes, over steps of each parameter of a contact, of its nodal forces times their effects, summed."""
    shape = (3, effect.shape[0], effect.shape[1])
    spread, nodal, moved = np.empty(shape), np.zeros(shape), parameters.copy()
    level = density(parameters, grid)
    add_tractions(parameters, profile, grid, level, spread, nodal)
    change = np.empty(shape)
    for parameter in range(PARAMETER_COUNT):
        moved[parameter] = parameters[parameter] + step[parameter]
        change[:] = -nodal
        add_tractions(moved, profile, grid, level, spread, change)
        total = 0.0
        for i in range(shape[1]):
            for j in range(shape[2]):
                for axis in range(3):
                    total += change[axis, i, j] * effect[i, j, axis]
        slope[parameter] = total / step[parameter]
        moved[parameter] = parameters[parameter]


@kernel()
@no_type_check
def fill_basis(
    place_mm: Float64[np.ndarray, "k 2"],
    grid: PadGrid,
    node: Int64[np.ndarray, "k 2"],
    value: Float64[np.ndarray, "k 4 4"],
) -> None:
    """First nodes along x and y and the values of the B-splines there, for places on the pad."""
    along_x, along_y = np.empty(4), np.empty(4)
    for k in range(len(place_mm)):
        node[k, 0] = cubic((place_mm[k, 0] - grid.corner_x) / grid.step_x, grid.count_x, along_x)
        node[k, 1] = cubic((place_mm[k, 1] - grid.corner_y) / grid.step_y, grid.count_y, along_y)
        for i in range(4):
            for j in range(4):
                value[k, i, j] = along_x[i] * along_y[j]


@kernel(fastmath=REORDER)
@no_type_check
def add_scaled(factor: float, values: Float64[np.ndarray, " r"], total: Float64[np.ndarray, " r"]) -> None:
    """Add values times a factor to `total`, r each."""
    for k in range(len(total)):
        total[k] += factor * values[k]


@kernel(fastmath=REORDER)
@no_type_check
def add_answers(
    nodal_mm2: Float64[np.ndarray, "nodes 3"],
    answer: Float64[np.ndarray, "nodes 3 k 3"],
    moved_mm: Float64[np.ndarray, "k 3"],
) -> None:
    """Add the displacements by nodal forces over E, with the response to each, to `moved_mm`."""
    for node in range(len(nodal_mm2)):
        for axis in range(3):
            force = nodal_mm2[node, axis]
            if force == 0.0:
                continue
            for k in range(len(moved_mm)):
                for j in range(3):
                    moved_mm[k, j] += force * answer[node, axis, k, j]
