"""Nodal forces of contacts on a pad and what they cause, compiled."""

# ruff: noqa: PLR0917 - compiled functions, called with positional arguments

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import REORDER, kernel, no_type_check, u64
from manytouch.estimation.pad.patch_kernels import (
    CENTRE_X,
    CENTRE_Y,
    DENSE_POINTS,
    DENSEST_POINTS,
    POINTS,
    ROOT_XX,
    ROOT_YX,
    ROOT_YY,
    SHAPE,
    PadGrid,
    add_pressure,
    cubic,
    density,
    moment_trace,
    radial_arm_slopes,
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
def _add_four(
    row: Float64[np.ndarray, " n"], at: int, factor: float, a: float, b: float, c: float, d: float
) -> None:
    row[at] += factor * a
    row[at + u64(1)] += factor * b
    row[at + u64(2)] += factor * c
    row[at + u64(3)] += factor * d


@kernel()
@no_type_check
def _add_load_slopes(
    parameters: Float64[np.ndarray, "10"],
    unit: Float64[np.ndarray, "3 nx ny"],
    slope: Float64[np.ndarray, "10 3 nx ny"],
) -> None:
    """The part of `fill_force_slopes` by what the loads do at points that stay, from `add_pressure`."""
    press, _, _, turn, arm_xx, arm_yx, arm_yy = load_of(parameters)
    xx, yx, yy = parameters[ROOT_XX], parameters[ROOT_YX], parameters[ROOT_YY]
    arm_slope = np.empty((3, 3))
    radial_arm_slopes(parameters, arm_slope)
    per_trace, (unit_xx, unit_yx, unit_yy) = 1.0 / moment_trace(parameters), radial_arms(parameters)
    radial = press * parameters[RADIAL_SHEAR]
    for m in range(slope.shape[2]):
        for n in range(slope.shape[3]):
            even, by_x, by_y = unit[0, m, n], unit[1, m, n], unit[2, m, n]
            if even == 0.0:
                continue
            of_x = by_x / xx
            of_y = (by_y - yx * of_x) / yy
            slope[ROOT_XX, 0, m, n] += arm_xx * of_x
            slope[ROOT_XX, 1, m, n] += (arm_yx + turn) * of_x
            slope[ROOT_YX, 0, m, n] += (arm_yx - turn) * of_x
            slope[ROOT_YX, 1, m, n] += arm_yy * of_x
            slope[ROOT_YY, 0, m, n] += (arm_yx - turn) * of_y
            slope[ROOT_YY, 1, m, n] += arm_yy * of_y
            for k in range(3):
                turned = -2.0 * parameters[ROOT_XX + k] * per_trace * turn
                by_xx, by_yx, by_yy = (
                    radial * arm_slope[k, 0],
                    radial * arm_slope[k, 1],
                    radial * arm_slope[k, 2],
                )
                slope[ROOT_XX + k, 0, m, n] += by_xx * by_x + (by_yx - turned) * by_y
                slope[ROOT_XX + k, 1, m, n] += (by_yx + turned) * by_x + by_yy * by_y
            slope[FORCE, 2, m, n] = -even
            slope[SHEAR_X, 0, m, n] = slope[SHEAR_Y, 1, m, n] = even
            slope[TORQUE, 0, m, n], slope[TORQUE, 1, m, n] = -per_trace * by_y, per_trace * by_x
            slope[RADIAL_SHEAR, 0, m, n] = unit_xx * by_x + unit_yx * by_y
            slope[RADIAL_SHEAR, 1, m, n] = unit_yx * by_x + unit_yy * by_y


@kernel()
@no_type_check
def fill_force_slopes(
    parameters: Float64[np.ndarray, "10"],
    profile: int,
    grid: PadGrid,
    slope: Float64[np.ndarray, "10 3 nx ny"],
) -> None:
    """Slopes of the nodal forces over E of a contact by its shape, then its nodal forces by unit loads.

    The last of them is for unit radial shear as a force. A point moves with the centre, and by its own place
    on the unit disc with a root; what the distributions of `add_pressure` gain by this is added up first.
    """
    level = density(parameters, grid)
    points = (DENSEST_POINTS if level == 2 else DENSE_POINTS if level == 1 else POINTS)[profile]
    press, shear_x, shear_y, turn, arm_xx, arm_yx, arm_yy = load_of(parameters)
    xx, yx, yy = parameters[ROOT_XX], parameters[ROOT_YX], parameters[ROOT_YY]
    along_x, along_y, slope_x, slope_y = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    unit = np.zeros((3, slope.shape[2], slope.shape[3]))
    slope[:] = 0.0
    for k in range(len(points)):
        x, y, weight = points[k, 0], points[k, 1], points[k, 2]
        ax, ay = xx * x, yx * x + yy * y
        place_x = (parameters[CENTRE_X] + ax - grid.corner_x) / grid.step_x
        place_y = (parameters[CENTRE_Y] + ay - grid.corner_y) / grid.step_y
        first_x = cubic(place_x, grid.count_x, along_x, slope_x)
        first_y = cubic(place_y, grid.count_y, along_y, slope_y)
        tx = weight * (shear_x + arm_xx * ax + (arm_yx - turn) * ay)
        ty = weight * (shear_y + (arm_yx + turn) * ax + arm_yy * ay)
        tz = -weight * press
        y0, y1, y2, y3 = along_y[0], along_y[1], along_y[2], along_y[3]
        g0, g1, g2, g3 = slope_y[0], slope_y[1], slope_y[2], slope_y[3]
        n = u64(first_y)
        for i in range(4):
            m, even, steep = first_x + i, along_x[i], slope_x[i] / grid.step_x
            _add_four(unit[0, m], n, weight * even, y0, y1, y2, y3)
            _add_four(unit[1, m], n, weight * even * ax, y0, y1, y2, y3)
            _add_four(unit[2, m], n, weight * even * ay, y0, y1, y2, y3)
            for axis in range(3):
                force = tx if axis == 0 else ty if axis == 1 else tz
                by_x, by_y = force * steep, force * even / grid.step_y
                _add_four(slope[CENTRE_X, axis, m], n, by_x, y0, y1, y2, y3)
                _add_four(slope[CENTRE_Y, axis, m], n, by_y, g0, g1, g2, g3)
                _add_four(slope[ROOT_XX, axis, m], n, x * by_x, y0, y1, y2, y3)
                _add_four(slope[ROOT_YX, axis, m], n, x * by_y, g0, g1, g2, g3)
                _add_four(slope[ROOT_YY, axis, m], n, y * by_y, g0, g1, g2, g3)
    _add_load_slopes(parameters, unit, slope)


@kernel()
@no_type_check
def fill_effects(
    parameters: Float64[np.ndarray, "10"],
    profile: int,
    grid: PadGrid,
    effect: Float64[np.ndarray, "nx ny 3"],
    slope: Float64[np.ndarray, "10"],
) -> None:
    """Slopes, by each parameter of a contact, of its nodal forces times their effects, summed."""
    force = np.empty((PARAMETER_COUNT, 3, effect.shape[0], effect.shape[1]))
    fill_force_slopes(parameters, profile, grid, force)
    for parameter in range(PARAMETER_COUNT):
        total = 0.0
        for axis in range(3):
            for i in range(effect.shape[0]):
                for j in range(effect.shape[1]):
                    total += force[parameter, axis, i, j] * effect[i, j, axis]
        slope[parameter] = total
    slope[FORCE] += parameters[RADIAL_SHEAR] * slope[RADIAL_SHEAR]
    slope[RADIAL_SHEAR] *= parameters[FORCE]


@kernel()
@no_type_check
def fill_basis(
    place_mm: Float64[np.ndarray, "k 2"],
    grid: PadGrid,
    node: Int64[np.ndarray, "k 2"],
    value: Float64[np.ndarray, "k 4 4"],
) -> None:
    """First nodes along x and y and the values of the B-splines there, for places on the pad."""
    along_x, along_y, unused = np.empty(4), np.empty(4), np.empty(4)
    for k in range(len(place_mm)):
        node[k, 0] = cubic((place_mm[k, 0] - grid.corner_x) / grid.step_x, grid.count_x, along_x, unused)
        node[k, 1] = cubic((place_mm[k, 1] - grid.corner_y) / grid.step_y, grid.count_y, along_y, unused)
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
