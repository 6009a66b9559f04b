"""What the nodes of a pad are too coarse to show of the depth under a patch."""

# ruff: noqa: PLR0917 - compiled functions, called with positional arguments

import numpy as np
from jaxtyping import Float64

from manytouch.compilation import REORDER, kernel, no_type_check
from manytouch.estimation.pad.patch_kernels import (
    CENTRE_X,
    CENTRE_Y,
    DENSE_POINTS,
    DENSEST_POINTS,
    POINTS,
    ROOT_XX,
    ROOT_YX,
    ROOT_YY,
    PadGrid,
    Profile,
    add_pressure,
    cubic,
    density,
)
from manytouch.mechanics.pad.patch_depth import PatchDepthTable, patch_depth

_FLAT = int(Profile.FLAT)
_STEP_MM = 1e-3  # of a root of the second moment, in finite differences


@kernel()
@no_type_check
def unresolved_depth(
    parameters: Float64[np.ndarray, "10"],
    profile: int,
    grid: PadGrid,
    table: PatchDepthTable,
    node_depth: Float64[np.ndarray, "px py"],
    slope: Float64[np.ndarray, "3"],
) -> float:
    """The depth of a layer under the pressure of a patch, less that on its nodes.

    Both are times E and per unit normal force, 1/mm: of the centre, under a flat face the work of the
    pressure over its force.

    Args:
        parameters, profile: of the patch.
        grid: of the pad.
        table, node_depth: `depth_table` and `node_depth` of `BondedPadModel`.
        slope: result; derivatives by the roots of the second moment xx, yx, yy.
    """
    shape = (3, grid.count_x + 3, grid.count_y + 3)
    level = density(parameters, grid)
    points = (DENSEST_POINTS if level == 2 else DENSE_POINTS if level == 1 else POINTS)[profile]
    pressed, changed, moved = np.zeros(shape), np.empty(shape), np.zeros(shape[1:])
    add_pressure(parameters, grid, points, pressed)
    if profile == _FLAT:
        _add_depths(pressed[0], node_depth, moved)
    else:
        _fill_centre(parameters, grid, changed[0])
        _add_depths(changed[0], node_depth, moved)
    found = patch_depth(parameters[ROOT_XX], parameters[ROOT_YX], parameters[ROOT_YY], profile, table)
    on_nodes = (pressed[0] * moved).sum()
    other = parameters.copy()
    for k in range(3):
        other[ROOT_XX + k] += _STEP_MM
        changed[:] = 0.0
        add_pressure(other, grid, points, changed)
        more = ((changed[0] - pressed[0]) * moved).sum() * (2.0 if profile == _FLAT else 1.0)
        depth = patch_depth(other[ROOT_XX], other[ROOT_YX], other[ROOT_YY], profile, table)
        slope[k] = (depth - found - more) / _STEP_MM
        other[ROOT_XX + k] = parameters[ROOT_XX + k]
    return float(found - on_nodes)


@kernel()
@no_type_check
def _fill_centre(
    parameters: Float64[np.ndarray, "10"], grid: PadGrid, seen: Float64[np.ndarray, "nx ny"]
) -> None:
    """The values of the B-splines at the centre of a patch."""
    along_x, along_y, unused = np.empty(4), np.empty(4), np.empty(4)
    first_x = cubic((parameters[CENTRE_X] - grid.corner_x) / grid.step_x, grid.count_x, along_x, unused)
    first_y = cubic((parameters[CENTRE_Y] - grid.corner_y) / grid.step_y, grid.count_y, along_y, unused)
    seen[:] = 0.0
    for i in range(4):
        for j in range(4):
            seen[first_x + i, first_y + j] = along_x[i] * along_y[j]


@kernel(fastmath=REORDER)
@no_type_check
def _add_depths(
    pressed: Float64[np.ndarray, "nx ny"],
    node_depth: Float64[np.ndarray, "px py"],
    moved: Float64[np.ndarray, "nx ny"],
) -> None:
    """Add the depths of the nodes by forces on them, none from half a period on."""
    columns, rows = node_depth.shape[0] // 2, node_depth.shape[1] // 2
    for m in range(pressed.shape[0]):
        for n in range(pressed.shape[1]):
            force = pressed[m, n]
            if force == 0.0:
                continue
            for i in range(max(0, m - columns), min(moved.shape[0], m + columns + 1)):
                for j in range(max(0, n - rows), min(moved.shape[1], n + rows + 1)):
                    moved[i, j] += force * node_depth[abs(i - m), abs(j - n)]
